"""Example logs and mappings of logs that come with cosim, by name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..files import read_toml
from . import places


def example_sets() -> dict[str, Path]:
    """Data sets that come with cosim: name -> folder."""
    found = sorted(places.scenarios().glob("*/data/*/set.toml"))
    return {path.parent.name: path.parent for path in found}


def named_mappings() -> dict[str, Path]:
    """Mappings that come with cosim: `emps` for its dataset.toml, `emps/open_loop` for others."""
    found = {}
    for path in sorted(places.scenarios().glob("*/*.toml")):
        table = read_toml(path)
        if "channels" in table or "base" in table:
            folder = path.parent.name
            found[folder if path.stem == "dataset" else f"{folder}/{path.stem}"] = path
    return found


def read_mapping(path: Path) -> dict[str, Any]:
    """A mapping file; what it does not say is as in the file that it names as its `base`."""
    table = read_toml(path)
    if "base" not in table:
        return table
    return {**read_mapping(path.parent / str(table["base"])), "further": [], **table}
