"""Memory that was freed goes back to the machine.

The C library keeps what threads have freed, in pieces between what is still in use: after a
hundred simulations of laws half of what a diagnosis holds is such, and grows with every round.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from functools import lru_cache


@lru_cache(maxsize=1)
def _trim() -> Callable[[int], int] | None:
    """`malloc_trim` of glibc, None of another C library, which gives back by itself."""
    if sys.platform != "linux":
        return None
    found: Callable[[int], int] | None = getattr(ctypes.CDLL(None), "malloc_trim", None)
    return found


def give_back() -> None:
    """Give back what is free; takes milliseconds, for use after work of a second."""
    trim = _trim()
    if trim is not None:
        trim(0)
