"""An .fmu file on disk: unpacked once into a cache folder named by its content."""

from __future__ import annotations

import hashlib
import platform
import sys
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Literal

from ..errors import FmuFileError, InputError, PlatformError
from ..reading import archives
from ..reading.archives import DAMAGE, ArchiveError
from ..reading.libraries import cut_short
from ..reading.limits import TEXT, UNPACKED, VALUES
from ..spec.cache import cache_folder
from .description import Description, read_description
from .metadata import ENTRY


def platform_folders(fmi: Literal[2, 3]) -> tuple[str, ...]:
    """Folders below `binaries/` that hold a binary for this machine, preferred first."""
    machine = platform.machine().lower()
    arch = {"amd64": "x86_64", "x64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    system = {"win32": "windows", "darwin": "darwin"}.get(sys.platform, "linux")
    tuple_ = f"{arch}-{system}"
    if fmi == 3:
        return (tuple_,)
    short = {"windows": "win64", "darwin": "darwin64", "linux": "linux64"}[system]
    if arch == "x86_64":
        return (short, tuple_)
    # FMI 2 has no names of its own for ARM; universal macOS binaries live in darwin64.
    return (tuple_, short) if system == "darwin" else (tuple_,)


def library_suffix() -> str:
    """Suffix of shared libraries on this machine."""
    return {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")


@dataclass(frozen=True)
class Fmu:
    """An unpacked FMU.

    Attributes:
        path: the .fmu file.
        digest: SHA-256 of its content.
        folder: where it is unpacked.
        description: what it says about itself.
    """

    path: Path
    digest: str
    folder: Path
    description: Description

    def __repr__(self) -> str:
        return f"Fmu({str(self.path)!r}, {self.description.name!r}, FMI {self.description.fmi})"

    def platforms(self) -> tuple[str, ...]:
        """The platforms that it has binaries for."""
        binaries = self.folder / "binaries"
        if not binaries.is_dir():
            return ()
        return tuple(sorted(item.name for item in binaries.iterdir() if item.is_dir()))

    @cached_property
    def binary(self) -> Path:
        """The shared library for this machine.

        Raises:
            PlatformError: it has none; the text lists those that it has.
            FmuFileError: it is cut short; loading it would end the process.
        """
        wanted = platform_folders(self.description.fmi)
        name = self.description.identifier + library_suffix()
        for folder in wanted:
            path = self.folder / "binaries" / folder / name
            if path.is_file():
                if problem := cut_short(path):
                    raise FmuFileError(
                        f"{self.path}: its binary binaries/{folder}/{name} {problem}. Build or "
                        "fetch it again"
                    )
                return path
        present = ", ".join(self.platforms()) or "none at all"
        raise PlatformError(
            f"{self.path.name}: has no binary for this machine ({wanted[0]}); it has {present}. "
            "Build it for this platform ('cosim fmus build --platform all') or ask its supplier"
        )


_TEXTS = ("modelDescription.xml", ENTRY, "SystemStructure.ssd")
"""Files that are read whole; one that is too long is not unpacked first."""


def unpacked(
    path: Path, kind: str, what: str, error: type[InputError], shown: str = ""
) -> tuple[Path, str]:
    """Folder with the content of an archive, and the SHA-256 of the archive.

    It is unpacked if it is not there yet, or no longer whole.

    Args:
        path: of the archive.
        kind: folder of the cache.
        what: kind of archive in error texts, `an FMU`.
        error: class of the errors.
        shown: what their texts call it, its path by default.

    Raises:
        InputError: of that class: missing, damaged, too large, or with entries that do harm.
    """
    shown = shown or str(path)
    try:
        size = path.stat().st_size
        if not path.is_file():
            raise error(f"{shown}: is not {what} archive but a folder or device")
        if excess := UNPACKED.excess(size):
            raise error(f"{shown}: {excess}")
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
    except FileNotFoundError:
        raise error(f"{shown}: there is no such file") from None
    except OSError as problem:
        raise error(f"{shown}: cannot be read ({problem.strerror})") from problem
    except ValueError as problem:  # a zero byte in the path
        raise error(f"{str(path)!r}: is no path ({problem})") from problem
    folder = cache_folder() / kind / digest[:32]
    try:
        with archives.opened(path) as archive:
            entries = archives.members(archive)
            for name in _TEXTS:
                if name in entries and (excess := TEXT.excess(entries[name].file_size)):
                    raise ArchiveError(f"{name}: {excess}")
            if not archives.intact(entries, folder):
                archives.unpack(archive, folder)
    except ArchiveError as problem:
        raise error(f"{shown}: {problem}") from problem
    except DAMAGE as problem:
        raise error(
            f"{shown}: is not a complete {what.rpartition(' ')[2]} archive "
            f"({archives.reason(problem)}); it has {size} bytes. Build or fetch it again"
        ) from problem
    except OSError as problem:
        raise error(
            f"{shown}: cannot be unpacked into {folder.parent} ({problem}); "
            "set COSIM_CACHE to a folder that can be written"
        ) from problem
    return folder, digest


def open_fmu(path: Path | str, shown: str = "") -> Fmu:
    """Unpack an .fmu into the cache (if it is not there yet) and read its description.

    Args:
        path: of the .fmu.
        shown: what error texts call it, its path by default.

    Raises:
        FmuFileError: missing, corrupt, truncated, too large, or not an FMU.
    """
    path = Path(path)
    shown = shown or str(path)
    folder, digest = unpacked(path, "unpacked", "an FMU", FmuFileError, shown)
    return Fmu(path, digest, folder, _described(folder, shown, _limits()))


def _limits() -> tuple[int, int]:
    """Limits that a description was read with; others may refuse it."""
    return TEXT.value(), VALUES.value()


@lru_cache(maxsize=256)
def _described(folder: Path, where: str, limits: tuple[int, int]) -> Description:
    """Description of an unpacked FMU; its folder is named after its content."""
    return read_description(folder, where)
