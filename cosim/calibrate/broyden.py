"""Derivatives that learn from the steps that are taken with them (Broyden's update).

Where a model jumps, a derivative over a short step claims that something changes along directions
in which nothing does. A step that was taken in such a direction is longer, and has seen it:

    J <- J + (y - J d) d^T / (d^T d),    y = change of the model over the step d

with the parameters over their spans. C. G. Broyden, A class of methods for solving nonlinear
simultaneous equations, Math. Comp. 19 (1965), 577-593.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from .felt import SHORTEST
from .loss import Loss
from .normal import Normal
from .parts import Sensitivity
from .problem import Problem

Vector = NDArray[np.float64]
Residuals = list[tuple[str, Vector]]


class Broyden:
    """Derivatives of a fit, as its own steps see them."""

    def __init__(self, problem: Problem, items: Iterable[Sensitivity], loss: Loss) -> None:
        self._problem, self._loss = problem, loss
        self._items = [
            item._replace(
                values=item.values.copy(),
                roughness=None if item.roughness is None else item.roughness.copy(),
            )
            for item in items
        ]

    def learn(self, step: Vector, before: Residuals, after: Residuals) -> None:
        """Take in what a step changed, if it is as long as those of differences.

        Args:
            step: of the parameters, in their units.
            before, after: residuals where it began and where it ended.
        """
        if np.max(np.abs(step / self._problem.scale)) < SHORTEST:
            return
        errors = [
            one - other - item.values @ step[item.columns]
            for item, (_, one), (_, other) in zip(self._items, before, after, strict=True)
        ]
        for item, error in zip(self._items, errors, strict=True):
            scale, moved = self._problem.scale[item.columns], step[item.columns]
            if not (square := float(np.sum((moved / scale) ** 2))):
                continue
            along = moved / (square * scale**2)
            item.values[...] += error[:, :, None] * along
            if item.roughness is not None:  # a step has one side
                item.roughness[...] -= (item.roughness @ moved)[:, :, None] * along

    def normal(self, theta: Vector, residuals: Residuals) -> Normal:
        """Normal equations of these residuals."""
        return Normal(self._problem, theta, self._items, residuals, self._loss)
