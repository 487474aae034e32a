"""Zip archives from anywhere: nothing is unpacked before sizes and names of all entries are known.

FMUs, SSP packages and npz files are zip archives.
"""

from __future__ import annotations

import lzma
import re
import shutil
import stat
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from .limits import FILES, UNPACKED

DAMAGE = (
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, EOFError, NotImplementedError,
    ValueError, OverflowError, IndexError, KeyError,
)  # fmt: skip
"""What zipfile raises for an archive or an entry that it cannot read."""
_TAIL = 65557 + 76
"""Bytes from the end within which the directory's record is, with that of large archives."""
_ENTRY = 512
"""Bytes of a directory entry whose name and remarks are long."""
_LONGEST = 120
"""Characters of an error text."""
_NAME = 255
"""Bytes that file systems allow for one name."""


def reason(error: Exception) -> str:
    """What an error of zipfile says, without the bytes of the file that it may show."""
    text = str(error) or type(error).__name__
    return text if len(text) <= _LONGEST else text[:_LONGEST] + " …"


class ArchiveError(Exception):
    """An archive that is not unpacked; the text says why and the way out."""


def _directory_size(path: Path) -> int:
    """Bytes of the directory at the archive's end, which zipfile would read whole."""
    with path.open("rb") as file:
        file.seek(0, 2)
        file.seek(max(file.tell() - _TAIL, 0))
        tail = file.read(_TAIL)
    place = tail.rfind(b"PK\x05\x06")
    if place < 0 or len(tail) < place + 16:
        return 0
    size = int(struct.unpack_from("<I", tail, place + 12)[0])
    large = tail.rfind(b"PK\x06\x06")
    if size == 0xFFFFFFFF and large >= 0 and len(tail) >= large + 48:
        size = int(struct.unpack_from("<Q", tail, large + 40)[0])
    return size


@contextmanager
def opened(path: Path) -> Iterator[zipfile.ZipFile]:
    """An archive whose directory was small enough to be read.

    Raises:
        ArchiveError: too many entries.
        zipfile.BadZipFile and the rest of `DAMAGE`, OSError: damaged or unreadable.
    """
    entries = _directory_size(path) // _ENTRY
    if excess := FILES.excess(entries):
        raise ArchiveError(f"its directory is too long: {excess}")
    length = path.stat().st_size
    with zipfile.ZipFile(path) as archive:
        for info in archive.infolist():  # else so much memory is asked for
            if info.compress_size > length:
                raise zipfile.BadZipFile(
                    f"its entry {info.filename[:_LONGEST]!r} claims {info.compress_size} bytes of "
                    f"an archive of {length}"
                )
        yield archive


def fault(name: str) -> str:
    """Why an entry of this name cannot be unpacked, "" if it can."""
    parts = name.replace("\\", "/").split("/")
    if name.startswith(("/", "\\")) or re.match(r"[A-Za-z]:", name):
        return "is an absolute path"
    if ".." in parts:
        return "leads out of the archive"
    if "\0" in name:
        return "has a zero byte in its name"
    if any(len(part.encode("utf-8", "surrogatepass")) > _NAME for part in parts):
        return f"has a name of more than {_NAME} bytes"
    return ""


def members(archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """Entries of an archive by name; backslashes of old Windows tools are read as slashes.

    Raises:
        ArchiveError: an entry that is encrypted, a link, there twice with other content or leads
            out of the archive, or all together are too large.
    """
    found: dict[str, zipfile.ZipInfo] = {}
    if excess := FILES.excess(len(archive.filelist)):
        raise ArchiveError(excess)
    if excess := UNPACKED.excess(sum(info.file_size for info in archive.filelist)):
        raise ArchiveError(f"unpacked, {excess}")
    for info in archive.filelist:
        shown = repr(info.orig_filename[:200])
        if reason := fault(info.orig_filename):
            raise ArchiveError(f"its entry {shown} {reason}; pack it again")
        if stat.S_ISLNK(info.external_attr >> 16):
            raise ArchiveError(
                f"its entry {shown} is a symbolic link, which may lead out of the archive; pack "
                "the file that it points to"
            )
        if info.flag_bits & 1:
            raise ArchiveError(
                f"its entry {shown} is encrypted; unpack it with its password and pack it without"
            )
        name = info.filename.replace("\\", "/")
        while name.startswith("./"):
            name = name[2:]
        if not name:
            continue
        if name in found and not name.endswith("/") and not _same(found[name], info):
            raise ArchiveError(f"it has two entries {shown}; which one counts is not defined")
        found.setdefault(name, info)
    for name in found:
        parts = name.rstrip("/").split("/")
        for length in range(1, len(parts)):
            if "/".join(parts[:length]) in found:
                raise ArchiveError(
                    f"its entry {'/'.join(parts[:length])!r} is a file and a folder at once"
                )
    return found


def _same(first: zipfile.ZipInfo, second: zipfile.ZipInfo) -> bool:
    """Whether two entries hold the same; some tools pack a folder twice."""
    return (first.file_size, first.CRC) == (second.file_size, second.CRC)


def unpack(archive: zipfile.ZipFile, folder: Path) -> None:
    """Unpack an archive into a new folder, whole or not at all; a folder of that name is replaced.

    Raises:
        ArchiveError: see `members`.
        zipfile.BadZipFile and the rest of `DAMAGE`, OSError: damaged, or it cannot be written.
    """
    entries = members(archive)
    folder.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(prefix=".unpack-", dir=folder.parent))
    try:
        for name, info in entries.items():
            target = temporary.joinpath(*name.split("/"))
            if name.endswith("/"):
                target.mkdir(parents=True, exist_ok=True)
                continue
            target.parent.mkdir(parents=True, exist_ok=True)
            with archive.open(info) as source, target.open("wb") as file:
                shutil.copyfileobj(source, file)  # checks the CRC at the end
        if folder.is_dir() and not intact(entries, folder):
            folder.rename(temporary / ".damaged")
        try:
            temporary.rename(folder)
            shutil.rmtree(folder / ".damaged", ignore_errors=True)
        except OSError:
            if not folder.is_dir():  # else another process was faster
                raise
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def intact(entries: Mapping[str, zipfile.ZipInfo], folder: Path) -> bool:
    """Whether an unpacked folder still holds every file of an archive in its size."""
    try:
        return all(
            folder.joinpath(*name.split("/")).stat().st_size == info.file_size
            for name, info in entries.items()
            if not name.endswith("/")
        )
    except OSError:
        return False
