"""Name and version of what was installed: the import is `cosim`, the distribution is not."""

from __future__ import annotations

import importlib
import importlib.util
import sys
import tomllib
from functools import lru_cache
from pathlib import Path
from typing import Any

from ..errors import InputError

NAME = "cosim-robotics"
"""On the package index, where `cosim` is another maker's empty package."""
_PROJECT = Path(__file__).resolve().parents[2] / "pyproject.toml"


@lru_cache(maxsize=1)
def version() -> str:
    """Version of the checkout, else of the installed distribution; "" if nothing says one."""
    if _PROJECT.is_file():
        project = tomllib.loads(_PROJECT.read_text(encoding="utf-8")).get("project", {})
        if project.get("name") == NAME:
            return str(project["version"])
    from importlib import metadata

    try:
        return metadata.version(NAME)
    except metadata.PackageNotFoundError:
        return ""


def way_out(extra: str) -> str:
    """The command that installs what an extra brings."""
    return f"pip install '{NAME}[{extra}]'"


def has(module: str) -> bool:
    """Whether a package of an extra is installed."""
    try:
        return importlib.util.find_spec(module) is not None
    except (ImportError, ValueError):  # blocked, or half removed
        return False


def needed(module: str, what: str, extra: str) -> Any:
    """A package of an extra.

    Args:
        module: to import.
        what: what needs it, as an error text begins.
        extra: that brings it.

    Raises:
        InputError: it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise InputError(
            f"{what} needs {module.partition('.')[0]}, which is not installed: {way_out(extra)}"
        ) from error


def shadowed() -> str:
    """A note if the other package `cosim` has put its `__init__` over ours; else ""."""
    if hasattr(sys.modules[__name__.partition(".")[0]], "__all__"):
        return ""
    return (
        "note: the package 'cosim' of another maker was installed over this one; commands work, "
        f"'import cosim' does not: pip uninstall cosim, then pip install --force-reinstall "
        f"--no-deps {NAME}"
    )
