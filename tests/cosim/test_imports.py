"""What is loaded: names of `cosim` when they are used, the command line's work when it is done."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

import cosim

ROOT = Path(__file__).parents[2]


def loaded(program: str) -> set[str]:
    """Modules that a new interpreter has after a program."""
    program += "\nimport sys\nprint('\\n'.join(['', *sys.modules]), file=sys.stderr)\n"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return set(done.stderr.split())


def test_importing_the_package_loads_nothing_of_it() -> None:
    found = loaded("import cosim")
    assert {name for name in found if name.startswith("cosim")} == {
        "cosim", "cosim.arithmetic",
    }  # fmt: skip
    assert not found & {"numpy", "typer", "rich"}


CHOICE = ("OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES")


def arithmetic(program: str, **variables: str) -> str:
    """What a new interpreter prints."""
    known = {k: v for k, v in os.environ.items() if k not in CHOICE}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", program], capture_output=True, text=True, cwd=ROOT,
        env={**known, "PYTHONPATH": str(ROOT), **variables},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_the_package_chooses_the_arithmetic_before_numpy_is_loaded() -> None:
    found = arithmetic("import cosim, os\nprint(os.environ.get('OPENBLAS_CORETYPE'))")
    features = cosim.arithmetic._features()
    assert found.strip() == ("Haswell" if {"avx2", "fma"} <= features else "None")
    assert (
        arithmetic(
            "import cosim, os\nprint(os.environ['OPENBLAS_CORETYPE'])", OPENBLAS_CORETYPE="Prescott"
        ).strip()
        == "Prescott"
    )  # who sets it has chosen
    late = "import numpy, cosim, os\nprint('OPENBLAS_CORETYPE' in os.environ)"
    assert arithmetic(late).strip() == "False"


@pytest.mark.slow
def test_a_run_loads_neither_command_line_nor_pictures() -> None:
    found = loaded(
        "import cosim, pathlib, tempfile\n"
        "result = cosim.run('motor_bench/ST1', duration=0.01)\n"
        "with tempfile.TemporaryDirectory() as folder:\n"
        "    assert result.recording.keep(pathlib.Path(folder, 'run')).exists()"
    )
    assert {"cosim.running.runner", "numpy"} <= found
    rooms = {name.split(".")[1] for name in found if name.startswith("cosim.")}
    assert not rooms & {"calibrate", "cli", "control", "diagnose", "report", "study"}
    assert not found & {"matplotlib", "pandas", "rich", "scipy.integrate", "typer"}
    # unless its FMUs had to be built, which a second run in the same cache needs no more
    again = loaded("import cosim\ncosim.run('motor_bench/ST1', duration=0.01)")
    assert "sources.packaging.ready" in again and "casadi" not in again


@pytest.mark.slow
def test_what_is_built_loads_what_builds(tmp_path: Path) -> None:
    """The twin of the test above: CasADi would be seen."""
    found = loaded(
        "from pathlib import Path\nfrom cosim.installation.builder import Builder\n"
        f"Builder(Path({str(tmp_path)!r})).path('gearbox/ratio')"
    )
    assert {"casadi", "sources.packaging.build"} <= found


@pytest.mark.slow
def test_a_picture_loads_what_draws() -> None:
    """The twin of the test above: matplotlib would be seen."""
    found = loaded(
        "import cosim, numpy\n"
        "cosim.Recording(numpy.arange(3.0), numpy.ones((3, 1)), ('a.x',), {}).plot()"
    )
    assert "matplotlib" in found and "cosim.running.runner" not in found


def test_diagnoses_begin_without_the_slow_parts_of_scipy() -> None:
    """They are most of a second, and few logs need a filter."""
    found = loaded("import cosim.diagnose, cosim.monitor, cosim.study.sensitivity")
    assert "scipy.special" in found
    assert not found & {"scipy.signal", "scipy.stats", "matplotlib", "typer"}


def test_help_loads_nothing_that_works() -> None:
    found = loaded(
        "import sys\nfrom cosim.cli import main\nsys.argv = ['cosim', '--help']\n"
        "try:\n    main()\nexcept SystemExit as end:\n    assert not end.code"
    )
    assert "typer" in found
    assert not found & {"matplotlib", "numpy", "pandas", "scipy"}


def test_names_for_type_checkers_are_those_that_are_loaded() -> None:
    tree = ast.parse(Path(cosim.__file__).read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    typed = {
        alias.name: node.module or ""
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert ast.unparse(block.test) == "TYPE_CHECKING"
    assert typed == {**cosim._HOMES, "errors": ""}
    assert sorted(typed) == cosim.__all__
    for name, home in cosim._HOMES.items():
        assert getattr(cosim, name) is getattr(sys.modules[f"cosim.{home}"], name)
    assert cosim.errors.CosimError is cosim.CosimError


def test_a_name_that_is_not_there() -> None:
    with pytest.raises(AttributeError, match=r"module 'cosim' has no attribute 'Sistem'"):
        _ = cosim.Sistem
    assert set(cosim.__all__) <= set(dir(cosim))
