"""Derivatives along main directions, over steps that change the runs all alike.

Where a model jumps (an integrator that stops a tick earlier), each difference has some of that in
it, as much over a short step as over a long one. Over the same share of all spans, that looks like
information on what changes nothing. Over a step along a main direction of the normal equations,
which changes the runs `FELT` times the noise, it is little of what is seen; and steps along what
changes hardly anything are long. Where a run changes by more than that (a limit is met), the other
side counts, or a shorter step.

    h_k = FELT sqrt(n / lambda_k),   J = (differences over h_k along t_k) T^-1

T holds the main directions of the common parameters as columns, with what the parameters of a run
alone do to make up for them, and the main directions of these.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import FmuCallError
from .parts import MeasuredRun, Sensitivity
from .problem import Problem
from .simulator import Simulator

Vector = NDArray[np.float64]
STUCK = 0.05
"""RMS over the noise of the differences between models that stick at other ticks."""
FELT = 0.3
"""RMS over the noise by which a step along a direction changes the runs: several times as much as
`STUCK`, and little enough for a derivative."""
SHORTEST, LONGEST = 1e-4, 0.1
"""Such steps at least (below, what a solver's tolerance leaves is in the differences) and at most
[spans]: so far, a model is still nearly linear in what it hardly depends on."""
BOTH_SIDES = 0.3
"""Share of a step that bounds must leave on both sides for both to be taken: else one side, as long
as it is wanted, has less of a jump in it than two short ones."""
CALMER, SHORTER = 0.5, 0.1
"""Square of what a step changes on one side over that on the other, from which only the other has
met a limit, and the factor on steps that have met one on both sides."""
AGREED = 0.1
"""Share of the square of a change on which both sides may differ where it is no jump: two jumps
have as much in common as not."""
NOTHING = 1e-12
"""Share of the largest information on a run's own parameters that rounding leaves of none."""


@dataclass
class _Directions:
    """Directions of a run, and what was seen along them.

    Attributes:
        run, columns: which, and the indices of its parameters.
        own: places of the parameters of this run alone among the columns.
        matrix: T, in spans; the common directions first.
        lengths: of the steps [spans].
        slopes, bends: derivatives along them and half the difference of both sides, over the noise.
        changes: squares of what the steps changed, NaN where none could be simulated.
        bent: squares of what both sides do not agree on, infinite where there was one side only.
    """

    run: MeasuredRun
    columns: NDArray[np.intp]
    own: NDArray[np.bool_]
    matrix: Vector
    lengths: Vector
    slopes: Vector
    bends: Vector
    changes: Vector
    bent: Vector


def felt(
    simulator: Simulator, theta: Vector, items: list[Sensitivity], rough: Collection[str]
) -> list[Sensitivity]:
    """Derivatives of some runs along main directions, given back along the parameters.

    What changes these runs, over the longest step, by no more than jumps do changes nothing, unless
    both sides agree.
    Parameters with a lattice keep the derivatives that they have.

    Args:
        simulator: of the problem.
        theta: where.
        items: derivatives there by parameters, which say what the main directions are.
        rough: runs that are differentiated anew.
    """
    problem = simulator.problem
    found = {d.run.name: d for d in _directions(problem, items, rough)}
    for directions in found.values():
        _differences(simulator, theta, directions)
    shared = [d.changes.size - int(np.sum(d.own)) for d in found.values()]
    count = sum(int(np.isfinite(d.run.data).sum()) for d in found.values())
    silent = np.zeros(min(shared, default=0), dtype=bool)
    if shared:
        longest = next(iter(found.values())).lengths[: silent.size] >= LONGEST
        changes, bent = (
            np.nansum([of[:size] for of, size in zip(each, shared, strict=True)], axis=0)
            for each in zip(*((d.changes, d.bent) for d in found.values()), strict=True)
        )
        silent = longest & (changes <= STUCK**2 * count) & ~(bent <= AGREED * changes)
    return [
        _by_parameter(problem, item, found[item.run], silent) if item.run in found else item
        for item in items
    ]


def _directions(
    problem: Problem, items: Iterable[Sensitivity], rough: Collection[str]
) -> list[_Directions]:
    """Main directions of the runs that are rough, from the derivatives of all."""
    free = np.array([p.hints.lattice == 0.0 for p in problem.parameters])
    alone = np.array([bool(p.run) for p in problem.parameters])
    shared = np.flatnonzero(free & ~alone)
    whole, parts, total = np.zeros((shared.size, shared.size)), [], 0
    for item in items:
        run = problem.run(item.run)
        columns = item.columns[free[item.columns]]
        places = np.isin(item.columns, columns)
        known = np.nan_to_num(item.values[:, :, places] * problem.scale[columns])
        flat = known.reshape(-1, columns.size)
        matrix, own = flat.T @ flat, alone[columns]
        inner = matrix[np.ix_(own, own)]
        values, ways = np.linalg.eigh(inner)
        kept = values > NOTHING * max(values[-1:].sum(), 1e-300)
        inverse = (ways[:, kept] / values[kept]) @ ways[:, kept].T
        undo = -inverse @ matrix[np.ix_(own, ~own)]
        at = np.searchsorted(shared, columns[~own])
        whole[np.ix_(at, at)] += matrix[np.ix_(~own, ~own)] + matrix[np.ix_(~own, own)] @ undo
        count = int(np.isfinite(run.data).sum())
        total += count
        if item.run in rough:
            parts.append((run, columns, own, undo, ways, _lengths(values, count)))
    values, main = np.linalg.eigh(whole)
    lengths, found = _lengths(values, total), []
    for run, columns, own, undo, ways, inner_lengths in parts:
        matrix = np.zeros((columns.size, shared.size + inner_lengths.size))
        at = np.searchsorted(shared, columns[~own])
        matrix[~own, : shared.size] = main[at]
        matrix[own, : shared.size] = undo @ main[at]
        matrix[np.ix_(own, np.arange(shared.size, matrix.shape[1]))] = ways
        shape = (*run.data.shape, matrix.shape[1])
        found.append(
            _Directions(
                run, columns, own, matrix, np.concatenate([lengths, inner_lengths]),
                np.zeros(shape), np.zeros(shape), np.full(matrix.shape[1], np.nan),
                np.full(matrix.shape[1], np.inf),
            )
        )  # fmt: skip
    return found


def _lengths(values: Vector, count: int) -> Vector:
    """Steps along directions on which this much is known [spans]."""
    wanted = FELT * math.sqrt(max(count, 1)) / np.sqrt(np.maximum(values, 1e-300))
    return np.asarray(np.clip(wanted, SHORTEST, LONGEST))


def _differences(simulator: Simulator, theta: Vector, it: _Directions) -> None:
    """Simulate a run on both sides along each direction, and note what that changes."""
    problem, run = simulator.problem, it.run
    scale, lower, upper = (
        values[it.columns] for values in (problem.scale, problem.lower, problem.upper)
    )
    low, high = (lower - theta[it.columns]) / scale, (upper - theta[it.columns]) / scale
    gap = np.where(np.isfinite(run.data), 0.0, np.nan)

    def simulate(change: Vector) -> Vector | None:
        moved = theta.copy()
        moved[it.columns] = np.clip(moved[it.columns] + change * scale, lower, upper)
        try:
            return simulator.simulate(moved, run) / problem.sigma + gap
        except FmuCallError:  # the other side may do, or what is known so far
            return None

    steps = [
        _sides(way, float(length), low, high)
        for way, length in zip(it.matrix.T, it.lengths, strict=True)
    ]
    tasks = [(k, h) for k, pair in enumerate(steps) for h in pair]
    changes = [np.zeros(it.columns.size), *(h * it.matrix[:, k] for k, h in tasks)]
    base, *moved = simulator.spread(simulate, changes)
    if base is None:
        return
    jump = STUCK**2 * float(np.isfinite(gap).sum())
    for k in range(len(steps)):
        sides = [(h, m - base) for (at, h), m in zip(tasks, moved, strict=True)
                 if at == k and m is not None]  # fmt: skip
        if not sides:
            continue
        length, sides = abs(sides[0][0]), _calm(sides, jump)
        while len(sides) > 1 and _bend(sides) > jump and SHORTER * sides[1][0] >= SHORTEST:
            nearer = [(SHORTER * h, simulate(SHORTER * h * it.matrix[:, k])) for h, _ in sides]
            inner = _calm([(h, m - base) for h, m in nearer if m is not None], jump)
            if len(inner) > 1 and _uneven(inner) > CALMER * _uneven(sides):
                break  # no limit: jumps, of which a shorter step has more
            sides = inner or sides
        slope = sum(change / h for h, change in sides) / len(sides)
        it.slopes[:, :, k] = slope
        if sides[1:]:
            it.bends[:, :, k] = 0.5 * (sides[1][1] / sides[1][0] - sides[0][1] / sides[0][0])
            it.bent[k] = float(np.nansum((length * it.bends[:, :, k]) ** 2))
        it.changes[k] = float(np.nansum((length * slope) ** 2))
    it.slopes, it.bends = run.white(it.slopes), run.white(it.bends)


def _bend(sides: list[tuple[float, Vector]]) -> float:
    """Square of what both sides do not have in common."""
    return float(np.nansum((sides[0][1] + sides[1][1]) ** 2))


def _uneven(sides: list[tuple[float, Vector]]) -> float:
    """The same over what changes from one side to the other."""
    return _bend(sides) / max(float(np.nansum((sides[1][1] - sides[0][1]) ** 2)), 1e-300)


def _calm(sides: list[tuple[float, Vector]], jump: float) -> list[tuple[float, Vector]]:
    """Both sides, or the one that no limit is met on.

    Args:
        sides: steps, and what changes over each.
        jump: square of what sticking changes, above which a limit has been met.
    """
    if len(sides) < 2 or _bend(sides) <= jump:
        return sides
    sizes = [float(np.nansum(change**2)) for _, change in sides]
    return [sides[int(np.argmin(sizes))]] if min(sizes) < CALMER * max(sizes) else sides


def _sides(way: Vector, length: float, low: Vector, high: Vector) -> tuple[float, ...]:
    """Steps along a direction to both sides, or to those on which bounds leave room.

    Args:
        way: in spans.
        length: wanted.
        low, high: changes that the bounds allow, in spans.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        above = float(np.min(np.where(way > 0, high / way, np.where(way < 0, low / way, np.inf))))
        below = float(np.min(np.where(way > 0, -low / way, np.where(way < 0, -high / way, np.inf))))
    if min(above, below) >= BOTH_SIDES * length:
        length = min(length, above, below)
        return -length, length
    if max(above, below) < SHORTEST:
        return ()
    return (min(length, above),) if above > below else (-min(length, below),)


def _by_parameter(
    problem: Problem, item: Sensitivity, it: _Directions, silent: NDArray[np.bool_]
) -> Sensitivity:
    """Derivatives along parameters from those along directions.

    Args:
        problem: of the run.
        item: what was known.
        it: what was seen.
        silent: common directions along which only jumps were seen.
    """
    places, scale = np.isin(item.columns, it.columns), problem.scale[it.columns]
    slopes, bends = it.slopes, it.bends
    unseen = np.isnan(it.changes)
    known = item.values[:, :, places] * scale
    slopes[:, :, unseen] = known @ it.matrix[:, unseen]
    still = np.flatnonzero(silent & ~unseen[: silent.size])
    slopes[:, :, still] = bends[:, :, still] = 0.0
    back = np.linalg.pinv(it.matrix) / scale
    found, rough = item.values.copy(), np.zeros_like(item.values)
    if item.roughness is not None:
        rough = item.roughness.copy()
    found[:, :, places], rough[:, :, places] = slopes @ back, bends @ back
    return Sensitivity(item.run, item.columns, found, rough)
