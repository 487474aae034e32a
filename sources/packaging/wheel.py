"""Build hook of the wheel: put sources, scenarios, FMUs and the licence below `cosim_library`.

An editable installation takes them from the checkout.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class LibraryHook(BuildHookInterface):  # type: ignore[misc]
    """Adds the library to a standard wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called by hatchling before it collects files."""
        if version == "editable":
            return
        root = Path(self.root)
        for name in ("sources", "scenarios", "fmus", "LICENSE"):
            build_data["force_include"][str(root / name)] = f"cosim_library/{name}"
