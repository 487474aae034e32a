"""What a fit found: values, intervals, and what the runs do not determine."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from ..errors import FmuCallError
from .loss import loss_for
from .normal import Normal, cost_of, gradient
from .parts import Sensitivity
from .problem import Problem

if TYPE_CHECKING:
    from .fit import Descent

Vector = NDArray[np.float64]
BOUNDS = 12.0
"""Information of the bounds: 1 / variance of a value anywhere between them, in spans."""
KNOWN = 0.25
"""A combination is identifiable if its standard deviation is below this fraction of the span."""
WEAK = 1e-3
"""Share of the best known direction's information up to which a direction is measured again."""
LONG, SHORT = 0.1, 0.01
"""Spans of the step with which that is done, and the least that the bounds must leave."""

HEAVY = 0.3
"""Weight in a weak direction from which a parameter is moved by itself."""
FAR, FOLLOWED, SLIGHT = 1.0, 6, 0.5
"""Spans by which that is done, steps at most of the others, and the fall [nats] that ends them."""
STUCK = 0.05
"""RMS over the noise of the differences between models that stick at other ticks."""
PARTS = (1.0, 0.3)
"""Shares of a step that are tried."""
CLEAR = 10.0
"""Times as much information as on a direction that others must have to be kept apart from it."""


@dataclass(frozen=True)
class Combination:
    """A direction of parameters that the runs do not determine.

    Attributes:
        weights: parameter -> change, in spans, along the direction (unit length).
        deviation: standard deviation along it that the data leave, in spans.
    """

    weights: dict[str, float]
    deviation: float

    def __str__(self) -> str:
        main = sorted(self.weights.items(), key=lambda item: -abs(item[1]))
        return " ".join(f"{value:+.2f}*{name}" for name, value in main if abs(value) > 0.15)


@dataclass(frozen=True)
class Estimate:
    """Calibrated parameters.

    Attributes:
        problem: what was fitted.
        theta: values of all parameters.
        covariance: of the parameters; sandwich over blocks, so correlated residuals count.
        low, high: 95 % intervals, cut at the bounds.
        identifiable: per parameter whether the data say more than the bounds.
        combinations: what the runs cannot tell apart.
        at_bound: parameters that ended at a bound.
        cost: half the sum of squared residuals over sigma, priors included.
        robust: the same with residuals that are far off counted less (`loss.loss_for`).
        count: residuals.
        iterations, evaluations: of the fit.
        jacobian, residuals: at the solution, by run.
    """

    problem: Problem
    theta: Vector
    covariance: Vector
    low: Vector
    high: Vector
    identifiable: NDArray[np.bool_]
    combinations: tuple[Combination, ...]
    at_bound: tuple[str, ...]
    cost: float
    robust: float
    count: int
    iterations: int
    evaluations: int
    jacobian: list[Sensitivity] = field(repr=False)
    residuals: list[tuple[str, Vector]] = field(repr=False)

    @property
    def values(self) -> dict[str, float]:
        """Parameter -> value."""
        return dict(zip(self.problem.names, self.theta.tolist(), strict=True))

    @property
    def deviation(self) -> Vector:
        """Standard deviations."""
        return np.sqrt(np.diag(self.covariance))


