"""What a fit found: values, intervals, and what the runs do not determine."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from .descent import Descent
from .known import Known
from .loss import loss_for
from .normal import BOUNDS, KNOWN, WIDER, Normal, cost_of
from .parts import Sensitivity
from .problem import Problem
from .simulator import Simulator
from .valley import profiled, stretch
from .weak import WEAK, confirmed

Vector = NDArray[np.float64]
ROUNDED = 1e-6
"""Share of the variance for white residuals below which that over blocks is rounding: blocks that
seem to agree by chance take away a hundredth at most."""


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
        simulator: of what was fitted.
        theta: values of all parameters.
        covariance: of the parameters; sandwich over blocks, so correlated residuals count.
        low, high: 95 % intervals, cut at the bounds.
        identifiable: per parameter whether the data determine it (`determined`).
        combinations: what the runs cannot tell apart.
        at_bound: parameters that ended at a bound.
        cost: half the sum of squared residuals over sigma, priors included.
        robust: the same with residuals that are far off counted less (`loss.loss_for`).
        count: residuals.
        evaluations: simulated runs of the fit.
        jacobian, residuals: at the solution, by run.
        unkept: what the last step of a quick fit promised and did not gain [nats]; it has stalled.
        refused: values beyond the last ones that could not be simulated, and why.
    """

    simulator: Simulator
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
    evaluations: int
    jacobian: list[Sensitivity] = field(repr=False)
    residuals: list[tuple[str, Vector]] = field(repr=False)
    unkept: float = 0.0
    refused: tuple[Vector, str] | None = None

    @property
    def problem(self) -> Problem:
        """What was fitted."""
        return self.simulator.problem

    @property
    def known(self) -> Known:
        """The derivatives, for a fit of nearly the same."""
        return Known(self.problem.names, self.jacobian)

    @property
    def values(self) -> dict[str, float]:
        """Parameter -> value."""
        return dict(zip(self.problem.names, self.theta.tolist(), strict=True))

    def _repr_html_(self) -> str:
        from ..display.bars import within
        from ..display.html import Cell, explained, number, table, tag, unit
        from ..display.notebook import view

        rows = [
            [explained(p.name, p.text), Cell(number(value), value),
             Cell(f"{number(low)} to {number(high)}{'' if known else ', open'}", low),
             unit(p.unit), within(value, low, high, p.minimum, p.maximum, p.nominal)]
            for p, value, low, high, known in zip(
                self.problem.parameters, self.theta.tolist(), self.low.tolist(),
                self.high.tolist(), self.identifiable, strict=True,
            )
            if p.role != "nuisance"
        ]  # fmt: skip
        errors = channel_rms(self.problem, self.residuals)
        return view(
            f"Estimate of {self.problem.name}",
            f"{self.count} residuals, {self.evaluations} simulated runs",
            table(["parameter", "value", "95 % interval", "unit", "within its bounds"], rows),
            tag("p", "error over noise: ",
                ", ".join(f"{name} {size:.2f}×" for name, size in errors.items())),
            *(tag("p", f"not told apart: {item}") for item in map(str, self.combinations) if item),
        )  # fmt: skip

    @property
    def deviation(self) -> Vector:
        """Standard deviations."""
        return np.sqrt(np.diag(self.covariance))


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
    values = np.maximum(values, 0.0)  # beside 1e17 of the best known one, rounding is below -12
    turned = vectors
    if confirm:
        seen, turned = confirmed(run, values, vectors)
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
    robust = cost_of(problem, run.theta, run.residuals, loss_for(problem.unstable))
    counted = cost_of(problem, run.theta, run.residuals, run.loss)
    spread = max(2.0 * counted / max(count - int(np.sum(~poor)), 1), 1.0)
    # a few blocks can seem to agree by chance: never below what white residuals give
    white, correlated = np.diag(inverse) * spread, np.diag(sandwich)
    variance = np.maximum(white, correlated)
    # where blocks tell nothing of a parameter its row is rounding, of any sign
    told = correlated > ROUNDED * white
    factor = np.sqrt(variance / np.where(told, correlated, np.inf))
    known = sandwich * np.outer(factor, factor)
    np.fill_diagonal(known, variance)
    unknown = spread * _open(values[poor], turned[:, poor], widths(problem))
    wider = spread * np.diag(_open(values[poor], turned[:, poor], WIDER * widths(problem)))
    scaled = known + unknown
    if confirm:
        doubtful = values < (math.inf if run.uneven else WEAK * values.max())
        scaled = profiled(run, scaled, vectors[:, doubtful])
    scaled = _with_priors(problem, scaled, np.diag(inverse), variance)
    # any value between two of a lattice may do as well
    lattice = np.array([p.hints.lattice**2 / 12.0 for p in problem.parameters]) / scale**2
    scaled += np.diag(lattice)
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
    deviations = float(stdtrit(freedom, 0.975))
    half = deviations * np.sqrt(np.diag(scaled))
    own = deviations * np.sqrt(np.diag(known) + lattice)
    below, above = (
        scale * np.minimum(half, own + _rooms(run, scaled - known, half, sign))
        for sign in (-1.0, 1.0)
    )
    near = 1e-6 * scale
    at_bound = [
        p.name
        for p, value, margin in zip(problem.parameters, run.theta, near, strict=True)
        if value <= p.minimum + margin or value >= p.maximum - margin
    ]
    return Estimate(
        simulator=run.simulator,
        theta=run.theta,
        covariance=covariance,
        low=np.maximum(run.theta - below, problem.lower),
        high=np.minimum(run.theta + above, problem.upper),
        identifiable=determined(np.diag(covariance) / scale**2, np.diag(unknown), wider),
        combinations=combinations,
        at_bound=tuple(at_bound),
        cost=cost,
        robust=robust,
        count=count,
        evaluations=run.simulator.evaluations - run.begun,
        jacobian=run.jacobian,
        residuals=run.residuals,
        unkept=run.unkept,
        refused=run.refused,
    )


