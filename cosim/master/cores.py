"""How many processors this program may use."""

from __future__ import annotations

import os

VARIABLE = "PYTHON_CPU_COUNT"
"""Of the environment: as many as it says; Python itself minds it from 3.13 on."""


def cores() -> int:
    """Processors that work is shared among: those of the machine that this process may use.

    A container or `taskset` allows fewer than the machine has.
    """
    told = os.environ.get(VARIABLE, "")
    if told.isdecimal() and int(told) > 0:
        return int(told)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
