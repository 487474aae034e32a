"""Device files of the user's own: `<device>.toml` in `devices/` of the current folder.

`COSIM_DEVICES` names further folders, separated as in `PATH`; they come first. A device file says
by `components = [...]` whose device it is. FMUs of these devices are kept beside their file, in
`fmi2/`, `fmi3/` and `python/`: with the folder, a robot goes to another machine.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import VariantError

FOLDER = "devices"
VARIABLE = "COSIM_DEVICES"
TOLD = ("q_min", "q_max", "speed_max")
"""Values that no equation takes: limits of an imported arm, for what is made of its file."""


_also: list[Path] = []


def folders() -> tuple[Path, ...]:
    """Where device files are looked for, in this order."""
    named = [Path(item) for item in os.environ.get(VARIABLE, "").split(os.pathsep) if item]
    return (*_also, *named, Path(FOLDER))


@contextmanager
def also(folder: Path) -> Iterator[None]:
    """Look in one more folder first."""
    _also.insert(0, folder)
    try:
        yield
    finally:
        _also.remove(folder)


def own(component: str) -> dict[str, Path]:
    """The user's device files for a component, by the device's name.

    Raises:
        VariantError: a device file that is no TOML, or whose `components` are no list.
    """
    found: dict[str, Path] = {}
    for folder in folders():
        for path in sorted(folder.glob("*.toml")):
            if path.stem not in found and component in _components(path):
                found[path.stem] = path
    return found


def _components(path: Path) -> list[str]:
    try:
        listed = tomllib.loads(path.read_text(encoding="utf-8")).get("components", [])
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise VariantError(f"{path}: is no TOML ({error}); correct it or move it away") from error
    if not isinstance(listed, list):
        raise VariantError(
            f'{path}: components = {listed!r} is no list; write components = ["{listed}"]'
        )
    return listed


def find(component: str, device: str) -> Path | None:
    """The user's device file of this name, None without one."""
    return own(component).get(device) if device else None
