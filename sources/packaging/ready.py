"""Which FMUs are there already and up to date: asked often, and answered without CasADi."""

from __future__ import annotations

import hashlib
import importlib.metadata
from functools import lru_cache
from pathlib import Path
from typing import Literal

from cosim import spec
from cosim.spec import devices
from cosim.spec.variant import Name, parse_name

from . import rights
from .cache import cache_folder
from .platforms import PLATFORMS, host_platform

Kind = Literal["native", "python"]
_SOURCES = Path(__file__).parent.parent
_SPEC = Path(spec.__path__[0])


@lru_cache(maxsize=1)
def sources_key() -> str:
    """Hash of what an FMU is made of: `sources/`, units and names of `cosim/spec`, its makers.

    What a wheel carries (`sources/distribution`) is no part of it.
    """
    digest = hashlib.sha256()
    for folder in (_SOURCES, _SPEC):
        for path in sorted(folder.rglob("*")):
            name = path.relative_to(folder)
            if path.suffix in (".py", ".c", ".toml") and name.parts[0] != "distribution":
                digest.update(name.as_posix().encode() + b"\0" + path.read_bytes())
    for package in ("casadi", "pythonfmu", "ziglang"):
        digest.update(importlib.metadata.version(package).encode())
    digest.update(f"{rights.attributes()}".encode() + rights.LICENSE.read_bytes())
    return digest.hexdigest()


def platforms(choice: str) -> list[str]:
    """Those that "all" or "host" names."""
    return list(PLATFORMS) if choice == "all" else [host_platform()]


def target_path(name: Name, out: Path, fmi: int, kind: Kind) -> Path:
    """Where the FMU of a variant lies below the output folder."""
    folder = "python" if kind == "python" else f"fmi{fmi}"
    return out / folder / f"{name.filename}.fmu"


def stamp_path(name: Name, fmi: int, kind: Kind, platform: str) -> Path:
    """A file that holds the hash of the FMU built from these very sources."""
    key = f"{sources_key()} {name} {fmi} {kind} {platforms(platform)}"
    for folder in devices.folders() if name.device else ():  # parts may have one each
        own = folder / f"{name.device}.toml"
        if own.is_file():
            key += f" {hashlib.sha256(own.read_bytes()).hexdigest()}"
    return cache_folder("built") / hashlib.sha256(key.encode()).hexdigest()


def ready(
    name: str, *, out: Path, fmi: int = 2, kind: Kind = "native", platform: str = "host"
) -> Path | None:
    """Path of the FMU of a variant if it is there and up to date, else None; arguments as `build`.

    Raises:
        VariantError: the name does not follow the grammar.
    """
    parsed = parse_name(name)
    path = target_path(parsed, out, fmi, kind)
    if path.exists():
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        for served in dict.fromkeys((platform, "all")):  # an FMU for all platforms serves the host
            stamp = stamp_path(parsed, fmi, kind, served)
            if stamp.exists() and stamp.read_text() == digest:
                return path
    return None
