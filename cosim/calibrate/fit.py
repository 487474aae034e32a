"""Bounded weighted least squares over all identification runs.

Levenberg-Marquardt in parameters scaled by their spans, so that combinations that the runs cannot
tell apart stay where they began. Limits whose integrators stop tick by tick make the cost stepwise:
the Jacobian is taken over wide steps first, and a search along its main directions, which needs no
derivatives, ends the fit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from ..errors import FmuCallError
from .parts import Sensitivity
from .problem import Problem

Vector = NDArray[np.float64]
BLOCK = 1.0
"""Length of the blocks over which residuals may be correlated [s]."""
STEPS = (2e-2, 5e-3, 1e-2)
"""Steps of differences over the span, from the first iterations to the last."""
REUSED = 0.02
"""A Jacobian is used again after a step that lowered the cost by this fraction."""
UNEVEN = 10.0
"""Runs are fitted one half after the other if their mean errors differ by more than this factor."""
BOUNDS = 12.0
"""Information of the bounds: 1 / variance of a value anywhere between them, in spans."""
DISTRUST = 4.0
"""Multiple of the disagreement of both sides that is taken off the information of a run."""
KNOWN = 0.25
"""A combination is identifiable if its standard deviation is below this fraction of the span."""
WEAK = 1e-4
"""Share of the best known direction's information up to which a direction is measured again."""
LONG, SHORT = 0.1, 0.01
"""Spans of the step with which that is done, and the least that the bounds must leave."""
CORRECTIONS = 4
"""Steps at most with the Jacobian of a point that is close."""
CALM = 0.8
"""Share of the information on a direction that runs without jumps give: then derivatives do."""
RENEWALS = 5
"""Jacobians that a fit from close by takes at most."""
PARTS = (1.0, 0.3, 0.1)
"""Shares of a step that are tried."""
SHORTER = 8
"""Times a step is damped by 30 more until it is given up: from Gauss-Newton to steepest descent."""
SETTLED = 0.2
"""Fall of the cost [nats] below which a quick fit ends: far below what is decided on it."""
PURPOSE = "identification"


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


class Normal:
    """Normal equations in scaled parameters, gathered run by run.

    Where the model jumps (an integrator that stops a tick earlier), differences over a small step
    are noise that looks like information. What the derivatives on both sides do not agree on is
    taken off the run's matrix, and the run's gradient is reduced with it.

    Attributes:
        matrix, gradient: J^T J and J^T r, with priors.
        scores: J^T r of each block (rows), for the sandwich.
        rough: runs that jump.
        calm: the matrix of the others.
    """

    def __init__(
        self,
        problem: Problem,
        theta: Vector,
        sensitivities: Iterable[Sensitivity],
        residuals: Iterable[tuple[str, Vector]],
        weight: Callable[[Vector], Vector] | None = None,
        block: float = BLOCK,
    ) -> None:
        size, scale = theta.size, problem.scale
        self.matrix, self.gradient = np.zeros((size, size)), np.zeros(size)
        self.rough: list[str] = []
        calm = np.zeros((size, size))
        scores = []
        for item, (name, residual) in zip(sensitivities, residuals, strict=True):
            run = problem.run(name)
            columns = item.columns
            derivative = item.values * scale[columns]
            good = np.isfinite(residual) & np.isfinite(derivative).all(axis=2)
            errors = np.where(good, residual, 0.0)
            factor = np.where(good, 1.0 if weight is None else weight(errors), 0.0)
            derivative = np.where(good[:, :, None], derivative, 0.0)
            flat = derivative.reshape(-1, columns.size)
            matrix = (flat * factor.reshape(-1, 1)).T @ flat
            bend = np.where(good[:, :, None], item.roughness * scale[columns], 0.0)
            bend = bend.reshape(-1, columns.size)
            reliable, share = _reliable(matrix, (bend * factor.reshape(-1, 1)).T @ bend)
            if share is not None:
                self.rough += [name] * bool(np.trace(reliable) < 0.99 * np.trace(matrix))
            if name not in self.rough:
                calm[np.ix_(columns, columns)] += matrix
            self.matrix[np.ix_(columns, columns)] += reliable
            per_sample = np.einsum("tcp,tc->tp", derivative, factor * errors)
            index = ((run.times - run.times[0]) / block).astype(np.intp)
            sums = np.zeros((int(index[-1]) + 1, size))
            for place, column in enumerate(columns):
                sums[:, column] = np.bincount(index, per_sample[:, place], sums.shape[0])
            if share is not None:
                sums[:, columns] = sums[:, columns] @ share.T
            scores.append(sums)
            self.gradient += sums.sum(axis=0)
        self.calm = calm
        self.scores = np.concatenate(scores) if scores else np.zeros((0, size))
        for i, p in enumerate(problem.parameters):
            if p.prior:
                ratio = scale[i] / p.prior
                self.matrix[i, i] += ratio**2
                self.gradient[i] -= ratio * (theta[i] - p.nominal) / p.prior


