"""Arrays of an npz archive, with their sizes known before anything is unpacked.

numpy's own reader allocates what a header of some bytes asks for, and reads archives that are cut
short in part.
"""

from __future__ import annotations

import ast
import math
import sys
import zipfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import ScenarioError
from ..reading import archives
from ..reading.limits import DATA

_HEADER = 10_128
"""Longest header that numpy reads, with what stands before it."""
_DAMAGE = (*archives.DAMAGE, SyntaxError, RecursionError, MemoryError, TypeError, RuntimeError)
"""What zipfile, and numpy's reading of a header as Python, raise for damaged bytes."""


def read_npz(path: Path) -> dict[str, NDArray[Any]]:
    """Arrays by name.

    Raises:
        ScenarioError: it is no npz archive, damaged, too large, or holds Python objects.
    """
    try:
        with archives.opened(path) as archive:
            found = [(info, _head(path, archive, info)) for info in archive.infolist()]
            needed = sum(math.prod(h.shape) * max(h.dtype.itemsize, 8) for _, h in found)
            if excess := DATA.excess(needed):
                raise ScenarioError(f"{path}: its arrays are too large: {excess}")
            arrays = {
                info.filename.removesuffix(".npy"): _array(archive.read(info), head)
                for info, head in found
            }
    except (archives.ArchiveError, *_DAMAGE) as error:
        raise ScenarioError(
            f"{path}: is not a whole npz archive of numbers ({archives.reason(error)}); write it "
            "again with numpy.savez"
        ) from error
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read ({error.strerror or error})") from error
    if len(arrays) < len(found):
        raise ScenarioError(f"{path}: has two arrays of one name; write it again")
    return arrays


class _Head(NamedTuple):
    """Type, shape and order of an array, and where its values begin."""

    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    fortran: bool
    begin: int


def _head(path: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> _Head:
    name = info.filename
    if info.flag_bits & 1:
        raise ScenarioError(f"{path}: its entry {name!r} is encrypted; write it without a password")
    if not name.endswith(".npy"):
        raise ScenarioError(f"{path}: its entry {name!r} is no array of numpy (NAME.npy)")
    with archive.open(info) as file:
        start = file.read(_HEADER)
    if start[:6] != b"\x93NUMPY":
        raise ScenarioError(f"{path}: its entry {name!r} is no array of numpy")
    wide = start[6] > 1  # format 1 counts the header in two bytes, 2 and 3 in four
    begin = 12 if wide else 10
    begin += int.from_bytes(start[8:begin], "little")
    if begin > len(start):
        raise ScenarioError(f"{path}: array {name!r} has a header of {begin} bytes; write numbers")
    said = ast.literal_eval(start[12 if wide else 10 : begin].decode("utf-8").strip())
    shape, fortran = said["shape"], bool(said["fortran_order"])
    dtype = np.lib.format.descr_to_dtype(said["descr"])
    if not isinstance(shape, tuple) or not all(type(size) is int for size in shape):
        raise ScenarioError(f"{path}: array {name!r} has the shape {shape!r}")
    if dtype.hasobject:
        raise ScenarioError(
            f"{path}: array {name!r} holds Python objects, which could run anything; write numbers"
        )
    if any(size < 0 for size in shape):
        raise ScenarioError(f"{path}: array {name!r} has the shape {shape}")
    length = math.prod(shape) * dtype.itemsize
    if info.file_size - begin != length:
        raise ScenarioError(
            f"{path}: array {name!r} of shape {shape} and type {dtype} needs {length} bytes, but "
            f"{info.file_size - begin} are there; write it again"
        )
    return _Head(dtype, shape, fortran, begin)


def _array(content: bytes, head: _Head) -> NDArray[Any]:
    if not head.dtype.itemsize:
        return np.zeros(head.shape, head.dtype)
    flat = np.frombuffer(content, head.dtype, offset=head.begin)
    if head.dtype.kind == "U":
        codes = np.frombuffer(content, f"{head.dtype.byteorder}u4", offset=head.begin)
        if codes.size and int(codes.max()) > sys.maxunicode:
            raise ValueError(f"an array of text has the character {codes.max()}, which is none")
    return flat.reshape(head.shape, order="F" if head.fortran else "C")
