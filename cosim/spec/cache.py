"""The one folder where FMUs, libraries and executors are kept that can be made again."""

from __future__ import annotations

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