def _reliable(matrix: Vector, bend: Vector) -> tuple[Vector, Vector | None]:
    """The part of J^T J that both sides agree on, and the factor on J^T r (None for all of it)."""
    if not np.any(bend):
        return matrix, None
    values, vectors = np.linalg.eigh(matrix - DISTRUST * bend)
    kept = (vectors * np.maximum(values, 0.0)) @ vectors.T
    whole, directions = np.linalg.eigh(matrix)
    small = whole <= 1e-12 * max(whole[-1], 1e-300)
    inverse = (directions / np.where(small, np.inf, whole)) @ directions.T
    return kept, kept @ inverse


def gradient(
    problem: Problem,
    theta: Vector,
    sensitivities: Iterable[Sensitivity],
    residuals: Iterable[tuple[str, Vector]],
    weight: Callable[[Vector], Vector] | None = None,
) -> Vector:
    """J^T r in scaled parameters, with priors."""
    result = np.zeros(theta.size)
    scale = problem.scale
    for item, (_, residual) in zip(sensitivities, residuals, strict=True):
        good = np.isfinite(residual) & np.isfinite(item.values).all(axis=2)
        errors = np.where(good, residual, 0.0)
        if weight is not None:
            errors = errors * weight(errors)
        values = np.where(good[:, :, None], item.values, 0.0)
        result[item.columns] += np.einsum("tcp,tc->p", values, errors) * scale[item.columns]
    for i, p in enumerate(problem.parameters):
        if p.prior:
            result[i] -= scale[i] / p.prior * (theta[i] - p.nominal) / p.prior
    return result


def cost_of(
    problem: Problem, theta: Vector, residuals: Iterable[tuple[str, Vector]], cap: float = math.inf
) -> float:
    """Half the sum of squares; residuals beyond `cap` sigma count linearly (Huber)."""
    total = 0.0
    for _, residual in residuals:
        size = np.abs(residual[np.isfinite(residual)])
        total += float(
            np.sum(np.where(size <= cap, 0.5 * size**2, cap * size - 0.5 * cap**2))
            if math.isfinite(cap)
            else 0.5 * np.sum(size**2)
        )
    for value, p in zip(theta.tolist(), problem.parameters, strict=True):
        if p.prior:
            total += 0.5 * ((value - p.nominal) / p.prior) ** 2
    return total


def _drawn(problem: Problem) -> NDArray[np.bool_]:
    """Parameters that the sheet's bounds draw towards their nominal values."""
    return np.array([p.role == "declared" and not p.prior for p in problem.parameters])


class Known:
    """Derivatives of another fit, to be used again for a model with some parameters more or less.

    Args:
        estimate: that fit.
    """

    def __init__(self, estimate: Estimate) -> None:
        names = estimate.problem.names
        self.runs = {item.run: item for item in estimate.jacobian}
        self.place = {
            name: {names[i]: k for k, i in enumerate(item.columns.tolist())}
            for name, item in self.runs.items()
        }

    def extended(
        self, problem: Problem, theta: Vector, purpose: str | Iterable[str]
    ) -> list[Sensitivity]:
        """Derivatives for all parameters of a problem, the unknown ones taken at theta."""
        runs = problem.chosen(purpose)
        names = problem.names
        new = [
            i
            for i, name in enumerate(names)
            if any(
                i in problem.columns(run.name) and name not in self.place.get(run.name, {})
                for run in runs
            )
        ]
        fresh = {
            item.run: item
            for item in problem.jacobian(
                theta, [r.name for r in runs], columns=new, central=False, relative=STEPS[1]
            )
        } if new else {}  # fmt: skip
        found = []
        for run in runs:
            columns = problem.columns(run.name)
            values = np.empty((*run.data.shape, columns.size))
            rough = np.zeros_like(values)
            for k, i in enumerate(columns.tolist()):
                if names[i] in self.place.get(run.name, {}):
                    old, at = self.runs[run.name], self.place[run.name][names[i]]
                    values[:, :, k] = old.values[:, :, at]
                    rough[:, :, k] = old.roughness[:, :, at]
                else:
                    item = fresh[run.name]
                    at = item.columns.tolist().index(i)
                    values[:, :, k] = item.values[:, :, at]
            found.append(Sensitivity(run.name, columns, values, rough))
        return found


