"""Residuals and signatures of all runs as vectors, and the tests on them.

A signature is what an effect adds to the model values over sigma. Everything is made orthogonal to
what calibration can absorb, so a score only counts what declared parameters cannot explain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtr

from ..calibrate.loss import WINDOW, concentrated, trust
from ..calibrate.normal import block_length
from ..calibrate.parts import MeasuredRun, Sensitivity
from ..calibrate.problem import Problem
from ..errors import CosimError

Vector = NDArray[np.float64]
ABSORBED = 1e-3
"""A signature of whose energy less than this share is left may have no direction of its own: what
calibration can do is known to a hundredth, from differences over steps that bend."""

BAND = float(ndtri(0.975))
"""Standard deviations of a 95 % interval."""
MATERIAL = 0.15
"""Least RMS over noise that an effect must add to a channel of a run. It raises the residual by
1 %: sheets do not give the noise more exactly, nor do solvers agree better, so a smaller difference
has no name however many samples make it significant."""


class SampleStack:
    """Samples of runs stacked in one vector, and where each of them lies.

    Args:
        problem: whose channels.
        runs: in order.
    """

    def __init__(self, problem: Problem, runs: Sequence[MeasuredRun]) -> None:
        block = block_length([run.times for run in runs])
        self.problem, self.runs = problem, tuple(runs)
        self.names = [run.name for run in runs]
        self.good = [np.isfinite(run.data).ravel() for run in runs]
        self.channels = len(problem.channels)
        blocks, first = [], 0
        for run, good in zip(runs, self.good, strict=True):
            index = ((run.times - run.times[0]) / block).astype(np.intp) + first
            blocks.append(np.repeat(index, self.channels)[good])
            first = int(index[-1]) + 1
        self.block = np.concatenate(blocks)
        self.blocks = first
        self.channel = np.concatenate(
            [np.tile(np.arange(self.channels), run.times.size)[g]
             for run, g in zip(runs, self.good, strict=True)]
        )  # fmt: skip
        self.run = np.concatenate([np.full(int(g.sum()), i) for i, g in enumerate(self.good)])
        self.size = int(self.block.size)
        windows, first = [], 0
        for good in self.good:
            measured = good.reshape(-1, self.channels)
            index = (np.cumsum(measured, axis=0) - 1) // WINDOW
            each = int(index.max(initial=0)) + 1
            index += first + each * np.arange(self.channels)
            windows.append(index.ravel()[good])
            first += each * self.channels
        self.window = np.concatenate(windows)
        self._samples = np.maximum(np.bincount(self.window, minlength=first), 1)
        self._cell = self.run * self.channels + self.channel
        self._count = np.maximum(np.bincount(self._cell), 1)

    def vector(self, rows: Sequence[Vector]) -> Vector:
        """One vector of (samples, channels) arrays, one per run."""
        return np.concatenate([r.ravel()[g] for r, g in zip(rows, self.good, strict=True)])

    def matrix(self, sensitivities: Sequence[Sensitivity], scale: Vector) -> Vector:
        """Columns of derivatives in units of `scale`; columns of other runs are 0."""
        matrix = np.zeros((self.size, scale.size))
        place = 0
        for item, good in zip(sensitivities, self.good, strict=True):
            count = int(good.sum())
            values = item.values.reshape(-1, item.columns.size)[good]
            matrix[place : place + count, item.columns] = (
                np.nan_to_num(values) * scale[item.columns]
            )
            place += count
        return matrix

    def sums(self, values: Vector) -> Vector:
        """Sum over each block."""
        return np.asarray(np.bincount(self.block, values, self.blocks), dtype=np.float64)

    def mean_squares(self, vector: Vector) -> Vector:
        """Mean square of each sample's window (see `loss`)."""
        sums = np.bincount(self.window, vector**2, self._samples.size)
        return np.asarray((sums / self._samples)[self.window])

    @property
    def unstable(self) -> bool:
        """See `Problem.unstable`."""
        return self.problem.unstable

    def cost(self, residual: Vector) -> float:
        """Half the sum of squares; as in `loss.Windowed` where runs may turn unstable."""
        if not self.unstable:
            return 0.5 * float(residual @ residual)
        return float(np.sum(concentrated(self.mean_squares(residual))))

    def root(self, *residuals: Vector) -> Vector:
        """Factors that make squares of residuals count as `cost` does, by the largest of some."""
        if not self.unstable:
            return np.ones_like(residuals[0])
        size = np.max([self.mean_squares(residual) for residual in residuals], axis=0)
        return np.sqrt(trust(size))

    def largest(self, change: Vector) -> float:
        """Largest RMS of a change of the model values in a channel of a run."""
        squares = np.bincount(self._cell, change**2, self._count.size)
        return float(np.sqrt(np.max(squares / self._count, initial=0.0)))

    def by_run(self, vector: Vector) -> list[Vector]:
        """Back to (samples, channels) arrays, NaN in gaps."""
        rows, place = [], 0
        for run, good in zip(self.runs, self.good, strict=True):
            full = np.full(good.size, np.nan)
            count = int(good.sum())
            full[good] = vector[place : place + count]
            rows.append(full.reshape(run.times.size, -1))
            place += count
        return rows