def _confirmed(run: Descent, values: Vector, vectors: Vector) -> tuple[Vector, Vector]:
    """Information on the weak directions, from steps large enough to be seen if they change much.

    Differences over small steps of a model with friction are rounded by the ticks at which it
    sticks, and that looks like information on combinations that change nothing (all torques and
    inertias by the same factor). The same rounding turns the direction a little, towards others
    that change a lot; what those could undo does not count.

    Args:
        run: its residuals are those at theta.
        values, vectors: of the normal matrix.

    Returns:
        one per direction, infinite where none was measured; and the directions, turned back to
        where the others undo nothing.
    """
    p = run.problem
    common = np.array([not item.run for item in p.parameters])
    found, turned = np.full(values.size, np.inf), vectors.copy()
    base = run.residuals

    def along(residuals: list[tuple[str, Vector]]) -> Vector:
        return np.asarray(vectors.T @ gradient(p, run.theta, run.jacobian, residuals))

    here = along(base)
    for i in np.flatnonzero((values >= 1.0 / KNOWN**2) & (values < WEAK * values.max())):
        direction = vectors[:, i]
        if float(np.sum(direction[common] ** 2)) < 0.5:
            continue
        better = values > CLEAR * values[i]
        seen: list[tuple[float, Vector]] = []
        for sign in (1.0, -1.0):
            way = sign * direction * p.scale
            with np.errstate(divide="ignore", invalid="ignore"):
                room = np.where(way > 0, p.upper - run.theta, p.lower - run.theta) / way
            length = min(LONG, float(np.nanmin(np.where(way == 0.0, np.inf, room))))
            if length < SHORT:
                continue
            try:
                there = np.clip(run.theta + length * way, p.lower, p.upper)
                moved = p.residuals(there, run.purpose)
            except FmuCallError:
                continue
            pairs = zip(moved, base, strict=True)
            square = sum(float(np.nansum((a - b) ** 2)) for (_, a), (_, b) in pairs)
            undone = along(moved) - here
            square -= float(np.sum(undone[better] ** 2 / values[better]))
            drawn = sum(
                (length * way[k] / item.prior) ** 2
                for k, item in enumerate(p.parameters) if item.prior
            )  # fmt: skip
            back = vectors[:, better] @ (undone[better] / values[better]) / (sign * length)
            seen.append(((max(square, 0.0) + drawn) / length**2, direction + back))
        if seen:
            found[i], turned[:, i] = min(seen, key=lambda item: item[0])
    return found, turned


def _profiled(run: Descent, normal: Normal, covariance: Vector, which: NDArray[np.intp]) -> Vector:
    """A covariance, widened where a parameter can be moved far and the others make up for that.

    Several weak directions at once are mixed by rounded derivatives, and none of them is then the
    one along which nothing changes; a parameter that is held elsewhere finds it. What the data say
    is read from steps of two lengths: what a step of any length costs (up to `STUCK`) is no
    information.

    Args:
        run: at its minimum.
        normal: equations there.
        covariance: in spans.
        which: indices of the parameters to move.
    """
    p, covariance = run.problem, covariance.copy()
    stuck = STUCK**2 * sum(np.isfinite(r).sum() for _, r in run.residuals)
    for k in which:
        if math.sqrt(covariance[k, k]) > KNOWN:
            continue
        above, below = (np.array([p.upper - run.theta, run.theta - p.lower]) / p.scale)[:, k]
        length = (1.0 if above >= below else -1.0) * min(FAR, max(above, below))
        others = np.flatnonzero(np.arange(run.theta.size) != k)
        inverse = np.linalg.pinv(normal.matrix[np.ix_(others, others)], 1e-12, hermitian=True)
        way = np.zeros(run.theta.size)
        way[k], rises = 1.0, []
        way[others] = -inverse @ normal.matrix[others, k]
        try:
            for size in (0.5 * length, length):
                theta = np.clip(run.theta + size * way * p.scale, p.lower, p.upper)
                residuals = p.residuals(theta, run.purpose)
                cost = run.total(theta, residuals)
                for _ in range(FOLLOWED):
                    step = np.zeros(run.theta.size)
                    wanted = gradient(p, theta, run.jacobian, residuals, run.loss)[others]
                    step[others] = inverse @ wanted
                    before = cost
                    for part in PARTS:
                        there = np.clip(theta + part * step * p.scale, p.lower, p.upper)
                        moved = p.residuals(there, run.purpose)
                        if (after := run.total(there, moved)) < cost:
                            theta, residuals, cost = there, moved, after
                            break
                    if before - cost < SLIGHT:
                        break
                rises.append(2.0 * (cost - run.cost))
                way = (theta - run.theta) / (size * p.scale)
        except FmuCallError:
            continue
        floor = min(max((4.0 * rises[0] - rises[1]) / 3.0, 0.0), stuck)
        told = max(rises[1] - floor, 0.0) / length**2
        # where nothing is told it may be anywhere up to the bound, two deviations away
        more = 1.0 / max(told, (2.0 / length) ** 2) - covariance[k, k]
        if more > 0.0:
            covariance += more * np.outer(way, way)
    return covariance


