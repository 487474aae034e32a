"""Where built things are kept, and writing that leaves no half-written file."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path


def cache_folder(name: str) -> Path:
    """A folder of the cache: `$COSIM_CACHE`, else the user's cache, else a temporary one."""
    root = os.environ.get("COSIM_CACHE")
    if root:
        base = Path(root)
    else:
        try:
            base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "cosim"
        except RuntimeError:  # no home directory
            base = Path(tempfile.gettempdir()) / "cosim-cache"
    folder = base / name
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
