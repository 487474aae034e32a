"""`make quick` asks something of every folder of tests."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from tests.conftest import SLOW_MODULE

TESTS = Path(__file__).parent
FOLDERS = sorted({path.parent for path in TESTS.rglob("test_*.py")})


def quick(path: Path) -> list[str]:
    """Names of the tests of a module that are not marked as slow."""
    text = path.read_text(encoding="utf-8")
    if SLOW_MODULE.search(text):
        return []
    return [
        node.name
        for node in ast.parse(text).body
        if isinstance(node, ast.FunctionDef)
        and node.name.startswith("test_")
        and "pytest.mark.slow" not in map(ast.unparse, node.decorator_list)
    ]


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: path.relative_to(TESTS).as_posix())
def test_every_folder_has_quick_tests(folder: Path) -> None:
    # three: one may be a test of a helper
    assert len([name for path in folder.glob("test_*.py") for name in quick(path)]) >= 3


def test_slow_tests_are_not_quick(tmp_path: Path) -> None:
    path = tmp_path / "test_some.py"
    path.write_text("@pytest.mark.slow\ndef test_a(): ...\ndef test_b(): ...\n")
    assert quick(path) == ["test_b"]
    path.write_text("pytestmark = pytest.mark.slow\ndef test_b(): ...\n")
    assert quick(path) == []
