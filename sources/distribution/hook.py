"""Build hook of the wheel: put sources, scenarios, FMUs and the licence below `cosim_library`.

FMUs are those that `python -m sources.distribution` has made; a wheel without them builds its own,
if the extra `build` is installed. An editable installation takes all from the checkout.
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
        included = build_data["force_include"]
        for name in ("sources", "scenarios", "LICENSE"):
            included[str(root / name)] = f"cosim_library/{name}"
        made = root / "build" / "library"
        if not (made / "tag").is_file():
            self.app.display_warning(
                "the wheel carries no FMUs: run 'make wheel', or 'python -m sources.distribution' "
                "before"
            )
            return
        for name in ("packs", "catalogue.json.gz"):
            included[str(made / name)] = f"cosim_library/{name}"
        included[str(made / "kernel")] = "cosim/master/kernel/lib"
        tag = (made / "tag").read_text(encoding="ascii")
        build_data["pure_python"] = tag == "any"
        build_data["tag"] = f"py3-none-{tag}"