class _Fit:
    def __init__(
        self,
        problem: Problem,
        purpose: str | Iterable[str],
        theta: Vector,
        begun: int | None = None,
    ) -> None:
        self.problem = problem
        self.purpose = purpose if isinstance(purpose, str) else list(purpose)
        self.theta = np.clip(theta, problem.lower, problem.upper)
        self.cap = math.inf
        self.iterations = 0
        self.begun = problem.evaluations if begun is None else begun
        self.drawn = _drawn(problem)
        self.residuals = problem.residuals(self.theta, self.purpose)
        self.cost = self.total(self.theta, self.residuals)

    def total(self, theta: Vector, residuals: list[tuple[str, Vector]]) -> float:
        """Cost with the bounds as a weak prior, which decides where the data are silent."""
        p = self.problem
        away = ((theta - p.nominal) / p.scale)[self.drawn]
        return cost_of(p, theta, residuals, self.cap) + 0.5 * BOUNDS * float(away @ away)

    def set_cap(self, cap: float) -> None:
        self.cap = cap
        self.cost = self.total(self.theta, self.residuals)

    def weight(self, errors: Vector) -> Vector:
        return np.minimum(1.0, self.cap / np.maximum(np.abs(errors), 1e-300))

    def normal(self, relative: float, central: bool) -> Normal:
        self.jacobian = self.problem.jacobian(
            self.theta, self.purpose, central=central, relative=relative
        )
        weight = self.weight if math.isfinite(self.cap) else None
        normal = Normal(self.problem, self.theta, self.jacobian, self.residuals, weight)
        if not normal.rough:
            return normal
        for place, item in enumerate(self.jacobian):
            if item.run in normal.rough:
                part = normal.calm[np.ix_(item.columns, item.columns)]
                self.jacobian[place] = self.problem.directional(
                    self.theta, item.run, np.linalg.eigh(part)[1], relative=relative
                )
        return Normal(self.problem, self.theta, self.jacobian, self.residuals, weight)

    def attempt(self, theta: Vector) -> bool:
        """Go there if it is better."""
        if np.array_equal(theta, self.theta):
            return False
        try:
            residuals = self.problem.residuals(theta, self.purpose)
        except FmuCallError:
            return False
        cost = self.total(theta, residuals)
        if not cost < self.cost:
            return False
        self.theta, self.residuals, self.cost = theta, residuals, cost
        return True

    def step(self, normal: Normal, damping: float) -> Vector:
        """Damped Gauss-Newton step inside the bounds."""
        p = self.problem
        free = np.ones(self.theta.size, dtype=bool)
        change = np.zeros(self.theta.size)
        whole = normal.matrix + np.diag(BOUNDS * self.drawn)
        gradient = normal.gradient - BOUNDS * self.drawn * (self.theta - p.nominal) / p.scale
        for _ in range(self.theta.size):
            matrix = whole[np.ix_(free, free)]
            ridge = damping * np.trace(matrix) / self.theta.size + 1e-9
            change[:] = 0.0
            change[free] = np.linalg.solve(matrix + ridge * np.eye(matrix.shape[0]), gradient[free])
            wanted = self.theta + change * p.scale
            outside = free & (
                ((self.theta <= p.lower) & (wanted < p.lower))
                | ((self.theta >= p.upper) & (wanted > p.upper))
            )
            if not outside.any():
                break
            free &= ~outside
        return np.clip(self.theta + change * p.scale, p.lower, p.upper)

    def descend(self, relative: float, limit: int, tolerance: float) -> None:
        """Levenberg-Marquardt until the cost no longer falls by `tolerance` of it.

        A Jacobian costs as many simulations as there are parameters, a step one; so a Jacobian is
        used again as long as steps with it pay.
        """
        damping = 1e-6
        for _ in range(limit):
            self.iterations += 1
            normal = self.normal(relative, central=False)
            first = self.cost
            for _ in range(8):
                if self.attempt(self.step(normal, damping)):
                    damping = max(damping * 0.1, 1e-12)
                    break
                damping = max(damping, 1e-9) * 10.0
            else:
                return
            before = first
            while before - self.cost > REUSED * before:
                before = self.cost
                normal.gradient = self.gradient()
                if not self.attempt(self.step(normal, damping)):
                    break
            if first - self.cost <= tolerance * max(first, 1.0):
                return

    def follow(self, known: Known, limit: int) -> None:
        """Gauss-Newton with a Jacobian from close by; only what it lacks is differentiated.

        Parameters that were there before hardly change what they do when one is added, so a step
        costs one simulation and one for each new parameter.
        """
        for _ in range(limit):
            self.iterations += 1
            self.jacobian = known.extended(self.problem, self.theta, self.purpose)
            weight = self.weight if math.isfinite(self.cap) else None
            normal = Normal(self.problem, self.theta, self.jacobian, self.residuals, weight)
            before = self.cost
            if self.settle(normal, 1) or self.cost == before:
                return
            if before - self.cost <= max(SETTLED, 1e-4 * before):
                return

    def gradient(self) -> Vector:
        """J^T r with the last Jacobian and the present residuals."""
        weight = self.weight if math.isfinite(self.cap) else None
        return gradient(self.problem, self.theta, self.jacobian, self.residuals, weight)

    def settle(self, normal: Normal, limit: int) -> bool:
        """Damped steps with one Jacobian; whether they came to where it promises no more."""
        damping = 1e-9
        for _ in range(limit):
            whole = self.step(normal, damping)
            if 0.5 * float(normal.gradient @ ((whole - self.theta) / self.problem.scale)) < SETTLED:
                return True
            # a limit or a threshold is passed: the direction is right, but not so far
            if not any(self.attempt(self.theta + part * (whole - self.theta)) for part in PARTS):
                for _ in range(SHORTER):
                    damping = max(damping, 1e-7) * 30.0
                    if self.attempt(self.step(normal, damping)):
                        break
                else:
                    return False
            damping = max(damping * 0.1, 1e-12)
            normal.gradient = self.gradient()
        return False

    def correct(self) -> Normal:
        """Steps with a Jacobian taken here, and with another one as long as they lead far."""
        for _ in range(RENEWALS):
            before = self.cost
            normal = self.normal(STEPS[-1], central=True)
            if self.settle(normal, CORRECTIONS) or before - self.cost < SETTLED:
                break
        return normal

    def polish(self) -> None:
        """Search along the main directions of the normal matrix, without derivatives."""
        p = self.problem
        normal = self.correct()
        if not normal.rough:
            return
        values, vectors = np.linalg.eigh(normal.matrix)
        for value, direction in zip(values[::-1], vectors.T[::-1], strict=True):
            if value < 1.0 / KNOWN**2 or float(direction @ normal.calm @ direction) > CALM * value:
                continue
            size = 1.0 / math.sqrt(value)
            for sign in (1.0, -1.0):
                length = size
                while self.attempt(
                    np.clip(self.theta + sign * length * direction * p.scale, p.lower, p.upper)
                ):
                    length *= 2.0
                if length > size:
                    break


