"""Where built things are kept, and writing that leaves no half-written file."""

from __future__ import annotations

import hashlib
import os
import tempfile
from pathlib import Path

from cosim.spec import cache


def cache_folder(name: str) -> Path:
    """A folder of the cache, made if it is not there."""
    folder = cache.cache_folder() / name
    folder.mkdir(parents=True, exist_ok=True)
    return folder.resolve()


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file so that nobody ever sees a part of it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def keep(path: Path, content: bytes) -> None:
    """Write a file with its seal, so that damage is seen later."""
    write_atomically(cache.seal(path), hashlib.sha256(content).hexdigest().encode())
    write_atomically(path, content)