class Absorber:
    """Projection onto what the parameters of a model can do.

    Args:
        jacobian: columns in units of the parameters' scales.
        problem: gives priors and scales.
        held: parameters that absorb nothing: a fit that ended at a bound wants to go beyond it.
    """

    def __init__(self, jacobian: Vector, problem: Problem, held: Sequence[str] = ()) -> None:
        rows = [
            np.eye(len(problem.parameters))[i] * problem.scale[i] / p.prior
            for i, p in enumerate(problem.parameters)
            if p.prior
        ]
        jacobian = jacobian * ~np.isin(problem.names, held)
        extra = np.array(rows).reshape(-1, jacobian.shape[1])
        values, vectors = np.linalg.eigh(jacobian.T @ jacobian + extra.T @ extra)
        # a direction along which the whole span changes less than the noise absorbs nothing
        keep = values > 1.0
        self._back = vectors[:, keep] / np.sqrt(values[keep])
        # float32: rounding is 1e-7 of a vector, and less than `ABSORBED` of it is not judged
        self._basis = (jacobian @ self._back).astype(np.float32)

    def change(self, vector: Vector) -> Vector:
        """Scaled parameter change that explains a vector best."""
        return np.asarray(self._back @ self._share(vector))

    def rest(self, vector: Vector) -> Vector:
        """What is left of a vector."""
        share = self._share(vector).astype(np.float32)
        return np.asarray(vector - _product(self._basis, share), dtype=np.float64)

    def _share(self, vector: Vector) -> Vector:
        size = float(np.max(np.abs(vector), initial=0.0)) or 1.0  # squares must fit float32
        share = _product((vector / size).astype(np.float32), self._basis)
        with np.errstate(over="ignore", invalid="ignore"):  # asked next
            return _finite(share * np.float32(size)).astype(np.float64)


def _finite(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Values, which must be finite."""
    if not np.all(np.isfinite(values)):
        raise CosimError("values of a model, or their derivatives, are not finite")
    return values


def _product(first: NDArray[np.float32], second: NDArray[np.float32]) -> NDArray[np.float32]:
    """Product of arrays, which must be finite.

    Flags of the processor are not asked: kernels of BLAS may compute with what lies beyond an array
    and leave it out of the result (numpy issue 24067), which warns of nothing, now and then.
    """
    with np.errstate(invalid="ignore"):
        return _finite(np.asarray(first @ second))


@dataclass(frozen=True)
class ScoreTest:
    """How well one direction explains a vector of residuals.

    Attributes:
        amplitude: best factor.
        gain: log likelihood gained [nats], white noise of known size.
        z: robust test statistic: residuals may be correlated within blocks.
        p_value: two-sided.
        size: norm of the direction: its signal to noise ratio at amplitude 1.
        spread: standard deviation of the amplitude over that of white residuals.
    """

    amplitude: float
    gain: float
    z: float
    p_value: float
    size: float
    spread: float
    degrees: int = 1


def score(direction: Vector, residual: Vector, stack: SampleStack, freedom: int) -> ScoreTest:
    """Test a direction, both vectors orthogonal to what calibration absorbs.

    The variance is that of the block sums of what is left with the direction in the model, never
    below that of white residuals: few blocks may seem to agree by chance.

    Args:
        direction, residual: see above.
        stack: gives the blocks.
        freedom: parameters already fitted.
    """
    square = float(direction @ direction)
    if square <= 0.0:
        return ScoreTest(0.0, 0.0, 0.0, 1.0, 0.0, 1.0)
    amplitude = float(direction @ residual) / square
    rest = residual - amplitude * direction
    sums = stack.sums(direction * rest)
    active = max(int(np.count_nonzero(stack.sums(direction**2) > 1e-6 * square)), 2)
    # parameters of single runs take little from the blocks of the others
    degrees = max(stack.blocks - freedom, stack.blocks // 4, 1)
    robust = float(sums @ sums) * stack.blocks / degrees
    spread = float(np.sqrt(max(robust / square, 1.0)))
    z = amplitude * np.sqrt(square) / spread
    free = max(min(degrees, active * 4), 1)
    p_value = float(2.0 * stdtr(free, -abs(z)))
    gain, size = 0.5 * amplitude**2 * square, float(np.sqrt(square))
    return ScoreTest(amplitude, gain, z, p_value, size, spread, free)


def holm(p_values: Sequence[float], tests: int = 0) -> Vector:
    """P values corrected for the number of tests (family-wise, any dependence).

    Args:
        p_values: the smallest ones.
        tests: number of all tests, if more.
    """
    values = np.asarray(p_values, dtype=np.float64)
    order = np.argsort(values)
    scaled = values[order] * (max(tests, values.size) - np.arange(values.size))
    corrected = np.empty_like(values)
    corrected[order] = np.minimum(np.maximum.accumulate(scaled), 1.0)
    return corrected
