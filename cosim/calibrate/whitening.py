"""Makes residuals white that noise of logged inputs has coloured (`input_noise`).

Residuals have the covariance C = 1 + A A' of white noise and a few directions. With A = U S V',

    C^(-1/2) = 1 - U (1 - (1 + S^2)^(-1/2)) U'

The simulator hands out residuals and derivatives multiplied by it, so fits, scores and tests all
count what is white and of size 1.

Source: the inverse of a matrix plus a few directions is Woodbury's; textbook.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
LEAST = 0.1
"""Variance over the noise's along a direction below which it is not counted: 5 % of sigma."""


@dataclass(frozen=True, eq=False)
class InputNoise:
    """Directions of the residuals of a run along which noise of its inputs adds to them.

    Attributes:
        basis: (samples, channels, directions) of unit length, 0 where nothing was measured.
        variances: along them, over the noise's.
        weights: of the samples, (samples, channels): less than 1 where directions leave something.
    """

    basis: NDArray[np.float32]
    variances: Vector
    weights: NDArray[np.float32]
    _known: dict[int, tuple[NDArray[np.float32], NDArray[np.float32]]] = field(
        default_factory=dict, repr=False
    )

    @classmethod
    def of(cls, factors: Vector, weights: Vector) -> InputNoise | None:
        """Of the columns of A; None if they matter nowhere.

        Args:
            factors: (samples, channels, columns).
            weights: of the samples.
        """
        # in float32 squares of the largest direction would hide the smallest
        matrix = factors.reshape(-1, factors.shape[2])
        values, vectors = np.linalg.eigh(matrix.T @ matrix)
        kept = values > LEAST
        if not np.any(kept):
            return None
        basis = (matrix @ (vectors[:, kept] / np.sqrt(values[kept]))).astype(np.float32)
        return cls(basis.reshape(*factors.shape[:2], -1), values[kept], weights.astype(np.float32))

    def white(self, rows: Vector) -> Vector:
        """C^(-1/2) times residuals or derivatives; gaps stay.

        Args:
            rows: (samples, channels) or (samples, channels, columns); of fewer samples where a run
                was cut. Channels beyond those that noise was propagated to stay as they are.
        """
        count = self.basis.shape[1]
        if rows.shape[1] > count:  # channels that are only looked at come after the measured ones
            return np.concatenate([self.white(rows[:, :count]), rows[:, count:]], axis=1)
        basis, part = self._begun(rows.shape[0])
        weights = self.weights[: rows.shape[0]]
        even = rows * (weights if rows.ndim == 2 else weights[:, :, None])
        flat = np.nan_to_num(even).reshape(basis.shape[0], -1)
        # squares must fit float32, whose rounding is 1e-7 of the largest value
        size = float(np.max(np.abs(flat), initial=0.0)) or 1.0
        single = (flat / size).astype(np.float32)
        taken = basis @ (part[:, None] * (basis.T @ single))
        return np.asarray(even - size * taken.reshape(rows.shape), dtype=np.float64)

    def _begun(self, size: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Directions of the first samples, and what is taken off along each."""
        if size not in self._known:
            whole: InputNoise | None = self
            if size < self.basis.shape[0]:
                factors = self.basis[:size] * np.sqrt(self.variances)
                whole = InputNoise.of(
                    factors.astype(np.float64), self.weights[:size].astype(np.float64)
                )
            if whole is None:
                self._known[size] = (
                    np.zeros((size * self.basis.shape[1], 0), np.float32),
                    np.zeros(0, np.float32),
                )
            else:
                part = 1.0 - 1.0 / np.sqrt(1.0 + whole.variances)
                flat = whole.basis.reshape(-1, part.size)
                self._known[size] = flat, part.astype(np.float32)
        return self._known[size]
