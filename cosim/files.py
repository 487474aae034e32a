"""Files: written whole or not at all, TOML read with clear errors."""

from __future__ import annotations

import contextlib
import errno
import json
import math
import os
import pickle
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from .errors import InputError, ScenarioError
from .reading.limits import TEXT
from .reading.schema import DEPTH, depth_of


@contextlib.contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn what the file system says in the block into an error that names `path`.

    Raises:
        InputError: it cannot be written.
    """
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written ({error.strerror or error}); choose another folder with "
            "--out"
        ) from error


def make_folder(path: Path) -> Path:
    """Make a folder for results, with those above it.

    Raises:
        InputError: it cannot be made.
    """
    with writing(path):
        path.mkdir(parents=True, exist_ok=True)
    return path


@contextlib.contextmanager
def claimed(folder: Path) -> Iterator[None]:
    """Make a folder for results and keep others out of it in the block; gone if it stays empty.

    Raises:
        InputError: it cannot be made or written, or another program has claimed it.
    """
    new = [path for path in (folder, *folder.parents) if not path.exists()]
    make_folder(folder)
    try:
        if not os.access(folder, os.W_OK):
            raise InputError(f"{folder}: cannot be written; choose another folder with --out")
        with _locked(folder):
            yield
    finally:
        with contextlib.suppress(OSError):  # those with results stay
            for path in new:
                path.rmdir()


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    if sys.platform == "win32":
        yield
        return
    import fcntl

    with writing(folder):
        handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                f"{folder}: another run writes its results there; wait for its end or choose "
                "another folder with --out"
            ) from None
        except OSError as error:
            if error.errno not in (errno.ENOLCK, errno.ENOTSUP):
                raise
            # a file system without locks: nobody can be kept out
        yield
    finally:
        os.close(handle)


@contextlib.contextmanager
def atomic(path: Path) -> Iterator[Path]:
    """A temporary path beside `path`; it takes that name if the block ends without an error.

    Raises:
        InputError: the folder cannot be written, or the disk is full.
    """
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(
            prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent
        )
    os.close(handle)
    temporary = Path(name)
    try:
        with writing(path):
            yield temporary
            # mkstemp makes files private; a result is as readable as any other new file
            mask = os.umask(0)
            os.umask(mask)
            temporary.chmod(0o666 & ~mask)
            temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically."""
    with atomic(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def flatten(table: Mapping[str, Any]) -> dict[str, Any]:
    """`{"gearbox": {"ratio": 3}}` and `{"gearbox.ratio": 3}` alike as `{"gearbox.ratio": 3}`.

    Elements come after what they are elements of, wherever they stand, so that both count.

    Raises:
        ScenarioError: a name is there twice, in two ways of writing it.
    """
    flat: dict[str, Any] = {}
    for key, value in table.items():
        nested = isinstance(value, Mapping)
        for name, item in (flatten(value) if nested else {"": value}).items():
            full = f"{key}.{name}" if nested else key
            if full in flat:
                raise ScenarioError(f"{full} is given twice, {flat[full]!r} and {item!r}; keep one")
            flat[full] = item
    return dict(sorted(flat.items(), key=lambda pair: _whole(pair[0]) in flat))


def overlay(under: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Values by full name where those of `over` count; a whole array there, for each element."""
    return {**{n: v for n, v in under.items() if _whole(n) not in over}, **over}


def _whole(name: str) -> str | None:
    """The array that an element's name is of: `a.x` for `a.x[2]`."""
    return name.rpartition("[")[0] if name.endswith("]") else None


def is_file(path: Path) -> bool:
    """Whether a file is there; a path that no file can have (a zero byte in it) is none."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def exists(path: Path) -> bool:
    """Whether a file or folder is there; a path that none can have (too long) is none."""
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


@lru_cache(maxsize=64)
def _parsed(text: str) -> bytes | None:
    """A TOML text, which is parsed slowly, as something that can be had again; None: too deep."""
    content = tomllib.loads(text)
    return None if depth_of(content) > DEPTH else pickle.dumps(content)


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises:
        ScenarioError: missing, too large or not TOML.
    """
    try:
        if excess := TEXT.excess(path.stat().st_size):
            raise ScenarioError(f"{path}: {excess}")
        parsed = _parsed(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ScenarioError(f"{path}: there is no such file") from None
    except RecursionError:
        raise ScenarioError(
            f"{path}: its lists and tables lie too deep within each other"
        ) from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except (
        ValueError,
        OverflowError,
    ) as error:  # TOML and UTF-8, numbers of thousands of digits, impossible paths
        raise ScenarioError(f"{path}: is not TOML ({error})") from error
    if parsed is None:
        raise ScenarioError(f"{path}: its lists and tables lie more than {DEPTH} deep")
    content: dict[str, Any] = pickle.loads(parsed)
    return content


def json_text(content: Any, indent: int | None = 2) -> str:
    """JSON with a line break at its end; numbers that are not finite, which it lacks, are null."""
    return json.dumps(_finite(content), indent=indent, allow_nan=False) + "\n"


def _finite(content: Any) -> Any:
    if isinstance(content, float):
        return content if math.isfinite(content) else None
    if isinstance(content, Mapping):
        return {key: _finite(item) for key, item in content.items()}
    if isinstance(content, (list, tuple)):
        return [_finite(item) for item in content]
    return content