def fit(
    problem: Problem,
    theta: Vector | None = None,
    purpose: str | Iterable[str] = PURPOSE,
    *,
    limit: int = 25,
    polish: bool = True,
    robust: bool = True,
    rough: bool = False,
    near: bool = False,
    known: Known | None = None,
) -> Estimate:
    """Estimate the parameters of a problem.

    Args:
        problem: what to fit.
        theta: where to begin, the nominal values if not given.
        purpose: runs to fit.
        limit: iterations at each size of difference steps.
        polish: end with a search without derivatives.
        robust: begin with large residuals counted linearly; off when `theta` is close.
        rough: end without derivatives at the solution; only the values count.
        near: `theta` is the solution but for small corrections: one Jacobian, and steps with it.
        known: derivatives of a fit with nearly the same parameters, which stand for those at
            `theta`; a quick fit, whose intervals are as good as they are.
    """
    begun = problem.evaluations
    run = _Fit(problem, purpose, problem.nominal if theta is None else theta.astype(np.float64))
    if known is not None:
        run.follow(known, limit)
        return _estimate(run)
    if near:
        run.correct()
        return _estimate(run, confirm=True)
    if robust and _uneven(run):
        run = _Fit(problem, _calmest(run), run.theta)
        sizes = np.concatenate([r[np.isfinite(r)] for _, r in run.residuals])
        typical = float(np.median(np.abs(sizes))) if sizes.size else 1.0
        run.set_cap(max(3.0, typical))
        run.descend(STEPS[0], 3, 0.05)
        run.set_cap(3.0)
        run.descend(STEPS[1], 3, 0.01)
        run = _Fit(problem, purpose, run.theta, begun)
        run.set_cap(3.0)
        run.descend(STEPS[1], 4, 0.01)
        run.set_cap(math.inf)
    run.descend(STEPS[1], limit, 1e-4)
    if polish and not rough:
        run.polish()
    elif not rough:
        run.normal(STEPS[-1], central=True)
    return _estimate(run, confirm=not rough)


