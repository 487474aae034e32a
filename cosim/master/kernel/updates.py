"""Where compiled code answers FMUs that ask for inputs within a step."""

from __future__ import annotations

import ctypes as ct

from . import find, load


def update(executor: str) -> int:
    """Address of the function, for a run by this executor; 0 if Python shall answer."""
    path = None if executor == "python" else find()
    return 0 if path is None else ct.cast(load(str(path)).cosim_update, ct.c_void_p).value or 0
