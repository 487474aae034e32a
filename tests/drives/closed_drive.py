"""Motor, gearbox and load closed to one set of equations, as a monolithic reference."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from tests.support import oracle_of


class ClosedDrive:
    """The states of motor, gearbox (optional) and load under one set speed.

    Args:
        motor, gearbox, load: variants; without a gearbox the load sits on the motor's shaft.
        values: parameters and start values as `motor.…`, `gear.…`, `load.…`.
    """

    def __init__(
        self,
        motor: str,
        load: str,
        gearbox: str | None = None,
        values: Mapping[str, float] | None = None,
    ) -> None:
        self.parts = {"motor": oracle_of(motor), "load": oracle_of(load)}
        if gearbox:
            self.parts["gear"] = oracle_of(gearbox)
        values = dict(values or {})
        self.x0: dict[str, np.ndarray] = {}
        self.z0: dict[str, np.ndarray] = {}
        self.p: dict[str, np.ndarray] = {}
        for name, oracle in self.parts.items():
            own = {
                key.partition(".")[2]: values.pop(key)
                for key in list(values)
                if key.startswith(f"{name}.")
            }
            _, self.x0[name], self.z0[name], _, self.p[name] = oracle.arguments(own)
        if values:
            raise KeyError(f"no such values: {', '.join(values)}")
        self.states = [f"{n}.{s}" for n, o in self.parts.items() for s in o.state_names]
        self._connect()

    def _call(self, name: str, x: ca.SX, z: ca.SX, inputs: Mapping[str, ca.SX]) -> tuple:
        oracle = self.parts[name]
        u = ca.vertcat(*[inputs[v.name] for v in oracle.model.of_role("input")])
        xdot, y = oracle.functions.outputs(0.0, x, z, u, self.p[name])
        return xdot, {key: y[i] for i, key in enumerate(oracle.output_names)}, u

    def _connect(self) -> None:
        x = {n: ca.SX.sym(f"x_{n}", v.size) for n, v in self.x0.items()}
        z = ca.SX.sym("z", self.z0["motor"].size)
        w_ref = ca.SX.sym("w_ref")
        none = ca.SX(0, 1)
        _, load, _ = self._call("load", x["load"], none, {"tau": 0, "J_added": 0})
        speed, added = load["w"], ca.SX(0)
        if "gear" in self.parts:
            _, gear, _ = self._call("gear", x["gear"], none, {"tau_a": 0, "w_b": load["w"]})
            speed, added = gear["w_a"], gear["J_b"]
        dx_motor, motor, u = self._call("motor", x["motor"], z, {"w_ref": w_ref, "w": speed})
        torque = motor["tau"]
        dx = {"motor": dx_motor}
        if "gear" in self.parts:
            inputs = {"tau_a": torque, "w_b": load["w"]}
            dx["gear"], gear, _ = self._call("gear", x["gear"], none, inputs)
            torque = gear["tau_b"]
        inputs = {"tau": torque, "J_added": added}
        dx["load"], load, _ = self._call("load", x["load"], none, inputs)
        state = ca.vertcat(*[x[n] for n in self.parts])
        rate = ca.vertcat(*[dx[n] for n in self.parts])
        outputs = ca.vertcat(speed, motor["i"], motor["u"], motor["i_set"], load["w"])
        self.rate = ca.Function("rate", [state, z, w_ref], [rate])
        self.outputs = ca.Function("outputs", [state, z, w_ref], [outputs])
        self.linear = ca.Function(
            "linear",
            [state, z, w_ref],
            [
                ca.densify(m)
                for m in (
                    ca.jacobian(rate, state),
                    ca.jacobian(rate, w_ref),
                    ca.jacobian(outputs, state),
                    ca.jacobian(outputs, w_ref),
                )
            ],
        )
        ticks = [
            update(0.0, x["motor"], z, u, self.p["motor"])
            for update in self.parts["motor"].functions.updates
        ]
        self.ticks = [ca.Function("tick", [state, z, w_ref], [tick]) for tick in ticks]

    @property
    def start(self) -> np.ndarray:
        """Start values of the states."""
        return np.concatenate([self.x0[name] for name in self.parts])

    def matrices(self) -> tuple[np.ndarray, ...]:
        """A, B, C, D at the start values, from the set speed to (w, i, u, i_set, load speed)."""
        return tuple(np.array(m) for m in self.linear(self.start, self.z0["motor"], 0.0))

    def response(self, omega: np.ndarray) -> np.ndarray:
        """Frequency response of the outputs to the set speed, one row per output."""
        a, b, c, d = self.matrices()
        eye = np.eye(len(a))
        return np.array([(c @ np.linalg.solve(1j * w * eye - a, b) + d).ravel() for w in omega]).T

    def sampled_run(self, command: np.ndarray, period: float) -> np.ndarray:
        """Outputs before the ticks at `k * period` (the current loop's), command held.

        The first clock is the slower one and ticks at multiples of the second.
        """
        slow, fast = np.asarray(self.parts["motor"].functions.periods(self.p["motor"])).ravel()
        every = round(slow / period)
        assert abs(fast - period) < 1e-15
        x, z = ca.SX.sym("x", self.start.size), ca.SX.sym("z", self.z0["motor"].size)
        w, speed_tick = ca.SX.sym("w"), ca.SX.sym("speed_tick")
        held = ca.if_else(speed_tick, self.ticks[0](x, z, w), z)
        held = self.ticks[1](x, held, w)
        k1 = self.rate(x, held, w)
        k2 = self.rate(x + period / 2 * k1, held, w)
        k3 = self.rate(x + period / 2 * k2, held, w)
        k4 = self.rate(x + period * k3, held, w)
        after = x + period / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        step = ca.Function("step", [x, z, w, speed_tick], [after, held, self.outputs(x, z, w)])
        state, sampled = self.start, self.z0["motor"]
        rows = []
        for k, value in enumerate(command):
            state, sampled, row = step(state, sampled, value, float(k % every == 0))
            rows.append(np.asarray(row).ravel())
        return np.array(rows)
