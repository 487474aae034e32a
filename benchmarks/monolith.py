"""The equations of a system as one, solved by SciPy: what coupled FMUs are compared with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from cosim.system.system import System
from sources.function import Functions, build_functions
from sources.model import Model
from sources.variant import build_model

Vector = NDArray[np.float64]
LONGEST = 0.01
"""Longest step [s]: a solver that sees no change must not step over a ramp."""


class Monolith:
    """The equations of a system as one, for systems without sampled parts."""

    def __init__(self, system: System, inputs: Mapping[str, float]) -> None:
        self.system = system
        self.models: dict[str, Model] = {}
        self.functions: dict[str, Functions] = {}
        self.start: list[float] = []
        self.scale: list[float] = []
        states: dict[str, Any] = {}
        for member in system.members.values():
            model = build_model(member.description.name)
            if model.of_role("discrete"):
                raise ValueError(f"{member.name} ({member.description.name}) samples")
            self.models[member.name], self.functions[member.name] = model, build_functions(model)
            given = scalars(member.parameters)
            names = [v.name for v in model.of_role("state")]
            states[member.name] = ca.SX.sym(member.name, len(names))
            self.start += [float(given.get(v.name, v.start)) for v in model.of_role("state")]
            self.scale += [float(v.quantity.nominal or 1.0) for v in model.of_role("state")]
        self.t = ca.SX.sym("t")
        self.known: dict[str, Any] = {}
        self.states = states
        wires = {c.target: c for c in system.connections}
        waiting = {
            f"{name}.{v.name}" for name, m in self.models.items() for v in m.of_role("output")
        }
        while waiting:
            before = len(waiting)
            for name, model in self.models.items():
                u, missing = self._inputs(name, wires, inputs)
                depends = self.functions[name].output_dependencies
                ready = [
                    (i, v.name)
                    for i, v in enumerate(model.of_role("output"))
                    if f"{name}.{v.name}" in waiting and not missing & set(depends[v.name])
                ]
                if ready:
                    _, y = self._call(name, u)
                    for i, output in ready:
                        self.known[f"{name}.{output}"] = y[i]
                        waiting.discard(f"{name}.{output}")
            if len(waiting) == before:
                raise ValueError(f"algebraic loop through {sorted(waiting)[:4]}")
        rates = [self._call(name, self._inputs(name, wires, inputs)[0])[0] for name in self.models]
        x = ca.vertcat(*states.values())
        rate = ca.vertcat(*rates)
        self.rate = ca.Function("rate", [self.t, x], [rate])
        self.jacobian = ca.Function("jacobian", [self.t, x], [ca.jacobian(rate, x)])
        self.x = x

    def _inputs(
        self, name: str, wires: dict[str, Any], inputs: Mapping[str, float]
    ) -> tuple[list[Any], set[str]]:
        values: list[Any] = []
        missing = set()
        given = scalars(self.system.members[name].parameters)
        for v in self.models[name].of_role("input"):
            wire = wires.get(f"{name}.{v.name}")
            if wire is None:
                values.append(inputs.get(f"{name}.{v.name}", given.get(v.name, v.start)))
            elif wire.source in self.known:
                values.append(self.known[wire.source] * wire.gain + wire.offset)
            else:
                values.append(0.0)
                missing.add(v.name)
        return values, missing

    def _call(self, name: str, u: list[Any]) -> tuple[Any, Any]:
        given = scalars(self.system.members[name].parameters)
        p = [float(given.get(v.name, v.start)) for v in self.models[name].of_role("parameter")]
        column = ca.vertcat(*u) if u else ca.SX(0, 1)
        parameters = ca.DM(p) if p else ca.DM(0, 1)
        rate, y = self.functions[name].outputs(
            self.t, self.states[name], ca.DM(0, 1), column, parameters
        )
        return rate, y

    def solve(self, times: Vector, signals: Sequence[str], rtol: float = 1e-9) -> Vector:
        """Signals at these times."""
        found = solve_ivp(
            lambda t, x: np.asarray(self.rate(t, x)).ravel(),
            (float(times[0]), float(times[-1])),
            self.start,
            method="Radau",
            t_eval=times,
            rtol=rtol,
            atol=1e-3 * rtol * np.array(self.scale),
            jac=lambda t, x: np.asarray(self.jacobian(t, x)),
            max_step=LONGEST,
        )
        if not found.success:
            raise ValueError(found.message)
        wanted = ca.vertcat(*[self.known[signal] for signal in signals])
        outputs = ca.Function("y", [self.t, self.x], [wanted])
        states = zip(times, found.y.T, strict=True)
        return np.array([np.asarray(outputs(t, x)).ravel() for t, x in states])


def scalars(values: Mapping[str, Any]) -> dict[str, float]:
    """Values by scalar name: those of a vector `q` belong to `q[1]`, `q[2]`, ..."""
    found: dict[str, float] = {}
    for name, value in values.items():
        if isinstance(value, list | tuple):
            found |= {f"{name}[{i}]": float(item) for i, item in enumerate(value, start=1)}
        else:
            found[name] = float(value)
    return found