def estimated(run: Descent, *, confirm: bool = False) -> Estimate:
    """What a fit that has ended knows.

    Args:
        run: the fit.
        confirm: measure weak directions with long steps.
    """
    problem = run.problem
    # the last Jacobian, whose point is less than the steps of its differences away
    normal = Normal(problem, run.theta, run.jacobian, run.residuals, run.loss)
    count = int(sum(np.isfinite(r).sum() for _, r in run.residuals))
    scale = problem.scale
    values, vectors = np.linalg.eigh(normal.matrix)
    turned = vectors
    if confirm:
        seen, turned = _confirmed(run, values, vectors)
        values = np.minimum(values, seen)
    poor = values < 1.0 / KNOWN**2
    fitted = {name for name, _ in run.residuals}
    concerned = np.array([not p.run or p.run in fitted for p in problem.parameters])
    # along directions that the data leave open, the bounds are all that is known
    good = vectors[:, ~poor]
    inverse = (good / values[~poor]) @ good.T
    blocks = max(int(np.any(normal.scores != 0.0, axis=1).sum()), 1)
    freedom = max(blocks - int(np.sum(~poor)), 1)
    middle = normal.scores.T @ normal.scores * blocks / freedom
    sandwich = inverse @ middle @ inverse
    cost = cost_of(problem, run.theta, run.residuals)
    robust_cost = cost_of(problem, run.theta, run.residuals, loss_for(problem.unstable))
    spread_cost = cost_of(problem, run.theta, run.residuals, run.loss)
    spread = max(2.0 * spread_cost / max(count - int(np.sum(~poor)), 1), 1.0)
    # a few blocks can seem to agree by chance: never below what white residuals give
    white, robust = np.diag(inverse) * spread, np.diag(sandwich)
    factor = np.sqrt(np.maximum(white, robust) / np.maximum(robust, 1e-300))
    known = sandwich * np.outer(factor, factor)
    unknown = (turned[:, poor] * (spread / (values[poor] + BOUNDS))) @ turned[:, poor].T
    scaled = known + unknown
    if confirm:
        weak = np.any(np.abs(vectors[:, values < WEAK * values.max()]) > HEAVY, axis=1)
        scaled = _profiled(run, normal, scaled, np.flatnonzero(weak & concerned))
    covariance = scaled * np.outer(scale, scale)
    variances, directions = np.linalg.eigh(scaled)
    combinations = tuple(
        Combination(
            dict(zip(problem.names, _signed(directions[:, i]).tolist(), strict=True)),
            float(math.sqrt(variances[i])),
        )
        for i in np.flatnonzero(variances > KNOWN**2)[::-1]
        # nuisance values of runs that were not fitted are no finding
        if float(np.sum(directions[concerned, i] ** 2)) > 0.5
    )
    half = float(student.ppf(0.975, freedom)) * np.sqrt(np.diag(covariance))
    near = 1e-6 * scale
    at_bound = [
        p.name
        for p, value, margin in zip(problem.parameters, run.theta, near, strict=True)
        if value <= p.minimum + margin or value >= p.maximum - margin
    ]
    return Estimate(
        problem=problem,
        theta=run.theta,
        covariance=covariance,
        low=np.maximum(run.theta - half, problem.lower),
        high=np.minimum(run.theta + half, problem.upper),
        identifiable=(np.sqrt(np.diag(covariance)) < KNOWN * scale)
        & (np.diag(unknown) < 0.5 * np.diag(scaled)),
        combinations=combinations,
        at_bound=tuple(at_bound),
        cost=cost,
        robust=robust_cost,
        count=count,
        iterations=run.iterations,
        evaluations=problem.evaluations - run.begun,
        jacobian=run.jacobian,
        residuals=run.residuals,
    )


def _signed(vector: Vector) -> Vector:
    return np.asarray(vector * np.sign(vector[np.argmax(np.abs(vector))]), dtype=np.float64)


def channel_rms(problem: Problem, residuals: Iterable[tuple[str, Vector]]) -> dict[str, float]:
    """Root mean square of the residuals over sigma, by channel."""
    stacked = np.concatenate([values for _, values in residuals])
    with np.errstate(invalid="ignore"):
        means = np.sqrt(np.nanmean(stacked**2, axis=0))
    return dict(zip((c.name for c in problem.channels), means.tolist(), strict=True))
