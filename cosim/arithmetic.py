"""The same arithmetic on every x86-64 processor of the last ten years.

NumPy, and the BLAS beneath it and SciPy, choose their instructions by the processor. With AVX-512
they sum in another order than with AVX2, and logarithms round another way: a difference in the
last digit, of which a fit that ends in a flat valley, or at a jump, makes much. So AVX2 is chosen
wherever it is there. The choice is made when the libraries are loaded, by variables of the
environment that are obeyed if they are set; where NumPy was imported before cosim it is too late.

Sources: OpenBLAS, `driver/others/dynamic.c`; NumPy, "CPU build options", runtime dispatch.
"""

from __future__ import annotations

import ctypes
import os
import sys
from importlib.metadata import version
from pathlib import Path

_HEAD = 1 << 14
"""[bytes] Of the list of processors, which holds the first one's features."""
_AVX2, _AVX512 = 40, 41
"""Features as Windows counts them (winnt.h)."""


def choose() -> None:
    """Choose the instructions, if they are still to be chosen."""
    if "numpy" in sys.modules:
        return
    features = _features()
    if {"avx2", "fma"} <= features:
        os.environ.setdefault("OPENBLAS_CORETYPE", "Haswell")
    if "avx512f" in features:
        os.environ.setdefault("NPY_DISABLE_CPU_FEATURES", _beyond())


def _features() -> set[str]:
    """What the processor can do of what matters here; nothing where that is not known."""
    if sys.platform == "win32":
        has = ctypes.windll.kernel32.IsProcessorFeaturePresent
        return ({"avx2", "fma"} if has(_AVX2) else set()) | ({"avx512f"} if has(_AVX512) else set())
    try:
        with Path("/proc/cpuinfo").open("rb") as file:
            head = file.read(_HEAD)
    except OSError:
        return set()
    line = next((line for line in head.splitlines() if line.startswith(b"flags")), b"")
    return {word.decode() for word in line.split()}


def _beyond() -> str:
    """What NumPy calls the groups of instructions beyond AVX2."""
    major, minor = (int(part) for part in version("numpy").split(".")[:2])
    if (major, minor) >= (2, 4):
        return "X86_V4 AVX512_ICL AVX512_SPR"
    return "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL"
