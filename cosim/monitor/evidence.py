"""What the logs say of each direction, as sums: all that detection needs of millions of samples.

    r = J d + S a + e        residual of a log over the noise, e white

J holds the declared parameters, S the effects. Per log, `g = (J S)^T r` and `M = (J S)^T (J S)`.
Values that concern one run only (start values) are projected out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..calibrate.normal import BOUNDS
from ..diagnose.linear import ABSORBED
from .patterns import Patterns
from .profiles import MEDIAN
from .series import Series

Vector = NDArray[np.float64]

CUT = 3.0
"""Deviations beyond which differences of successive logs are cut: one in 400 by chance."""


@dataclass(frozen=True)
class Moments:
    """Sums per log.

    Attributes:
        g: (logs, columns).
        matrix: (logs, columns, columns).
        declared: columns that belong to declared parameters, the first ones.
    """

    g: Vector
    matrix: Vector
    declared: int

    def without(self, columns: Sequence[int], amounts: Vector) -> Moments:
        """The same with changes taken off.

        Args:
            columns: of the changes.
            amounts: (columns, logs).
        """
        if not columns:
            return self
        taken = np.einsum("kn,nmk->nm", amounts, self.matrix[:, :, list(columns)])
        return Moments(self.g - taken, self.matrix, self.declared)

    def own(self) -> tuple[Vector, Vector]:
        """Per log the value of each column and its deviation, declared parameters fitted beside.

        NaN where calibration absorbs a column.
        """
        p = self.declared
        normal = self.matrix[:, :p, :p] + BOUNDS * np.eye(p)
        inverse = np.linalg.inv(normal)
        fitted = np.einsum("nij,nj->ni", inverse, self.g[:, :p])
        share = np.einsum("nij,njm->nim", inverse, self.matrix[:, :p, :])
        rest = self.g - np.einsum("npm,np->nm", share, self.g[:, :p])
        diagonal = np.einsum("nmm->nm", self.matrix)
        left = diagonal - np.einsum("npm,npm->nm", share, self.matrix[:, :p, :])
        seen = left > ABSORBED * np.maximum(diagonal, 1e-300)
        safe = np.where(seen, left, 1.0)
        values = np.where(seen, rest / safe, np.nan)
        deviations = np.where(seen, 1.0 / np.sqrt(safe), np.nan)
        values[:, :p] = fitted
        deviations[:, :p] = np.sqrt(np.einsum("nii->ni", inverse))
        return values, deviations

    def scatter(self) -> Vector:
        """Square root of the covariance of declared parameters between logs.

        From differences of successive logs, few of which a jump is in, and a creep in none; those
        that stand out are cut.
        """
        p = self.declared
        inverse = np.linalg.inv(self.matrix[:, :p, :p] + BOUNDS * np.eye(p))
        fitted = np.einsum("nij,nj->ni", inverse, self.g[:, :p])
        steps = np.diff(fitted, axis=0)
        most = CUT * MEDIAN * np.median(np.abs(steps), axis=0)
        steps = np.clip(steps, -most, most)
        whole = 0.5 * steps.T @ steps / max(len(steps), 1)
        values, vectors = np.linalg.eigh(whole - inverse.mean(axis=0))
        return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))

    def weighted(self, root: Vector) -> tuple[Vector, Vector]:
        """Sums with residuals weighted by noise and scatter between logs.

        Args:
            root: of `scatter`.
        """
        p = self.declared
        part = self.matrix[:, :p, :]
        inner = np.einsum("ij,njm->nim", root.T, part)
        middle = np.linalg.inv(np.eye(p) + np.einsum("nij,jk->nik", inner[:, :, :p], root))
        pulled = np.einsum("ij,nj->ni", root.T, self.g[:, :p])
        z = self.g - np.einsum("nim,nij,nj->nm", inner, middle, pulled)
        weight = self.matrix - np.einsum("nim,nij,njk->nmk", inner, middle, inner, optimize=True)
        return z, weight


class Evidence:
    """The residuals of a series around its first logs.

    Args:
        series: the logs.
        patterns: what everything does.
    """

    def __init__(self, series: Series, patterns: Patterns) -> None:
        self.series, self.patterns = series, patterns
        self.channels = len(series.problem.channels)
        self._rest: dict[str, Vector] = {}
        self._good: dict[str, NDArray[np.bool_] | None] = {}
        self._basis: dict[str, Vector] = {}
        sigma = series.problem.sigma
        for log in series.logs:
            for name in log.runs:
                run = series.problem.run(name)
                rest = (run.data / sigma - patterns.model[patterns.keys[name]]).ravel()
                good = np.isfinite(rest)
                self._good[name] = None if good.all() else good
                self._rest[name] = np.where(good, rest, 0.0)
        for key, own in patterns.own.items():
            left, sizes, _ = np.linalg.svd(own, full_matrices=False)
            self._basis[key] = left[:, sizes > 1.0]  # less than the noise takes nothing

    def moments(self) -> Moments:
        """Sums of all logs."""
        patterns = self.patterns
        width = patterns.width
        count = len(self.series.logs)
        g, matrix = np.zeros((count, width)), np.zeros((count, width, width))
        whole: dict[str, tuple[Vector, Vector]] = {}
        for place, log in enumerate(self.series.logs):
            for name in log.runs:
                key, good = self.patterns.keys[name], self._good[name]
                if good is None and key in whole:
                    columns, square = whole[key]
                else:
                    columns = patterns.values[key]
                    basis = self._basis[key]
                    if good is not None:
                        columns, basis = columns[good], np.linalg.qr(basis[good])[0]
                    columns = columns - basis @ (basis.T @ columns)
                    square = columns.T @ columns
                    if good is None:
                        whole[key] = columns, square
                rest = self._rest[name] if good is None else self._rest[name][good]
                g[place] += columns.T @ rest
                matrix[place] += square
        return Moments(g, matrix, self.patterns.declared)

    def left(self, columns: Sequence[int], amounts: Vector, fitted: Vector) -> Vector:
        """Mean square of what is left by log and channel; NaN where nothing was measured.

        Args:
            columns: of changes that are taken off.
            amounts: (columns, logs) of them.
            fitted: (logs, declared) deviations of declared parameters that are taken off.
        """
        found = np.full((len(self.series.logs), self.channels), np.nan)
        p = self.patterns.declared
        for place, log in enumerate(self.series.logs):
            total, count = np.zeros(self.channels), np.zeros(self.channels)
            for name in log.runs:
                key, good = self.patterns.keys[name], self._good[name]
                values, basis = self.patterns.values[key], self._basis[key]
                rest = self._rest[name] - values[:, :p] @ fitted[place]
                if columns:
                    rest = rest - values[:, list(columns)] @ amounts[:, place]
                if good is None:
                    rest = rest - basis @ (basis.T @ rest)
                else:
                    basis = np.linalg.qr(basis[good])[0]
                    rest = np.where(good, rest, 0.0)
                    rest[good] -= basis @ (basis.T @ rest[good])
                square = rest.reshape(-1, self.channels) ** 2
                total += square.sum(axis=0)
                count += (
                    len(square) if good is None else good.reshape(-1, self.channels).sum(axis=0)
                )
            known = count > 0
            found[place, known] = total[known] / count[known]
        return found

    def largest(self, columns: Sequence[int], amounts: Vector, declared: Vector) -> float:
        """Largest RMS over the noise, in a channel of an excitation, of a sum of patterns.

        Args:
            columns: of it.
            amounts: of these.
            declared: amounts of declared parameters.
        """
        p = self.patterns.declared
        return max(
            float(np.sqrt(np.max(np.mean(
                (v[:, list(columns)] @ amounts + v[:, :p] @ declared)
                .reshape(-1, self.channels) ** 2, axis=0
            ))))
            for v in self.patterns.values.values()
        )  # fmt: skip
