"""FMPy rebuilds the binary from the C sources inside the FMU, with cmake and a C compiler."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.build import build_platform_binary

from tests.fmus import fmu

pytestmark = pytest.mark.slow

COMPILERS = ("cc", "gcc", "clang", "cl")


@pytest.mark.parametrize("fmi", [2, 3])
def test_rebuilt_binary_computes_the_same(fmi: int, tmp_path: Path) -> None:
    if not shutil.which("cmake"):
        pytest.skip("there is no cmake")
    if not any(map(shutil.which, COMPILERS)):
        pytest.skip(f"there is no C compiler ({', '.join(COMPILERS)})")
    path = fmu("dc_motor/sampled", fmi=fmi)
    folder, built = tmp_path / "fmu", tmp_path / "build"
    fmpy.extract(str(path), str(folder))
    shutil.rmtree(folder / "binaries")
    built.mkdir()
    build_platform_binary(folder, built)
    (library,) = [item for item in (folder / "binaries").rglob("*") if item.is_file()]
    found, expected = (
        fmpy.simulate_fmu(
            str(source),
            stop_time=0.02,
            output_interval=1e-3,
            start_values={"w_ref": 100.0, "w": 20.0},
        )
        for source in (folder, path)
    )
    assert library.stat().st_size > 0
    for name in expected.dtype.names:
        # another compiler may fuse a product and a sum into one rounding: 1e-12 of the largest
        # value leaves room for some 1000 of those
        scale = np.abs(expected[name]).max()
        np.testing.assert_allclose(found[name], expected[name], rtol=0, atol=1e-12 * scale)
    assert np.ptp(expected["i"]) > 0


@pytest.mark.parametrize("fmi", [2, 3])
def test_sources_compile_without_a_warning(fmi: int, tmp_path: Path) -> None:
    compiler = shutil.which("gcc") or shutil.which("clang")
    if not compiler:
        pytest.skip("there is neither gcc nor clang")
    for variant in ("gearbox/ratio", "dc_motor/sampled"):
        folder = tmp_path / variant.replace("/", "-")
        fmpy.extract(str(fmu(variant, fmi=fmi)), str(folder))
        flags = ["-std=c99", "-Wall", "-Wextra", "-Wno-unused-function", "-c", "-o", "all.o"]
        # CasADi's functions have arguments that some models do not use
        flags += ["-Wno-unused-parameter", "-Wno-unused-const-variable"]
        result = subprocess.run(
            [compiler, *flags, "all.c"],
            cwd=folder / "sources",
            capture_output=True,
            text=True,
            check=False,
        )
        assert (result.returncode, result.stderr) == (0, "")
