"""Derivatives that are used again for a model with some parameters more or less."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from .differences import jacobian
from .parts import PURPOSE, Sensitivity
from .simulator import Simulator

Vector = NDArray[np.float64]
STEP = 5e-3
"""Of differences over the span, where derivatives are taken once for many models."""


class Known:
    """Derivatives of another fit.

    Args:
        names: parameters of that fit.
        jacobian: its derivatives.
    """

    def __init__(self, names: Sequence[str], jacobian: Iterable[Sensitivity]) -> None:
        self.runs = {item.run: item for item in jacobian}
        self.place = {
            name: {names[i]: k for k, i in enumerate(item.columns.tolist())}
            for name, item in self.runs.items()
        }

    @classmethod
    def at(cls, simulator: Simulator, theta: Vector) -> Known:
        """Those at a point of the parameters."""
        found = jacobian(simulator, theta, PURPOSE, central=False, relative=STEP)
        return cls(simulator.problem.names, found)

    def extended(
        self, simulator: Simulator, theta: Vector, purpose: str | Iterable[str]
    ) -> list[Sensitivity]:
        """Derivatives for all parameters of a problem, the unknown ones taken at theta."""
        problem = simulator.problem
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
            for item in jacobian(
                simulator, theta, [r.name for r in runs], columns=new, central=False, relative=STEP
            )
        } if new else {}  # fmt: skip
        found = []
        for run in runs:
            columns = problem.columns(run.name)
            place = self.place.get(run.name, {})
            mine = [names[i] for i in columns.tolist()]
            here = [k for k, name in enumerate(mine) if name in place]
            values = np.empty((*run.data.shape, columns.size))
            rough = None
            if here:
                old, at = self.runs[run.name], [place[mine[k]] for k in here]
                values[:, :, here] = old.values[:, :, at]
                if old.roughness is not None:
                    rough = np.zeros_like(values)
                    rough[:, :, here] = old.roughness[:, :, at]
            if len(here) < len(mine):
                item = fresh[run.name]
                own = {i: k for k, i in enumerate(item.columns.tolist())}
                there = [k for k, name in enumerate(mine) if name not in place]
                values[:, :, there] = item.values[:, :, [own[int(columns[k])] for k in there]]
            found.append(Sensitivity(run.name, columns, values, rough))
        return found
