"""Shared libraries before they are loaded."""

from __future__ import annotations

import struct
from pathlib import Path


def cut_short(path: Path) -> str:
    """What is wrong with a library whose end is missing, "" if nothing is.

    The process that loads such a one dies of a bus error.
    """
    size, needed = path.stat().st_size, _elf_size(path)
    return f"is cut short: {size} bytes of at least {needed}" if size < needed else ""


def _elf_size(path: Path) -> int:
    """Bytes that the segments of a 64-bit ELF library reach to, 0 for other formats.

    The loaders of the other formats refuse a library that is cut short; that of ELF maps it and the
    process dies of a bus error.
    """
    with path.open("rb") as file:
        header = file.read(64)
        if header[:6] != b"\x7fELF\x02\x01"[: len(header)]:
            return 0
        if len(header) < 64:
            return 64
        table = int(struct.unpack_from("<Q", header, 32)[0])
        entry, count = (int(value) for value in struct.unpack_from("<HH", header, 54))
        file.seek(table)
        entries = file.read(entry * count)
    needed = table + entry * count
    for place in range(0, len(entries) - 39, entry):
        offset, size = (int(struct.unpack_from("<Q", entries, place + at)[0]) for at in (8, 32))
        needed = max(needed, offset + size)
    return needed
