"""Binaries for other platforms, run here: ARM Linux by qemu, Windows by Wine.

A small C program (`driver.c`), compiled for the same platform, loads the library and steps it.
Needs `qemu-aarch64` and an ARM C library (installed, or in a folder that QEMU's own variable
QEMU_LD_PREFIX names), and `wine64` or `wine`; what is missing is skipped with the reason.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path

import fmpy
import numpy as np
import pytest

from sources.packaging.build import build
from sources.packaging.cache import cache_folder
from sources.packaging.platforms import PLATFORMS, host_platform

pytestmark = pytest.mark.emulated

DRIVER = Path(__file__).with_name("driver.c")
WINE = ("wine64", "wine")
QEMU = ("qemu-aarch64", "qemu-aarch64-static")


@lru_cache
def driver(platform: str) -> Path:
    """The driver as a program for a platform."""
    target = PLATFORMS[platform].target
    path = cache_folder("emulated") / (f"driver-{platform}" + ".exe" * ("windows" in platform))
    command = [sys.executable, "-m", "ziglang", "cc", "-target", target, "-std=c99", "-O1", "-s"]
    command += ["-o", str(path), str(DRIVER), *([] if "windows" in platform else ["-ldl"])]
    zig = str(cache_folder("zig"))
    environment = {**os.environ, "ZIG_GLOBAL_CACHE_DIR": zig, "ZIG_LOCAL_CACHE_DIR": zig}
    subprocess.run(command, check=True, env=environment, capture_output=True)
    return path


@pytest.fixture(scope="module", params=["aarch64-linux", "x86_64-windows"])
def emulator(request: pytest.FixtureRequest) -> Iterator[tuple[str, list[str], dict[str, str]]]:
    """Platform, command in front of a program, and environment."""
    platform = request.param
    if platform == host_platform():
        pytest.skip(f"{platform} is this machine")
    programs = QEMU if platform == "aarch64-linux" else WINE
    program = next(filter(None, map(shutil.which, programs)), None)
    if not program:
        pytest.skip(f"there is no {' or '.join(programs)}")
    prefix = tempfile.mkdtemp(prefix="cosim-wine-")
    environment = {**os.environ, "WINEPREFIX": prefix, "WINEDEBUG": "-all", "DISPLAY": ""}
    try:
        started = run([program, str(driver(platform))], environment, timeout=180)
        if started.stdout.strip() != "ready":
            said = (started.stderr.strip().splitlines() or ["nothing"])[-1]
            pytest.skip(f"{Path(program).name} does not start programs for {platform}: {said}")
        yield platform, [program], environment
    finally:
        if platform == "x86_64-windows":
            server = shutil.which("wineserver") or shutil.which("wineserver64")
            if server:
                subprocess.run([server, "-k"], env=environment, check=False)
        shutil.rmtree(prefix, ignore_errors=True)


def run(
    command: list[str], environment: Mapping[str, str], text: str = "", timeout: float = 60
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command,
        input=text,
        env=dict(environment),
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


@lru_cache
def fmu_of_all_platforms(variant: str, fmi: int) -> Path:
    out = cache_folder("emulated")
    return build(variant, out=out, fmi=fmi, platform="all")  # type: ignore[arg-type]


def results(
    variant: str,
    fmi: int,
    platform: str,
    folder: Path,
    front: list[str],
    environment: Mapping[str, str],
    *,
    step: float,
    count: int,
) -> np.ndarray:
    path = fmu_of_all_platforms(variant, fmi)
    description = fmpy.read_model_description(str(path))
    names = PLATFORMS[platform]
    binary = f"{names.fmi2 if fmi == 2 else names.fmi3}/{description.coSimulation.modelIdentifier}"
    library = folder / f"{platform}{names.suffix}"
    with zipfile.ZipFile(path) as archive:
        library.write_bytes(archive.read(f"binaries/{binary}{names.suffix}"))
    variables = description.modelVariables
    inputs = [v for v in variables if v.causality == "input"]
    values = [
        f"{v.valueReference} {float(v.start) + 0.3 * (1 + k % 3) * float(v.nominal or 1.0)!r}"
        for k, v in enumerate(inputs)
    ]
    outputs = [str(v.valueReference) for v in variables if v.causality == "output"]
    text = f"{len(values)} {' '.join(values)} {len(outputs)} {' '.join(outputs)}\n"
    given = [f"./{library.name}", str(fmi), description.guid, repr(step), str(count)]
    command = [*front, str(driver(platform)), *given]
    done = subprocess.run(
        command,
        input=text,
        env=dict(environment),
        capture_output=True,
        text=True,
        timeout=180,
        check=False,
        cwd=folder,
    )
    assert done.returncode == 0, done.stderr
    return np.array([[float.fromhex(x) for x in line.split()] for line in done.stdout.splitlines()])


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(
    ("variant", "step", "count", "exact"),
    [
        ("dc_motor/sampled", 1e-4, 1000, True),  # arithmetic only
        ("gearbox/elastic", 1e-3, 300, False),  # tanh, pow
        ("crawler/track_contact", 1e-2, 300, False),  # sin, cos, an error-controlled solver
        ("ur5_arm/rigid", 1e-3, 500, False),  # sin, cos
    ],
)
def test_results_are_those_of_this_machine(
    emulator: tuple[str, list[str], dict[str, str]],
    variant: str,
    step: float,
    count: int,
    exact: bool,
    fmi: int,
    tmp_path: Path,
    record_property: pytest.RecordProperty,
) -> None:
    platform, front, environment = emulator
    settings = {"step": step, "count": count}
    here = results(variant, fmi, host_platform(), tmp_path, [], os.environ, **settings)
    there = results(variant, fmi, platform, tmp_path, front, environment, **settings)
    assert here.shape == there.shape and len(here) == count
    scale = np.abs(here).max(axis=0)
    worst = float((np.abs(there - here) / np.where(scale > 0, scale, 1.0)).max())
    record_property("largest difference", worst)
    print(f"{variant} FMI {fmi} on {platform}: largest difference {worst:.1e} of the largest value")
    if exact:
        np.testing.assert_array_equal(there, here)
    # Other C libraries round sin, cos, tanh and pow apart by a last bit, and the models carry that
    # on; 1e-12 of the largest value leaves room for some 500 steps (1e-15 was seen).
    assert worst < 1e-12
    assert np.ptp(here, axis=0).max() > 0
