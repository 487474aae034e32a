"""Numbers of MATLAB files, decoded here up to version 7; `matlab73` has the newer ones.

SciPy's reader is compiled and trusts the sizes that a file states; a damaged file can end the
process. Columns of numbers need little of the format (MAT-File Format, MathWorks, R2023b): full
real arrays of version 4, 6 and 7, and single structures of these, as columns `NAME.FIELD`. Other
variables (cells, arrays of structures, text, tables, sparse and complex arrays) are left out.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ScenarioError
from ..reading.limits import DATA
from .matlab73 import DEPTH, read_matlab73

_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8",
          13: "u8"}  # fmt: skip
_INT8, _INT32, _UINT32, _MATRIX, _COMPRESSED = 1, 5, 6, 14, 15
_CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8",
            15: "u8"}  # fmt: skip
_STRUCTURE = 2
_OTHERS = {1: "a cell", 3: "an object", 4: "text", 5: "sparse", 16: "a function", 17: "an object"}
"""Other classes; tables, too, are objects."""
_COMPLEX = 0x0800
_OLD = {0: "f8", 1: "f4", 2: "i4", 3: "i2", 4: "u2", 5: "u1"}
"""Types of version 4."""
_HDF5 = b"\x89HDF\r\n\x1a\n"
_DIMENSIONS = 32
"""Of an array; numpy has no more than 64."""


Item = tuple[str, NDArray[Any] | str]
"""Name and values of a variable, or what it is instead of numbers."""


class _Damage(Exception):
    """What does not fit together in a file."""


def read_matlab(path: Path, left: dict[str, str] | None = None) -> dict[str, NDArray[Any]]:
    """Arrays of numbers by name, without dimensions of one element.

    Args:
        path: of the file.
        left: what is left out is put here, by name: what it is.

    Raises:
        ScenarioError: it is no MATLAB file, damaged or too large.
        InputError: it is of version 7.3, and nothing is installed that reads it.
    """
    try:
        if excess := DATA.excess(path.stat().st_size):
            raise ScenarioError(f"{path}: {excess}")
        content = path.read_bytes()
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read ({error.strerror})") from error
    if _HDF5 in content[:520] or content.startswith(b"MATLAB 7.3"):
        return read_matlab73(path, left)
    old = 0 in content[:4]
    try:
        found = dict(_version4(content) if old else _version5(content))
    except (_Damage, struct.error, zlib.error) as error:
        raise ScenarioError(
            f"{path}: is not a whole MATLAB file of version 7 or older ({error}); save it again "
            "with -v7"
        ) from error
    if left is not None:
        left.update({name: item for name, item in found.items() if isinstance(item, str)})
    return {name: item for name, item in found.items() if not isinstance(item, str)}


# -- version 5 to 7 --------------------------------------------------------------------------------


def _version5(content: bytes) -> Iterator[Item]:
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    if order is None:
        raise _Damage("its head names no byte order")
    place, room = 128, DATA.value()
    while place < len(content):
        if not any(content[place : place + 8]):  # padding at the end of some tools
            break
        kind, data, place = _element(content, place, order)
        if kind == _COMPRESSED:
            stream = zlib.decompressobj()
            data = stream.decompress(data, room + 1)
            if excess := DATA.excess(len(data) + DATA.value() - room):
                raise _Damage(f"unpacked, {excess}")
            if not stream.eof:
                raise _Damage("a packed variable is cut short")
            kind, data, _ = _element(data, 0, order)
        room -= len(data)
        if kind == _MATRIX and data:
            yield from _matrix(data, order)


def _element(content: bytes, place: int, order: str) -> tuple[int, bytes, int]:
    """Type and data of the element at a place, and the place of the next."""
    kind, size = struct.unpack_from(f"{order}II", content, place)
    if kind >> 16:  # up to four bytes, beside the type
        kind, size, begin, following = kind & 0xFFFF, kind >> 16, place + 4, place + 8
        if size > 4:
            raise _Damage(f"a short element of {size} bytes at byte {place}")
    else:
        begin = place + 8
        following = begin + size + (0 if kind == _COMPRESSED else -size % 8)
    data = content[begin : begin + size]
    if len(data) < size:
        raise _Damage(f"an element at byte {place} needs {size} bytes, {len(data)} are there")
    return int(kind), data, following


def _matrix(data: bytes, order: str, field: str = "", depth: int = DEPTH) -> Iterator[Item]:
    """A variable, or the field of a structure, whose name is not in it."""
    kind, flags, place = _element(data, 0, order)
    if kind != _UINT32 or len(flags) != 8:
        raise _Damage("a variable without flags")
    flag = int(struct.unpack_from(f"{order}I", flags)[0])
    own = flag & 0xFF
    kind, sizes, place = _element(data, place, order)
    if own not in _CLASSES and own != _STRUCTURE:
        if kind != _INT8:  # objects have no dimensions
            kind, sizes, place = _element(data, place, order)
        yield field or sizes.decode("latin-1"), _OTHERS.get(own, f"of class {own}")
        return
    if kind != _INT32 or not sizes or len(sizes) % 4 or len(sizes) > 4 * _DIMENSIONS:
        raise _Damage("a variable without dimensions")
    shape = struct.unpack(f"{order}{len(sizes) // 4}i", sizes)
    kind, name, place = _element(data, place, order)
    if kind != _INT8:
        raise _Damage("a variable without a name")
    text = field or name.decode("latin-1")
    if not text:  # where MATLAB keeps what is in objects
        return
    if own == _STRUCTURE:
        if math.prod(shape) != 1 or not depth:
            yield text, "an array of structures" if depth else "a structure too deep"
        else:
            yield from _fields(data, place, order, text, depth - 1)
        return
    if flag & _COMPLEX:
        yield text, "complex"
        return
    kind, values, _ = _element(data, place, order)
    if kind not in _TYPES:
        raise _Damage(f"variable {text!r} has values of the unknown type {kind}")
    yield text, _shaped(text, values, f"{order}{_TYPES[kind]}", shape, _CLASSES[flag & 0xFF])


def _fields(data: bytes, place: int, order: str, name: str, depth: int) -> Iterator[Item]:
    """The fields of a single structure."""
    kind, width, place = _element(data, place, order)
    if kind != _INT32 or len(width) != 4:
        raise _Damage(f"structure {name!r} without the length of its names")
    (length,) = struct.unpack(f"{order}i", width)
    kind, names, place = _element(data, place, order)
    if kind != _INT8 or length < 1 or len(names) % length:
        raise _Damage(f"structure {name!r} without names")
    for begin in range(0, len(names), length):
        field = names[begin : begin + length].partition(b"\0")[0].decode("latin-1")
        kind, item, place = _element(data, place, order)
        if kind != _MATRIX:
            raise _Damage(f"structure {name!r} without its field {field!r}")
        if item:  # nothing was put into it
            yield from _matrix(item, order, f"{name}.{field}", depth)


def _shaped(
    name: str, values: bytes, stored: str, shape: tuple[int, ...], meant: str
) -> NDArray[Any]:
    count, width = math.prod(shape), np.dtype(stored).itemsize
    if min(shape) < 0 or count * width != len(values):
        raise _Damage(
            f"variable {name!r} has {len(values) // width} values for {' x '.join(map(str, shape))}"
        )
    flat = np.frombuffer(values, stored)
    if not count:
        return np.zeros(0, meant)
    return np.squeeze(flat.reshape(shape, order="F")).astype(meant)


# -- version 4 -------------------------------------------------------------------------------------


def _version4(content: bytes) -> Iterator[Item]:
    place = 0
    while place < len(content):
        kind, *_ = struct.unpack_from("<i", content, place)
        order = "<" if 0 <= kind < 1000 else ">"
        kind, rows, columns, imaginary, length = struct.unpack_from(f"{order}5i", content, place)
        place += 20
        thousands, hundreds, precision, form = (
            kind // 1000,
            kind // 100 % 10,
            kind // 10 % 10,
            (kind % 10),
        )
        if (
            thousands not in (0, 1) or hundreds or precision not in _OLD or form not in (0, 1, 2)
            or min(rows, columns) < 0 or length < 1 or imaginary not in (0, 1)
        ):  # fmt: skip
            raise _Damage(f"no variable begins at byte {place - 20}")
        name = content[place : place + length].rstrip(b"\0").decode("latin-1")
        place += length
        stored = f"{order}{_OLD[precision]}"
        size = rows * columns * np.dtype(stored).itemsize
        values = content[place : place + size]
        place += size * (1 + imaginary)
        if place > len(content):
            raise _Damage(f"variable {name!r} is cut short")
        if form == 0 and not imaginary:
            yield name, _shaped(name, values, stored, (rows, columns), _OLD[precision])
        else:
            yield name, ("complex", "text", "sparse")[form]
