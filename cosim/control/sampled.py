"""A sampled FMU as a linear system: its states before one sample to those before the next.

    z[k+1] = F z[k] + G u[k],   y[k] = C z[k] + D u[k],   z = states and held values

by differences of runs over one period T, begun at the operating point; y is the mean before and
after the sample, which holds a value for half a period on the average. With z = (1 + w)/(1 - w),
w = s T/2 (Tustin), M = (I + F)^-1 (F - I) and N = (I + F)^-1 G this is

    A = 2 M/T,   B = 2 (I - M) N/T,   C,   D - C N

which is right well below the sampling frequency; a value that is forgotten at each sample is a pole
at -2/T. Inputs are held over the period; rounded values do not change.

Source: Åström and Wittenmark, Computer-Controlled Systems, 1997, sections 2.3 and 8.2.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..fmu.instance import Instance
from ..system.system import Member

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
INCREMENT = 1e-6
"""Of differences, relative to max(1, |z|): the error of central ones is then that of rounding."""
JUMP = 1e-4
"""Relative change over an increment, on one side only, that is an edge of rounding and no slope."""
INSTANT = 1e-6
"""Of a period: a step that shows what a sample has changed, and in which nothing else moves."""


def period(member: Member) -> float | None:
    """Time after which all sample clocks of an FMU tick together again [s], None if unknown.

    Periods are fixed parameters in seconds; the longest must be a multiple of the others.
    """
    found = [
        float(member.parameters.get(v.name, v.start[0]) or 0.0)
        for v in member.description.of("parameter")
        if v.variability == "fixed" and v.symbol == "s" and v.start
    ]
    longest = max(found, default=0.0)
    if not longest > 0.0 or not all(
        each > 0.0 and abs(longest / each - round(longest / each)) < 1e-6 for each in found
    ):
        return None
    return longest


def matrices(
    instance: Instance,
    member: Member,
    states: Sequence[str],
    inputs: Sequence[str],
    outputs: Sequence[str],
    interval: float,
) -> tuple[Matrix, Matrix, Matrix, Matrix] | None:
    """A, B, C, D of an instance around where it stands; None if a mode has no such form.

    Args:
        instance: at the operating point.
        member: whose it is.
        states: continuous ones and held values.
        inputs, outputs: of the system.
        interval: period of all its clocks [s].
    """  # fmt: skip
    names = [*states, *inputs]
    point = instance.get(*names)
    n = len(states)
    with Instance(member.fmu, member.name) as trial:

        def after(values: Vector) -> Vector:
            """States after a period, and outputs before and after the sample at its begin."""
            trial.reset()
            trial.set(member.parameters)
            trial.set(dict(zip(names, values.tolist(), strict=True)))
            trial.enter_initialization(instance.time)
            trial.exit_initialization()
            before = trial.get(*outputs) if outputs else np.zeros(0)
            trial.step(instance.time, INSTANT * interval)
            sampled = trial.get(*outputs) if outputs else np.zeros(0)
            trial.step(instance.time + INSTANT * interval, (1.0 - INSTANT) * interval)
            return np.concatenate([trial.get(*states), 0.5 * (before + sampled)])

        base = after(point)
        whole = np.zeros((n + len(outputs), len(names)))
        for column, value in enumerate(point.tolist()):
            ends = []
            step = INCREMENT * max(1.0, abs(value))
            for sign in (1.0, -1.0):
                values = point.copy()
                values[column] += sign * step
                ends.append(after(values))
            jumps = np.abs(ends[0] - ends[1]) > JUMP * np.maximum(1.0, np.abs(base))
            jumps &= (ends[0] == base) | (ends[1] == base)
            whole[:, column] = np.where(jumps, 0.0, ends[0] - ends[1]) / (2.0 * step)
    parts: list[Matrix] = [whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:]]
    f, g, c, d = parts
    eye = np.eye(n)
    if not np.isfinite(whole).all() or np.linalg.cond(eye + f) > 1e12:
        return None
    m: Matrix = np.asarray(np.linalg.solve(eye + f, f - eye), dtype=np.float64)
    k: Matrix = np.asarray(np.linalg.solve(eye + f, g), dtype=np.float64)
    return 2.0 * m / interval, 2.0 * (eye - m) @ k / interval, c, d - c @ k
