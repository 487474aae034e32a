"""An installed wheel: no checkout around, `cosim_library` instead of `sources` and `scenarios`."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fmus import fmu

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
RUN = ["run", "motor_bench/ST1", "--step", "1e-3", "--duration", "0.05", "--json"]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder as the wheel fills it."""
    folder = tmp_path_factory.mktemp("site")
    ignored = shutil.ignore_patterns("__pycache__", "*.fmu")
    shutil.copytree(ROOT / "cosim", folder / "cosim", ignore=ignored)
    for name in ("sources", "scenarios"):
        shutil.copytree(ROOT / name, folder / "cosim_library" / name, ignore=ignored)
    shutil.copy(ROOT / "LICENSE", folder / "cosim_library")
    (folder / "cosim_library" / "fmus" / "fmi2").mkdir(parents=True)
    return folder


def call(site: Path, work: Path, *arguments: str, blocked: str = "") -> tuple[int, str, str]:
    program = "import sys\n"
    if blocked:
        program += f"sys.modules[{blocked!r}] = None\n"
    program += f"sys.argv = ['cosim', *{list(arguments)!r}]\nfrom cosim.cli import main\nmain()\n"
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=work, capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": str(site)},
    )  # fmt: skip
    return done.returncode, done.stdout, done.stderr


def test_runs_from_any_folder_and_builds_what_is_missing(site: Path, tmp_path: Path) -> None:
    code, out, err = call(site, tmp_path, *RUN)
    assert code == 0, err
    assert json.loads(out)["scenario"] == "motor_bench/ST1"
    assert (tmp_path / "out" / "motor_bench" / "ST1" / "result.json").is_file()
    assert not (site / "sources").exists()


def test_without_casadi_only_ready_fmus_run(site: Path, tmp_path: Path) -> None:
    code, out, err = call(site, tmp_path, *RUN, blocked="casadi")
    assert code == 2 and out == ""
    assert "building FMUs needs casadi, which is not installed" in err
    for name in ("dc_motor.lab_bench/sampled", "gearbox.lab_bench/ratio", "inertia.lab_bench/disc",
                 "encoder.motor_bench/counts"):  # fmt: skip
        shutil.copy(fmu(name), site / "cosim_library" / "fmus" / "fmi2")
    code, out, err = call(site, tmp_path, *RUN, blocked="casadi")
    assert code == 0, err
    assert json.loads(out)["fmu_steps"] == 200
    code, out, err = call(site, tmp_path, "fmus", "list", "--json", blocked="casadi")
    assert code == 0, err
    assert "inertia.lab_bench/disc" in {entry["variant"] for entry in json.loads(out)}
