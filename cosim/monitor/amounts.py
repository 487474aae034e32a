"""By how much directions change, to least squares, beside what is so in all logs.

    minimise  sum_n (1/2 x_n' W_n x_n - x_n' z_n),    x_n = s_n a + k_n c

z_n and W_n are the weighted sums of log n (`Moments.weighted`), s_n a profile and k_n the constants
(`profiles.constants`) of the direction and of all declared parameters, whose fit to the first logs
may have taken up a part of the change. The constants are taken off in the metric of the weights:
logs that are driven otherwise tell a direction with other weights, and a profile less its plain
mean would count the constants, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..diagnose.models import GATE

Vector = NDArray[np.float64]
UNEVEN = 0.1
"""Deviation of a change's amount between logs, as a share: wear does not grow evenly, and laws have
their usual shapes. Without it, a name would be the one that makes up for the time course best."""
HALF = 0.5
"""Share of a change that a rival must do to be compared with it sample by sample."""
RANK = 1e-12
"""Eigenvalue of a normal matrix of unit diagonal below which a direction is rounding."""


@dataclass(frozen=True)
class Amounts:
    """Directions with a profile each, fitted together.

    Attributes:
        values: of each.
        covariance: of these.
        rest: (logs, columns) of z that they and the constants leave.
        gain: log likelihood over that of the model.
    """

    values: Vector
    covariance: Vector
    rest: Vector
    gain: float


@dataclass(frozen=True)
class Sums:
    """Weighted sums of all logs.

    Attributes:
        z: (logs, columns).
        weight: (logs, columns, columns).
        known: (logs, constants).
        declared: columns of declared parameters, the first ones.
    """

    z: Vector
    weight: Vector
    known: Vector
    declared: int

    def _constants(self, columns: Sequence[int]) -> tuple[list[int], Vector]:
        """Columns and rows of the constants beside directions."""
        own = [*range(self.declared), *(c for c in dict.fromkeys(columns) if c >= self.declared)]
        return [c for c in own for _ in self.known.T], np.tile(self.known.T, (len(own), 1))

    def _normal(self, columns: Sequence[int], rows: Vector) -> tuple[Vector, Vector]:
        """Gradient and normal matrix of columns with a row each."""
        block = self.weight[:, columns][:, :, columns]
        normal = np.einsum("kn,ln,nkl->kl", rows, rows, block, optimize=True)
        return np.einsum("kn,nk->k", rows, self.z[:, columns]), normal

    def fitted(self, columns: Sequence[int], shapes: Vector) -> Amounts:
        """Amounts of directions beside their constants.

        Args:
            columns: of each direction.
            shapes: (directions, logs), the profile of each.
        """
        steady, known = self._constants(columns)
        whole, rows = [*columns, *steady], np.vstack([shapes, known])
        gradient, normal = self._normal(whole, rows)
        inverse = _inverse(normal)
        found = inverse @ gradient
        taken = np.einsum("nmk,kn,k->nm", self.weight[:, :, whole], rows, found, optimize=True)
        count = len(columns)
        return Amounts(
            found[:count], inverse[:count, :count], self.z - taken, 0.5 * float(gradient @ found)
        )

    def by_profile(self, columns: Sequence[int], shapes: Vector) -> tuple[Vector, Vector]:
        """One direction with each profile alone.

        Args:
            columns: of the direction.
            shapes: (profiles, logs).

        Returns:
            By profile the log likelihood over that of constants alone; (profiles, columns) amounts.
        """
        columns = list(columns)
        steady, known = self._constants(columns)
        constants, inner = self._normal(steady, known)
        pulled = np.einsum("en,nie->nie", known, self.weight[:, columns][:, :, steady])
        across = np.einsum("an,nie->aie", shapes, pulled, optimize=True)
        share = across @ _inverse(inner)
        gradient = shapes @ self.z[:, columns] - share @ constants
        block = self.weight[:, columns][:, :, columns]
        whole = np.einsum("an,nij->aij", shapes**2, block, optimize=True)
        normal = whole - np.einsum("aie,aje->aij", share, across)
        least = RANK * np.maximum(np.trace(whole, axis1=1, axis2=2), 1e-300)
        regular = normal + least[:, None, None] * np.eye(len(columns))
        amounts = np.linalg.solve(regular, gradient[:, :, None])[:, :, 0]
        return 0.5 * np.einsum("ai,ai->a", gradient, amounts), amounts

    @cached_property
    def _model(self) -> float:
        """Log likelihood of the model with declared parameters that are other in all logs."""
        return self.fitted([], np.zeros((0, len(self.z)))).gain

    def score(self, columns: Sequence[int], shape: Vector) -> float:
        """Log likelihood of a change over that of the model without it: what names differ by.

        Constants of each direction take another share of one and the same change, so only those
        that logs show which the profile leaves alone count for the model. Amounts scatter between
        logs by `UNEVEN`.
        """
        columns = list(columns)
        fitted = self.fitted(columns, np.tile(shape, (len(columns), 1)))
        slope = shape * (fitted.rest[:, columns] @ fitted.values)
        block = self.weight[:, columns][:, :, columns]
        told = shape**2 * np.einsum("i,nij,j->n", fitted.values, block, fitted.values)
        scatter = 0.5 * (slope**2 / (told + UNEVEN**-2) - np.log1p(UNEVEN**2 * told)).sum()
        return float(fitted.gain + scatter) - max(self._model, self._always(columns, shape))

    def _always(self, columns: Sequence[int], shape: Vector) -> float:
        """Log likelihood of a direction that is in all logs, if those before the change show it."""
        calm = (shape == 0.0).astype(np.float64)
        steady, known = self._constants(columns)
        alone, plain = self._constants([])
        found, gains = np.zeros(0), []
        for chosen, rows in ((alone, plain), (steady, known)):
            gradient, normal = self._normal(chosen, rows * calm)
            found = _inverse(normal) @ gradient
            gains.append(0.5 * float(gradient @ found))
        if gains[1] - gains[0] < GATE:
            return -np.inf
        gradient, normal = self._normal(steady, known)
        return float(found @ gradient - 0.5 * found @ normal @ found)

    def nearest(
        self, shape: Vector, columns: Sequence[int], rival: Sequence[int], amounts: Vector
    ) -> Vector | None:  # fmt: skip
        """Amounts of a rival that come nearest to a change; None if that is less than half of it.

        Args:
            shape: profile of the change.
            columns, amounts: of the change.
            rival: its columns.
        """
        both = [*columns, *rival]
        steady, known = self._constants(both)
        whole = [*both, *steady]
        rows = np.vstack([np.tile(shape, (len(both), 1)), known])
        normal = self._normal(whole, rows)[1]
        count, own = len(both), len(columns)
        share = normal[:count, count:] @ _inverse(normal[count:, count:])
        normal = normal[:count, :count] - share @ normal[count:, :count]
        block = normal[own:, own:]
        theirs = np.linalg.pinv(block) @ normal[own:, :own] @ amounts
        whole_change = float(amounts @ normal[:own, :own] @ amounts)
        return theirs if float(theirs @ block @ theirs) >= HALF * whole_change else None


def _inverse(normal: Vector) -> Vector:
    """Inverse of a normal matrix along what its data tell."""
    root = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    unit = np.linalg.pinv(normal / np.outer(root, root), rcond=RANK, hermitian=True)
    return np.asarray(unit / np.outer(root, root))