def _with_priors(problem: Problem, scaled: Vector, alone: Vector, variance: Vector) -> Vector:
    """A covariance in which priors count in full, however much the misfit widens the rest.

    With D / s the information of the data, widened by s, and P that of priors, (D + P) / s is
    where it comes from and D / s + P what it should be.

    Args:
        problem: its parameters.
        scaled: covariance [spans^2].
        alone: variances before they were widened.
        variance: after that.
    """
    prior = np.array([k / p.prior if p.prior else 0.0
                      for k, p in zip(problem.scale, problem.parameters, strict=True)])  # fmt: skip
    lost = 1.0 - alone / np.maximum(variance, 1e-300)
    root = prior * np.sqrt(np.clip(lost, 0.0, 1.0))
    if not np.any(root):
        return scaled
    inner = np.eye(root.size) + root[:, None] * scaled * root
    pulled = scaled * root
    return np.asarray(scaled - pulled @ np.linalg.solve(inner, pulled.T))


def widths(problem: Problem) -> Vector:
    """How far apart the bounds of the parameters are, in spans: 1 for those of a sheet."""
    return np.asarray((problem.upper - problem.lower) / problem.scale)


def _open(values: Vector, directions: Vector, width: Vector) -> Vector:
    """Covariance along directions that the data leave open: bounds are what is known there.

    Args:
        values: information of the data on each direction.
        directions: in spans, as columns.
        width: of the bounds [spans].
    """
    bounds = directions.T @ (directions * (BOUNDS / width**2)[:, None])
    return np.asarray(directions @ np.linalg.pinv(np.diag(values) + bounds) @ directions.T)


def _rooms(run: Descent, ways: Vector, half: Vector, sign: float) -> Vector:
    """How far each parameter can go until one of those that make up for it meets its bound.

    Args:
        run: at its minimum.
        ways: covariance along what is open, whose columns say who makes up for whom.
        half: how far the data would let each go; all in spans.
        sign: up or down.
    """
    rooms = np.full(half.size, np.inf)
    for k in np.flatnonzero(np.diag(ways) > 0.0):
        way = sign * half[k] * ways[:, k] / ways[k, k]
        way[k] = 0.0
        rooms[k] = half[k] * stretch(run.problem, run.theta, way)
    return rooms


def determined(whole: Vector, bounds: Vector, wider: Vector) -> NDArray[np.bool_]:
    """Which parameters the data determine, to `KNOWN` of their span.

    Either the smaller part of their variance comes from directions that the data leave open, where
    bounds count; or it would still be small if all bounds were `WIDER` times as wide. Data that say
    as much of a neighbour as its bounds do say something, and a parameter that hardly depends on it
    is known; in a valley that data leave open altogether, nothing would be known of either.

    Args:
        whole: variance of each parameter, in spans squared.
        bounds: the part of it that comes from open directions.
        wider: this part with the wider bounds.
    """
    there = whole - bounds + wider
    return np.asarray(
        (whole < KNOWN**2) & ((bounds < 0.5 * whole) | (there < KNOWN**2)), dtype=np.bool_
    )


def _signed(vector: Vector) -> Vector:
    return np.asarray(vector * np.sign(vector[np.argmax(np.abs(vector))]), dtype=np.float64)


def channel_rms(problem: Problem, residuals: Iterable[tuple[str, Vector]]) -> dict[str, float]:
    """Root mean square of the residuals over sigma, by channel."""
    stacked = np.concatenate([values for _, values in residuals])
    with np.errstate(invalid="ignore"):
        means = np.sqrt(np.nanmean(stacked**2, axis=0))
    return dict(zip((c.name for c in problem.channels), means.tolist(), strict=True))
