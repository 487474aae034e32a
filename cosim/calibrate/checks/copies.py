"""Runs that are copies of each other or of themselves, whole or in part, or in one column."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .finding import Finding
from .smooth import noise
from .times import SHORT

if TYPE_CHECKING:
    from ..problem import Problem

Vector = NDArray[np.float64]
SAME = 0.9
"""Share of a column's samples that two runs have in common for it to be one."""
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
    sizes = []
    for number, run in enumerate(problem.runs):
        rows = _rows(run.data)
        sizes.append(len(rows))
        for index, key in rows:
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
        shorter = min(sizes[first], sizes[second])
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


def check_repeated(problem: Problem) -> Iterator[Finding]:
    """Rows that a run holds twice, one offset apart: a part of it was written again.

    Only columns with noise finer than their resolution count (`smooth.noise`), since a machine that
    repeats a motion exactly is no copy. A row counts if the run holds it twice, so that `SHORT` at
    one offset are as improbable as in two runs.
    """
    fine = [
        i for i in range(len(problem.channels))
        if noise([run.data[:, i] for run in problem.runs]) is not None
    ]  # fmt: skip
    for run in problem.runs if fine else ():
        places: dict[bytes, list[int]] = defaultdict(list)
        for index, key in _rows(run.data[:, fine]):
            places[key].append(index)
        twice = [at for at in places.values() if len(at) == 2]
        offsets = Counter(second - first for first, second in twice)
        offset, count = offsets.most_common(1)[0] if offsets else (0, 0)
        if count < SHORT:
            continue
        begin = min(first for first, second in twice if second - first == offset)
        text = (
            f"holds {count} samples twice: what was measured from {run.logged[begin]:.6g} s on "
            f"stands once more from {run.logged[begin + offset]:.6g} s on; take it out, or give "
            "what is before and what comes after it a run each, with samples"
        )
        yield Finding("error", "copy", run.name, "", text)


def check_columns(problem: Problem) -> Iterator[Finding]:
    """Single columns that two runs have in common: one of them was taken from the other run.

    Only columns with noise finer than their resolution are looked at (`smooth.noise`): of two
    measurements a share of 0.28 of the samples is then the same at most (`still.HELD`), and `SAME`
    of `SHORT` and more has a probability below 1e-20.
    """
    for index, channel in enumerate(problem.channels):
        if noise([run.data[:, index] for run in problem.runs]) is None:
            continue
        column = _side_by_side([run.data[:, index] for run in problem.runs])
        for a, first in enumerate(problem.runs):
            alike = _same(column[:, a, None], column[:, a + 1 :]) >= SAME
            for second in (problem.runs[a + 1 + k] for k in np.flatnonzero(alike).tolist()):
                same = _same(first.data, second.data)
                if np.nanmin(same) >= SAME:
                    continue  # whole runs: `check_copies`
                text = (
                    f"is that of run {first.name}: {same[index]:.0%} of its samples are the same, "
                    "and those of other columns are not; one of the two belongs to another run"
                )
                yield Finding("error", "mixed", second.name, channel.name, text)


def _side_by_side(columns: Sequence[Vector]) -> Vector:
    """Columns of several lengths in one table, NaN behind the end of the shorter ones."""
    table = np.full((max(map(len, columns)), len(columns)), np.nan)
    for place, values in zip(table.T, columns, strict=True):
        place[: len(values)] = values
    return table


def _same(first: Vector, second: Vector) -> Vector:
    """Share of samples that two tables have in common, by column; 0 where too few are measured."""
    size = min(len(first), len(second))
    one, two = first[:size], second[:size]
    good = np.isfinite(one) & np.isfinite(two)
    count = good.sum(axis=0)
    equal = np.sum(good & (one == two), axis=0)
    return np.asarray(np.where(count >= SHORT, equal / np.maximum(count, 1), 0.0))


def _rows(data: Vector) -> list[tuple[int, bytes]]:
    """Rows that differ from the one before and hold a value."""
    plain = np.where(np.isfinite(data), data + 0.0, np.nan)  # -0 and 0 are the same
    held = np.isfinite(plain).any(axis=1)
    new = np.ones(len(plain), dtype=bool)
    new[1:] = np.any((plain[1:] != plain[:-1]) & np.isfinite(plain[1:]), axis=1)
    return [(int(i), plain[i].tobytes()) for i in np.flatnonzero(held & new)]
