"""cosim runs FMUs that others made: it must not know how ours are made."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
MODULES = sorted((ROOT / "cosim").rglob("*.py"))
FORBIDDEN = {"sources", "cosim_library", "casadi", "pythonfmu", "ziglang", "scenarios", "tests"}


def imported(tree: ast.AST, package_depth: int = 0) -> set[str]:
    """Top-level names of absolute imports, and relative ones that leave the package."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            if node.level == 0:
                found.add((node.module or "").partition(".")[0])
            elif node.level > package_depth:
                found.add("beyond")
    return found


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_cosim_imports_nothing_of_the_sources(path: Path) -> None:
    depth = len(path.relative_to(ROOT).parts) - 1
    tree = ast.parse(path.read_text(encoding="utf-8"))
    assert not imported(tree, depth) & (FORBIDDEN | {"beyond"})


def test_who_imports_by_name() -> None:
    users = {
        path.relative_to(ROOT).as_posix()
        for path in MODULES
        if "import_module" in path.read_text(encoding="utf-8")
    }
    assert users == {
        "cosim/__init__.py",  # its names when they are used
        "cosim/installation/builder.py",  # the sources
        "cosim/master/algorithms/__init__.py",  # its own submodules
    }


@pytest.mark.slow
def test_a_run_from_a_folder_of_fmus_needs_no_sources(tmp_path: Path) -> None:
    from tests.fmus import fmu

    script = tmp_path / "script.py"
    script.write_text(
        f"""
import sys
class Block:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {sorted(FORBIDDEN)!r}:
            raise ImportError(name + " is not for cosim")
sys.meta_path.insert(0, Block())
import pkgutil, importlib, cosim
for info in pkgutil.walk_packages(cosim.__path__, "cosim."):
    if not info.name.endswith("__main__"):
        importlib.import_module(info.name)
system = cosim.System(provider=cosim.FolderProvider({str(fmu("gearbox/ratio").parent)!r}))
system.add("gearbox", "gearbox/ratio")
recording = cosim.Master(system, step=0.1).run(0.2, inputs={{"gearbox.tau_a": 1.0}})
assert recording["gearbox.tau_b"][-1] > 0
print([name for name in {sorted(FORBIDDEN)!r} if name in sys.modules])
"""
    )
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, cwd=ROOT,
        env={"PYTHONPATH": str(ROOT), "COSIM_CACHE": str(tmp_path / "cache"), "PATH": ""},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"