def _uneven(run: _Fit) -> bool:
    """Whether some runs are much farther off than others."""
    sizes = [float(np.nanmean(np.minimum(np.abs(r), 1e6))) for _, r in run.residuals]
    return max(sizes) > UNEVEN * max(min(sizes), 1.0)


def _calmest(run: _Fit) -> list[str]:
    """The half of the runs that fit best so far: those without limits and runaway errors."""
    worth = [(float(np.nanmean(np.minimum(np.abs(r), 1e6))), name) for name, r in run.residuals]
    return [name for _, name in sorted(worth)[: max((len(worth) + 1) // 2, 1)]]


def _confirmed(run: _Fit, values: Vector, vectors: Vector) -> Vector:
    """Information on the weak directions, from steps large enough to be seen if they change much.

    Differences over small steps of a model with friction are rounded by the ticks at which it
    sticks, and that looks like information on combinations that change nothing (all torques and
    inertias by the same factor).

    Args:
        run: its residuals are those at theta.
        values, vectors: of the normal matrix.

    Returns:
        one per direction; infinite where none was measured.
    """
    p = run.problem
    common = np.array([not item.run for item in p.parameters])
    found = np.full(values.size, np.inf)
    base = run.residuals
    for i in np.flatnonzero((values >= 1.0 / KNOWN**2) & (values < WEAK * values.max())):
        direction = vectors[:, i]
        if float(np.sum(direction[common] ** 2)) < 0.5:
            continue
        seen = []
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
            drawn = sum(
                (length * way[k] / item.prior) ** 2
                for k, item in enumerate(p.parameters) if item.prior
            )  # fmt: skip
            seen.append((square + drawn) / length**2)
        if seen:
            found[i] = min(seen)
    return found


def _estimate(run: _Fit, *, confirm: bool = False) -> Estimate:
    problem = run.problem
    # the last Jacobian, whose point is less than the steps of its differences away
    normal = Normal(problem, run.theta, run.jacobian, run.residuals)
    count = int(sum(np.isfinite(r).sum() for _, r in run.residuals))
    scale = problem.scale
    values, vectors = np.linalg.eigh(normal.matrix)
    if confirm:
        values = np.minimum(values, _confirmed(run, values, vectors))
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
    spread = max(2.0 * cost / max(count - int(np.sum(~poor)), 1), 1.0)
    # a few blocks can seem to agree by chance: never below what white residuals give
    white, robust = np.diag(inverse) * spread, np.diag(sandwich)
    factor = np.sqrt(np.maximum(white, robust) / np.maximum(robust, 1e-300))
    known = sandwich * np.outer(factor, factor)
    unknown = (vectors[:, poor] * (spread / (values[poor] + BOUNDS))) @ vectors[:, poor].T
    scaled = known + unknown
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
