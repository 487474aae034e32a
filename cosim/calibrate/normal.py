"""Normal equations of weighted residuals, and when they determine a parameter."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from .loss import Loss, Squares
from .parts import Sensitivity
from .problem import Problem

Vector = NDArray[np.float64]
SQUARES = Squares()
BLOCK = 1.0
"""Length of the blocks over which residuals may be correlated [s]."""
BLOCKS = 40
"""Blocks needed to estimate a variance from them: its own error is then a quarter."""
KNOWN = 0.25
"""A combination is identifiable if its standard deviation is below this fraction of the span."""
BOUNDS = 12.0
"""Information of the bounds: 1 / variance of a value anywhere between them, in spans."""
WIDER = 100.0
"""What needs bounds is asked with bounds that are so many times as wide."""
DISTRUST = 4.0
"""Multiple of the disagreement of both sides that is taken off the information of a run."""


class Normal:
    """Normal equations in scaled parameters, gathered run by run.

    Where the model jumps (an integrator that stops a tick earlier), differences over a small step
    are noise that looks like information. What the derivatives on both sides do not agree on is
    taken off the run's matrix, and the run's gradient is reduced with it.

    Attributes:
        matrix, gradient: J^T J and J^T r, with priors.
        scores: J^T r of each block (rows), for the sandwich.
        rough: runs that jump.
        claimed: the matrix with all that the derivatives say.
    """

    def __init__(
        self,
        problem: Problem,
        theta: Vector,
        sensitivities: Iterable[Sensitivity],
        residuals: Iterable[tuple[str, Vector]],
        loss: Loss = SQUARES,
    ) -> None:
        size, scale = theta.size, problem.scale
        self.matrix, self.gradient = np.zeros((size, size)), np.zeros(size)
        self.claimed = np.zeros((size, size))
        self.rough: list[str] = []
        scores = []
        residuals = list(residuals)
        block = block_length([problem.run(name).times for name, _ in residuals])
        for item, (name, residual) in zip(sensitivities, residuals, strict=True):
            run = problem.run(name)
            columns = item.columns
            derivative = item.values * scale[columns]
            good = np.isfinite(residual) & np.isfinite(derivative).all(axis=2)
            errors = np.where(good, residual, 0.0)
            factor = np.where(good, loss.weight(residual), 0.0)
            derivative[~good] = 0.0
            flat = derivative.reshape(-1, columns.size)
            matrix = (flat * factor.reshape(-1, 1)).T @ flat
            reliable, share = matrix, None
            if item.roughness is not None:
                bend = item.roughness * scale[columns]
                bend[~good] = 0.0
                bend = bend.reshape(-1, columns.size)
                reliable, share = _reliable(matrix, (bend * factor.reshape(-1, 1)).T @ bend)
            if share is not None:
                self.rough += [name] * bool(np.trace(reliable) < 0.99 * np.trace(matrix))
            self.matrix[np.ix_(columns, columns)] += reliable
            self.claimed[np.ix_(columns, columns)] += matrix
            per_sample = np.einsum("tcp,tc->tp", derivative, factor * errors)
            index = ((run.times - run.times[0]) / block).astype(np.intp)
            sums = np.zeros((int(index[-1]) + 1, size))
            for place, column in enumerate(columns):
                sums[:, column] = np.bincount(index, per_sample[:, place], sums.shape[0])
            if share is not None:
                sums[:, columns] = sums[:, columns] @ share.T
            scores.append(sums)
            self.gradient += sums.sum(axis=0)
        self.scores = np.concatenate(scores) if scores else np.zeros((0, size))
        for i, p in enumerate(problem.parameters):
            if p.prior:
                ratio = scale[i] / p.prior
                self.matrix[i, i] += ratio**2
                self.claimed[i, i] += ratio**2
                self.gradient[i] -= ratio * (theta[i] - p.nominal) / p.prior

    @property
    def left(self) -> float:
        """The least share that is left of the information claimed on a direction that is known."""
        values, vectors = np.linalg.eigh(self.claimed)
        known = values > 1.0 / KNOWN**2
        ways = vectors[:, known] / np.sqrt(values[known])
        return float(np.min(np.linalg.eigvalsh(ways.T @ self.matrix @ ways), initial=1.0))


def block_length(times: Sequence[Vector]) -> float:
    """Length of blocks for runs at these times [s], shorter where there would be too few."""
    return min(BLOCK, sum(float(each[-1] - each[0]) for each in times) / BLOCKS)


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
    loss: Loss = SQUARES,
) -> Vector:
    """J^T r in scaled parameters, with priors."""
    result = np.zeros(theta.size)
    scale = problem.scale
    for item, (_, residual) in zip(sensitivities, residuals, strict=True):
        good = np.isfinite(residual) & np.isfinite(item.values).all(axis=2)
        errors = np.where(good, residual * loss.weight(residual), 0.0)
        values = np.where(good[:, :, None], item.values, 0.0)
        result[item.columns] += np.einsum("tcp,tc->p", values, errors) * scale[item.columns]
    for i, p in enumerate(problem.parameters):
        if p.prior:
            result[i] -= scale[i] / p.prior * (theta[i] - p.nominal) / p.prior
    return result


def cost_of(
    problem: Problem,
    theta: Vector,
    residuals: Iterable[tuple[str, Vector]],
    loss: Loss = SQUARES,
) -> float:
    """Cost of the residuals and of leaving the priors."""
    total = sum(loss.cost(residual) for _, residual in residuals)
    for value, p in zip(theta.tolist(), problem.parameters, strict=True):
        if p.prior:
            total += 0.5 * ((value - p.nominal) / p.prior) ** 2
    return total


def drawn(problem: Problem) -> NDArray[np.bool_]:
    """Parameters that the sheet's bounds draw towards their nominal values."""
    return np.array([p.role == "declared" and not p.prior for p in problem.parameters])
