"""Helpers shared by the tests: `Stepper` runs any model, with its sample clocks, in plain numpy."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache

import casadi as ca
import numpy as np

from sources.function import Oracle
from sources.model import Model
from sources.variant import build_model

EARLY = 1e-7  # part of a period by which k * period and k * dt may differ and still be one instant


@lru_cache(maxsize=None)
def oracle_of(name: str) -> Oracle:
    """The oracle of a variant, shared by the tests, who do not change it or its model.

    Not for devices that a test has written: another test may mean another one by the same name.
    """
    return Oracle(build_model(name))


class Stepper:
    """Simulates a variant with communication steps, RK4 between ticks, ticks as in sources/README.

    The tick at the beginning of a step sees the inputs of that step; the tick at its end belongs to
    the next step; clocks due together act in order of declaration. Reading `outputs()` after a step
    therefore shows what was there before the tick at that instant.

    Example:
        stepper = Stepper("command_link/held", {"T": 0.01})
        for k in range(100):
            outputs = stepper.step({"v_set": math.sin(0.01 * k)}, 0.01)

    Args:
        variant: a variant's name or a finished model.
        values: parameters, start values of states and sampled values, initial inputs.
        max_step: largest RK4 step [s]; default the solver step of the fidelity. A stiff model needs
            less than about 2.5 times its fastest time constant.
        start: time at which the simulation begins [s].
    """

    def __init__(
        self,
        variant: str | Model,
        values: Mapping[str, float] | None = None,
        *,
        max_step: float | None = None,
        start: float = 0.0,
    ) -> None:
        self.oracle = oracle_of(variant) if isinstance(variant, str) else Oracle(variant)
        self.model = self.oracle.model
        self.max_step = max_step or self.model.solver.step
        self.t = start
        names = [[v.name for v in self.model.of_role(r)] for r in ("state", "discrete", "input")]
        self._names = dict(zip(("x", "z", "u"), names, strict=True))
        self._names["p"] = [v.name for v in self.model.of_role("parameter")]
        _, self.x, self.z, self.u, self.p = self.oracle.arguments(values, start)
        self._rk4 = self._build_rk4()
        self.periods = np.asarray(self.oracle.functions.periods(self.p)).ravel()
        if not np.all(self.periods > 0):
            raise ValueError(f"clock periods {self.periods} must be positive")
        self._once = np.isinf(self.periods)  # clocks that tick at the start alone
        self._start = start
        self._tick = np.where(self._once, 0.0, np.ceil(start / self.periods - EARLY))

    def _build_rk4(self) -> ca.Function:
        f = self.oracle.functions.derivatives
        t, h = ca.SX.sym("t"), ca.SX.sym("h")
        x, z, u, p = (ca.SX.sym(k, len(self._names[k])) for k in ("x", "z", "u", "p"))
        k1 = f(t, x, z, u, p)
        k2 = f(t + 0.5 * h, x + 0.5 * h * k1, z, u, p)
        k3 = f(t + 0.5 * h, x + 0.5 * h * k2, z, u, p)
        k4 = f(t + h, x + h * k3, z, u, p)
        return ca.Function("rk4", [t, h, x, z, u, p], [x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)])

    def _run_ticks(self) -> None:
        """Execute the clocks that are due."""
        for k, late in enumerate(self._early()):
            if self._times()[k] <= self.t + late:
                update = self.oracle.functions.updates[k]
                self.z = np.asarray(update(self.t, self.x, self.z, self.u, self.p)).ravel()
                self._tick[k] += 1

    def _next_tick(self, end: float) -> float:
        """Time of the next tick that lies clearly before `end`, else `end`."""
        times = self._times()
        return min([end, *times[times < end - self._early()]])

    def _times(self) -> np.ndarray:
        """Of the next tick of each clock."""
        ticks = np.where(self._once, 0.0, self._tick) * np.where(self._once, 1.0, self.periods)
        return np.where(self._once, np.where(self._tick > 0, math.inf, self._start), ticks)

    def _early(self) -> np.ndarray:
        """By how much a tick may come before its time."""
        return np.where(self._once, 0.0, EARLY * np.where(self._once, 1.0, self.periods))

    def _integrate(self, end: float) -> None:
        if self.x.size and end > self.t:
            count = max(1, math.ceil((end - self.t) / self.max_step * (1 - 1e-9)))
            h = (end - self.t) / count
            for k in range(count):
                arguments = (self.t + k * h, h, self.x, self.z, self.u, self.p)
                self.x = np.asarray(self._rk4(*arguments)).ravel()
            if not np.all(np.isfinite(self.x)):
                raise FloatingPointError(
                    f"a state is not finite at {end} s; a stiff model needs a smaller max_step"
                )
        self.t = end

    def set(self, inputs: Mapping[str, float]) -> None:
        """Set inputs without stepping (a vector element is named `q[1]`)."""
        for name, value in inputs.items():
            self.u[self._names["u"].index(name)] = value

    def step(self, inputs: Mapping[str, float] | None = None, dt: float = 1e-3) -> dict[str, float]:
        """One communication step with held inputs (others stay); the outputs after it."""
        self.set(inputs or {})
        end = self.t + dt
        while self.t < end:
            self._run_ticks()
            self._integrate(self._next_tick(end))
        return self.outputs()

    def outputs(self) -> dict[str, float]:
        """Outputs at the present time, from the present inputs."""
        _, y = self.oracle.functions.outputs(self.t, self.x, self.z, self.u, self.p)
        return dict(zip(self.oracle.output_names, np.asarray(y).ravel().tolist(), strict=True))

    @property
    def values(self) -> dict[str, float]:
        """All variables by name: states, sampled values, inputs, parameters and outputs."""
        found: dict[str, float] = {}
        for key, vector in (("x", self.x), ("z", self.z), ("u", self.u), ("p", self.p)):
            found.update(zip(self._names[key], vector.tolist(), strict=True))
        found.update(self.outputs())
        return found

    def run(
        self,
        dt: float,
        steps: int,
        inputs: Callable[[float], Mapping[str, float]] | None = None,
        names: Iterable[str] | None = None,
    ) -> dict[str, np.ndarray]:
        """Repeat `step(inputs(t), dt)`; record `time` and `names` (default: outputs) after each.

        The first sample is the one before the first step, with `inputs(start)` set.
        """
        if inputs:
            self.set(inputs(self.t))
        wanted = list(names) if names is not None else list(self.oracle.output_names)
        all_outputs = set(wanted) <= set(self.oracle.output_names)

        def sample() -> list[float]:
            values = self.outputs() if all_outputs else self.values
            return [self.t, *(values[name] for name in wanted)]

        start = self.t
        rows = [sample()]
        for k in range(steps):
            self.step(inputs(self.t) if inputs else None, start + (k + 1) * dt - self.t)
            rows.append(sample())
        return dict(zip(["time", *wanted], np.array(rows).T, strict=True))
