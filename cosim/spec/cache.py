"""The one folder where FMUs, libraries and executors are kept that can be made again."""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from pathlib import Path


def cache_folder() -> Path:
    """`COSIM_CACHE`, else the platform's cache folder, else a temporary one."""
    wanted = os.environ.get("COSIM_CACHE")
    if wanted:
        return Path(wanted)
    try:
        home = Path.home()
    except RuntimeError:  # no home directory
        return Path(tempfile.gettempdir()) / "cosim"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", home / "AppData" / "Local")) / "cosim" / "Cache"
    if sys.platform == "darwin":
        return home / "Library" / "Caches" / "cosim"
    return Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache") / "cosim"


def seal(path: Path) -> Path:
    """The file beside a kept one that holds the SHA-256 of its content."""
    return path.with_name(f"{path.name}.sha256")


def sealed(path: Path, content: bytes) -> bool | None:
    """Whether content of a kept file is what its seal says; None without one."""
    try:
        expected = seal(path).read_text(encoding="ascii")
    except (OSError, ValueError):
        return None
    return hashlib.sha256(content).hexdigest() == expected
