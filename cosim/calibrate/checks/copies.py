"""Runs that are copies of each other, whole or in part, and at whatever offset."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .finding import Finding
from .times import SHORT

if TYPE_CHECKING:
    from ..problem import Problem

Vector = NDArray[np.float64]
SHARE = 0.2
"""Share of the shorter run's samples that two runs have in common to be copies."""


def check_copies(problem: Problem) -> Iterator[Finding]:
    """Pairs of runs that have samples in common.

    A row is the values of all channels at one time; it counts if each of two runs holds it once.
    Two measurements of one motion differ by their noise. Of n such rows of a run, a row of another
    run equals that at one offset by chance with a probability of about 1 / n, so one is expected,
    and `SHORT` (50) of them have a probability of 1e-65 (Poisson), 1e-60 over all offsets. Where
    the noise hides below the resolution of all channels and a machine repeats a motion exactly,
    its rows are the same: such runs are copies for a fit, too.
    """
    seen: dict[bytes, list[tuple[int, int]]] = defaultdict(list)
    for number, run in enumerate(problem.runs):
        for index, key in _rows(run.data):
            seen[key].append((number, index))
    common: dict[tuple[int, int], Counter[int]] = defaultdict(Counter)
    for places in seen.values():
        if len(places) > 1 and len({number for number, _ in places}) == len(places):
            for at, (first, i) in enumerate(places):
                for second, j in places[at + 1 :]:
                    common[first, second][j - i] += 1
    for (first, second), offsets in sorted(common.items()):
        offset, count = offsets.most_common(1)[0]
        a, b = problem.runs[first], problem.runs[second]
        shorter = min(len(_rows(a.data)), len(_rows(b.data)))
        if count < SHORT or count < SHARE * shorter:
            continue
        shifted = f", {abs(offset)} samples apart" if offset else ""
        what = (
            "a validation that is a copy of what was fitted confirms anything"
            if a.purpose != b.purpose else "one of them counts twice"
        )  # fmt: skip
        text = (
            f"is a copy of run {a.name}: {count} of {shorter} samples of all channels are the "
            f"same{shifted}; {what}. Take one of the two out"
        )
        yield Finding("error", "copy", b.name, "", text)


def _rows(data: Vector) -> list[tuple[int, bytes]]:
    """Rows that differ from the one before and hold a value."""
    plain = np.where(np.isfinite(data), data + 0.0, np.nan)  # -0 and 0 are the same
    held = np.isfinite(plain).any(axis=1)
    new = np.ones(len(plain), dtype=bool)
    new[1:] = np.any((plain[1:] != plain[:-1]) & np.isfinite(plain[1:]), axis=1)
    return [(int(i), plain[i].tobytes()) for i in np.flatnonzero(held & new)]
