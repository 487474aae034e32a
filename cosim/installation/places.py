"""Where scenarios, FMUs and the sources of the components are: checkout or installed wheel.

In a checkout they lie beside this package; a wheel carries them below `cosim_library`.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path

from ..errors import ScenarioError

_CHECKOUT = Path(__file__).resolve().parents[2]


def in_checkout() -> bool:
    """Whether this package runs from a checkout."""
    return (_CHECKOUT / "sources" / "variant.py").is_file()


def root() -> Path:
    """The folder that holds `scenarios` and `fmus`.

    Raises:
        ScenarioError: the installation is incomplete.
    """
    if in_checkout():
        return _CHECKOUT
    found = importlib.util.find_spec("cosim_library")
    if found is None or not found.submodule_search_locations:
        raise ScenarioError(
            "the library of scenarios and FMUs is not installed; reinstall cosim, or give paths"
        )
    return Path(next(iter(found.submodule_search_locations)))


def scenarios() -> Path:
    """The folder of the scenarios that come with cosim."""
    return root() / "scenarios"


def fmus() -> Path:
    """The folder of the FMUs that come with cosim."""
    return root() / "fmus"


def sources_package() -> str:
    """Name under which the sources of the components can be imported."""
    return "sources" if in_checkout() else "cosim_library.sources"


def import_root() -> Path | None:
    """Folder that must be on the import path for `sources_package`, None if it is there anyway."""
    return _CHECKOUT if in_checkout() else None
