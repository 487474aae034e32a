"""Numbers of MATLAB files of version 7.3, which are HDF5 files: by the library `pyfive`.

It reads HDF5 in Python alone: the compiled library trusts what a damaged file states and may end
the process. Structures give columns `NAME.FIELD`; cells, text, sparse and complex arrays are left
out.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, ScenarioError
from ..reading.limits import DATA

DEPTH = 8
"""Structures within structures."""
_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_LEFT_OUT = {b"char": "text", b"cell": "a cell", b"function_handle": "a function"}


def read_matlab73(path: Path, left: dict[str, str] | None = None) -> dict[str, NDArray[Any]]:
    """Arrays of numbers by name, without dimensions of one element.

    Args:
        path: of the file.
        left: what is left out is put here, by name: what it is.

    Raises:
        InputError: the library is not installed.
        ScenarioError: it is damaged or too large.
    """
    try:
        import pyfive
    except ImportError:
        raise InputError(
            f"{path}: is a MATLAB file of version 7.3, which is read by the library pyfive; "
            "pip install pyfive, or save it with -v7"
        ) from None
    room = [DATA.value()]
    try:
        with pyfive.File(io.BytesIO(_plain(path.read_bytes()))) as file:
            found = {n: _array(path, n, item, room) for n, item in _datasets(file, "", DEPTH)}
    except ScenarioError:
        raise
    except Exception as error:  # of a parser that does not expect damaged files
        text = str(error).splitlines() or [type(error).__name__]
        raise ScenarioError(
            f"{path}: is no whole MATLAB file of version 7.3 ({text[0][:200]}); save it again"
        ) from error
    if left is not None:
        left.update({name: item for name, item in found.items() if isinstance(item, str)})
    return {name: item for name, item in found.items() if not isinstance(item, str)}


def _plain(content: bytes) -> bytes:
    """The HDF5 file behind MATLAB's head, as if it began there: pyfive counts chunks from 0."""
    content = content[max(content.find(_SIGNATURE), 0) :]
    if content[8:9] != b"\0":  # the version of the superblock that MATLAB writes
        return content
    return content[:24] + bytes(8) + content[32:]


def _datasets(group: Any, prefix: str, depth: int) -> Iterator[tuple[str, Any]]:
    for name in group:
        if name.startswith("#"):  # where MATLAB keeps cells
            continue
        item = group[name]
        if hasattr(item, "shape"):
            yield prefix + name, item
        elif depth:
            yield from _datasets(item, f"{prefix}{name}.", depth - 1)


def _array(path: Path, name: str, item: Any, room: list[int]) -> NDArray[Any] | str:
    """An array as MATLAB has it; what it is, if it holds no real numbers."""
    kind = item.attrs.get("MATLAB_class", b"double")
    kind = kind if isinstance(kind, bytes) else str(kind).encode()
    dtype = np.dtype(item.dtype)
    if kind in _LEFT_OUT or "MATLAB_empty" in item.attrs or dtype.kind not in "fiub":
        return "empty" if "MATLAB_empty" in item.attrs else _LEFT_OUT.get(kind, f"of type {dtype}")
    size = int(np.prod(item.shape, dtype=object)) * max(dtype.itemsize, 8)
    room[0] -= size
    if room[0] < 0:
        raise ScenarioError(f"{path}: array {name!r}: {DATA.excess(DATA.value() - room[0])}")
    return np.squeeze(np.asarray(item[()])).T
