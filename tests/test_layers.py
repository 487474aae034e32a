"""Arrows between rooms go down, and cosim does not know how our FMUs are made."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
MODULES = sorted((ROOT / "cosim").rglob("*.py"))
ROOMS = (
    "arithmetic", "errors", "reading", "arguments", "files", "display", "spec", "data", "fmu",
    "drawing", "system", "master", "installation", "scenario", "ssp", "view", "running", "robots",
    "control", "study", "calibrate", "diagnose", "intake", "live", "monitor", "report", "cli",
    "__main__",
)  # fmt: skip
"""Of `cosim`, from the bottom up: each may import those before it."""
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


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def inner_imports(path: Path, modules: set[str]) -> set[str]:
    """Modules of cosim that a module imports: anywhere, within functions and for typing too."""
    package = module_name(path).split(".")
    if path.name != "__init__.py":
        package.pop()
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            parent = ".".join([*base, *filter(None, [node.module])])
            for alias in node.names:
                whole = f"{parent}.{alias.name}"
                found.add(whole if whole in modules else parent)
    return (found & modules) - {module_name(path)}


def graph() -> dict[str, set[str]]:
    modules = {module_name(path) for path in MODULES}
    return {module_name(path): inner_imports(path, modules) for path in MODULES}


def room(module: str) -> str:
    return module.split(".")[1] if "." in module else ""


def test_every_room_has_its_place() -> None:
    assert {room(module) for module in graph()} == {"", *ROOMS}


def test_arrows_between_rooms_go_down() -> None:
    upwards = [
        f"{module} -> {target}"
        for module, targets in graph().items()
        for target in targets
        if room(module) and room(target) != room(module)
        and (not room(target) or ROOMS.index(room(target)) > ROOMS.index(room(module)))
    ]  # fmt: skip
    assert upwards == []


def circles(arrows: dict[str, set[str]]) -> list[str]:
    """What is left when modules at the bottom, then those at the top, are taken away."""
    left = {module: set(targets) for module, targets in arrows.items()}
    for _ in range(2):
        while bottom := [module for module, targets in left.items() if not targets & set(left)]:
            for module in bottom:
                del left[module]
        turned: dict[str, set[str]] = {module: set() for module in left}
        for module, targets in left.items():
            for target in targets & set(left):
                turned[target].add(module)
        left = turned
    return sorted(left)


def test_no_modules_import_each_other() -> None:
    assert circles(graph()) == []


def test_a_circle_is_seen() -> None:
    arrows = {"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"e"}, "e": set()}
    assert circles(arrows) == ["b", "c"]


def test_few_files_lie_outside_of_rooms_and_none_is_long() -> None:
    at_top = [path for path in MODULES if path.parent == ROOT / "cosim"]
    sources = [*MODULES, *(ROOT / "sources").rglob("*.py"), *(ROOT / "cosim").rglob("*.c")]
    lines = {
        path.relative_to(ROOT).as_posix(): len(path.read_text(encoding="utf-8").splitlines())
        for path in sources
    }
    assert len(at_top) <= 8
    assert {name: count for name, count in lines.items() if count > 500} == {}


def test_only_the_builder_and_the_algorithms_import_by_name() -> None:
    users = {
        path.relative_to(ROOT).as_posix()
        for path in MODULES
        if "import_module" in path.read_text(encoding="utf-8")
    }
    assert users == {
        "cosim/__init__.py",  # its names when they are used
        "cosim/installation/builder.py",  # the sources
        "cosim/master/algorithms/__init__.py",  # its own submodules
        "cosim/spec/distribution.py",  # packages of the extras
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
