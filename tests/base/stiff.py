"""Runs a stiff variant with error-controlled Rodas3, as its FMU does, in plain numpy."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from tests.support import oracle_of

Inputs = Callable[[float, dict[str, float]], Mapping[str, float]]


class Stiff:
    """A variant with states by name.

    Example:
        base = Stiff("mobile_base/planar", {"caster_fl.swivel_angle": 2.9})
        history = base.run(3.0, lambda t, y: {"tau_l": 1.0, "tau_r": 1.0})
    """

    def __init__(self, variant: str, values: Mapping[str, float] | None = None) -> None:
        self.oracle = oracle_of(variant)
        self.inputs = [v.name for v in self.oracle.model.of_role("input")]
        _, self.x, self.z, self.u, self.p = self.oracle.arguments(values)
        pattern = np.array(self.oracle.functions.jacobian_pattern)
        self._rows, self._columns = pattern.T
        states = self.oracle.model.of_role("state")
        self._nominal = np.array([v.quantity.nominal or 1.0 for v in states])
        self.tolerance = self.oracle.model.solver.tolerance
        self.t = 0.0
        self._h = 1e-4

    def set(self, inputs: Mapping[str, float]) -> None:
        for name, value in inputs.items():
            self.u[self.inputs.index(name)] = value

    def rate(self, x: np.ndarray) -> np.ndarray:
        f = self.oracle.functions.derivatives(self.t, x, self.z, self.u, self.p)
        return np.asarray(f).ravel()

    def jacobian(self) -> np.ndarray:
        _, nonzeros, _ = self.oracle.functions.jacobian(self.t, self.x, self.z, self.u, self.p)
        dense = np.zeros((self.x.size, self.x.size))
        dense[self._rows, self._columns] = np.asarray(nonzeros).ravel()
        return dense

    def step(self, h: float) -> None:
        """Advance by h in as many steps as the tolerance asks for."""
        end = self.t + h
        while self.t < end - 1e-12:
            trial = min(self._h, end - self.t)
            error = self._try(trial)
            factor = min(5.0, max(0.1, 0.9 * (error + 1e-10) ** (-1 / 3)))
            if error > 1 or trial == self._h:
                self._h = min(h, trial * factor)

    def _try(self, h: float) -> float:
        w = np.linalg.inv(2 / h * np.eye(self.x.size) - self.jacobian())
        first = self.rate(self.x)
        k1 = w @ first
        k2 = w @ (first + 4 / h * k1)
        k3 = w @ (self.rate(self.x + 2 * k1) + (k1 - k2) / h)
        k4 = w @ (self.rate(self.x + 2 * k1 + k3) + (k1 - k2 - 8 / 3 * k3) / h)
        error = float(np.max(np.abs(k4) / (self.tolerance * (self._nominal + np.abs(self.x)))))
        if error <= 1:
            self.x = self.x + 2 * k1 + k3 + k4
            self.t += h
        return error

    def outputs(self) -> dict[str, float]:
        _, y = self.oracle.functions.outputs(self.t, self.x, self.z, self.u, self.p)
        return dict(zip(self.oracle.output_names, np.asarray(y).ravel().tolist(), strict=True))

    def state(self, name: str) -> float:
        return float(self.x[self.oracle.state_names.index(name)])

    def run(
        self, end: float, inputs: Inputs | None = None, h: float = 2e-3
    ) -> dict[str, np.ndarray]:
        """Step to `end`, with inputs from time and outputs, held over a step; outputs recorded."""
        rows = [{"time": self.t, **self.outputs()}]
        for _ in range(round((end - self.t) / h)):
            if inputs:
                self.set(inputs(self.t, rows[-1]))
            self.step(h)
            rows.append({"time": self.t, **self.outputs()})
        return {name: np.array([row[name] for row in rows]) for name in rows[0]}
