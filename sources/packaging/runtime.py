"""The slave of the python FMUs: what the C files do, on lists. Its text is copied into every one.

Above the line stand the names that a generated slave defines before it.
"""

import math as _math
from typing import Any

Fmi2Slave: Any = object
MODEL: Any = None
NX: Any = None
NU: Any = None
NY: Any = None
NP: Any = None
NZ: Any = None
NC: Any = None
NJ: Any = None
NLU: Any = None
NAMES: Any = None
START: Any = None
MINIMUM: Any = None
MAXIMUM: Any = None
FIXED: Any = None
NOMINAL: Any = None
OWNER: Any = None
STIFF: Any = None
LAGS: Any = None
UPDATES: Any = None
f_outputs: Any = None
f_derivatives: Any = None
f_jacobian: Any = None
f_periods: Any = None
f_factor: Any = None
f_solve: Any = None


# -- run time ---------------------------------------------------------------------------------
SLACK = 1e-7  # part of its period by which a tick may be early
SHORTEST = 1e-12  # step of a solver [s]
FOLLOWED = 2.0  # steps of a time constant that fixed steps follow, see solvers.c
EPSILON = 2.0**-52  # of doubles
KEEP = 20  # steps with one Jacobian
GAMMA = 0.435866521508459  # of ROS34PW2
GROW, SHRINK, SAFETY = 5.0, 0.1, 0.9  # of error-controlled steps
TRIALS, TRIALS_PER_STEP = 2e5, 1e3  # over one stretch, and for each solver.step of it


def _slack(period: float, time: float) -> float:
    """What a tick at a time may be early by."""
    early = SLACK * period if period < _math.inf else 0.0
    return early + 4.0 * EPSILON * abs(time)


class Slave(Fmi2Slave):  # type: ignore[misc]
    """The variables in one list; a value reference is an index into it."""

    def __init__(self, **kwargs: Any) -> None:
        """Start values."""
        super().__init__(**kwargs)
        self.IX = 1
        self.IXD = self.IX + NX
        self.IU = self.IXD + NX
        self.IY = self.IU + NU
        self.IP = self.IY + NY
        self.IZ = self.IP + NP
        self.IS = self.IZ + NZ
        self.v = list(START)
        self.period = [0.0] * NC
        self.tick = [0.0] * NC
        self.next = [0.0] * NC
        self.stop = _math.inf
        self.h = 0.0
        self.j = [0.0] * NJ
        self.w = [0.0] * NLU
        self.hw = 0.0
        self.left = 0
        self.initialized = False
        self.stale = True

    # -- FMI ----------------------------------------------------------------------------------

    def setup_experiment(self, start_time: float, stop_time: Any, tolerance: Any) -> None:
        """Take the start and stop time."""
        self.v[0] = start_time
        self.stop = _math.inf if stop_time is None else stop_time

    def exit_initialization_mode(self) -> None:
        """Start the sample clocks."""
        if NC:
            f_periods(self.v[self.IP : self.IZ], self.period)
        for k, period in enumerate(self.period):
            if not period > 0.0:
                raise ValueError(
                    f"{MODEL}: sample clock {k} has period {period:g} s; it must be positive"
                )
            self.tick[k] = float(_math.ceil((self.v[0] - _slack(period, self.v[0])) / period))
            self.next[k] = self.tick[k] * period if period < _math.inf else self.v[0]
        self._refresh()
        self._check(self.IXD, NX)
        self._check(self.IY, NY)
        self.initialized = True

    def get_real(self, vrs: Any) -> list[float]:
        """Values by value reference."""
        self._refresh()
        for vr in vrs:
            if not _math.isfinite(self.v[vr]):
                self._check(vr, 1)
        return [self.v[vr] for vr in vrs]

    def set_real(self, vrs: Any, values: Any) -> None:
        """Set inputs and parameters, before the end of initialization states too."""
        for vr, value in zip(vrs, values, strict=True):
            self._set(vr, float(value))

    def get_integer(self, vrs: Any) -> list[int]:
        """Value of `solver.method`."""
        return [int(self.v[vr]) for vr in vrs]

    def set_integer(self, vrs: Any, values: Any) -> None:
        """Set `solver.method`."""
        for vr, value in zip(vrs, values, strict=True):
            self._set(vr, float(value))

    def _set(self, vr: int, value: float) -> None:
        if not _math.isfinite(value):
            raise ValueError(
                f"{MODEL}: variable {NAMES[vr]} cannot be set to {value:g} "
                f"at time {self.v[0]:.9g} s: not finite"
            )
        parameter = self.IP <= vr < self.IZ or vr >= self.IS
        state = self.IX <= vr < self.IXD or self.IZ <= vr < self.IS
        if not (parameter or state or self.IU <= vr < self.IY):
            raise ValueError(f"{MODEL}: variable {NAMES[vr]} is calculated and cannot be set")
        if (state or FIXED[vr]) and self.initialized:
            raise ValueError(
                f"{MODEL}: {NAMES[vr]} can only be set before the end of initialization"
            )
        if parameter and not MINIMUM[vr] <= value <= MAXIMUM[vr]:
            raise ValueError(
                f"{MODEL}: parameter {NAMES[vr]} = {value:g} is outside "
                f"[{MINIMUM[vr]:g}, {MAXIMUM[vr]:g}]"
            )
        self.v[vr] = value
        self.stale = True

    def _get_fmu_state(self) -> dict[str, Any]:
        return {
            "v": list(self.v),
            "period": list(self.period),
            "tick": list(self.tick),
            "next": list(self.next),
            "stop": self.stop,
            "h": self.h,
            "j": list(self.j),
            "w": list(self.w),
            "hw": self.hw,
            "left": self.left,
            "initialized": self.initialized,
        }

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        self.v, self.period = list(state["v"]), list(state["period"])
        self.tick, self.next = list(state["tick"]), list(state["next"])
        self.stop, self.h = state["stop"], state["h"]
        self.j, self.w = list(state["j"]), list(state["w"])
        self.hw, self.left = state["hw"], state["left"]
        self.initialized = state["initialized"]
        self.stale = True

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance over a communication step, tick by tick."""
        v = self.v
        if not abs(current_time - v[0]) <= 1e-9 * (1 + abs(current_time)):
            raise ValueError(
                f"{MODEL}: doStep starts at {current_time:.9g} s but the FMU is at {v[0]:.9g} s"
            )
        end = current_time + step_size
        if not current_time < end < _math.inf:
            raise ValueError(
                f"{MODEL}: communication step {step_size:g} s at time {current_time:.9g} s"
            )
        if end > self.stop + 1e-9 * (1 + abs(self.stop)):
            raise ValueError(
                f"{MODEL}: doStep from {current_time:.9g} s to {end:.9g} s goes past "
                f"the stop time {self.stop:.9g} s"
            )
        v[0] = current_time
        while True:
            self._run_ticks()
            following = self._next_tick(end)
            whole = following == end and v[0] == current_time
            self._integrate(following, step_size if whole else following - v[0])
            self._check(self.IZ, NZ)
            if following == end:
                return True

    # -- model ----------------------------------------------------------------------------------

    def _slices(self) -> tuple[list[float], list[float], list[float]]:
        v = self.v
        return v[self.IZ : self.IS], v[self.IU : self.IY], v[self.IP : self.IZ]

    def _refresh(self) -> None:
        if self.stale:
            v = self.v
            z, u, p = self._slices()
            xdot, y = [0.0] * NX, [0.0] * NY
            f_outputs([v[0]], v[self.IX : self.IXD], z, u, p, xdot, y)
            v[self.IXD : self.IU] = xdot
            v[self.IY : self.IP] = y
            self.stale = False

    def _check(self, start: int, count: int) -> None:
        for vr in range(start, start + count):
            if not _math.isfinite(self.v[vr]):
                raise ValueError(
                    f"{MODEL}: variable {NAMES[vr]} is not finite ({self.v[vr]:g}) "
                    f"at time {self.v[0]:.9g} s"
                )

    def _run_ticks(self) -> None:
        v = self.v
        for k, period in enumerate(self.period):
            if self.next[k] <= v[0] + _slack(period, v[0]):
                z, u, p = self._slices()
                result = [0.0] * NZ
                UPDATES[k]([v[0]], v[self.IX : self.IXD], z, u, p, result)
                v[self.IZ : self.IS] = result
                self.tick[k] += 1
                self.next[k] = self.tick[k] * period
                self.stale = True

    def _next_tick(self, end: float) -> float:
        first = end
        for following, period in zip(self.next, self.period, strict=True):
            if following + _slack(period, following) < end and following < first:
                first = following
        return first

    # -- solvers ----------------------------------------------------------------------------------

    def _stiff(self, step: float) -> bool:
        v = self.v
        lags = any(0.0 < v[i] < FOLLOWED * step for i in LAGS)
        return lags or any(v[i] != 0.0 for i in STIFF)

    def _integrate(self, t1: float, length: float) -> None:
        v = self.v
        if NX:
            method, step = v[self.IS], v[self.IS + 1]
            if method <= 2 and not self._stiff(min(length, step)):
                t0 = v[0]
                n = _math.ceil(length / step * (1 - 1e-9)) if length > step else 1
                h = length / n
                for i in range(n):
                    x = v[self.IX : self.IXD]
                    x = (
                        self._rk4(t0 + i * h, h, x)
                        if method == 1
                        else self._rodas3(t0 + i * h, h, x)[0]
                    )
                    v[self.IX : self.IXD] = x
            else:
                self._adaptive(t1, length, int(method))
        v[0] = t1
        self.stale = True
        self._check(self.IX, NX)

    def _derivatives(self, t: float, x: list[float]) -> list[float]:
        result = [0.0] * NX
        f_derivatives([t], x, *self._held, result)
        return result

    def _rk4(self, t: float, h: float, x: list[float]) -> list[float]:
        self._held = self._slices()
        r = range(NX)
        k1 = self._derivatives(t, x)
        k2 = self._derivatives(t + 0.5 * h, [x[i] + 0.5 * h * k1[i] for i in r])
        k3 = self._derivatives(t + 0.5 * h, [x[i] + 0.5 * h * k2[i] for i in r])
        k4 = self._derivatives(t + h, [x[i] + h * k3[i] for i in r])
        return [x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]) for i in r]

    def _rodas3(self, t: float, h: float, x: list[float]) -> tuple[list[float], list[float]]:
        self._held = self._slices()
        r = range(NX)
        f, j, ft, w = [0.0] * NX, [0.0] * NJ, [0.0] * NX, [0.0] * NLU
        f_jacobian([t], x, *self._held, f, j, ft)
        ih = 1.0 / h
        f_factor(j, 2.0 * ih, w)
        self.left = 0
        k1 = [f[i] + 0.5 * h * ft[i] for i in r]
        f_solve(w, k1)
        k2 = [f[i] + 4.0 * ih * k1[i] + 1.5 * h * ft[i] for i in r]
        f_solve(w, k2)
        y = [x[i] + 2.0 * k1[i] for i in r]
        f = self._derivatives(t + h, y)
        k3 = [f[i] + ih * (k1[i] - k2[i]) for i in r]
        f_solve(w, k3)
        y = [y[i] + k3[i] for i in r]
        f = self._derivatives(t + h, y)
        k4 = [f[i] + ih * (k1[i] - k2[i] - (8.0 / 3.0) * k3[i]) for i in r]
        f_solve(w, k4)
        return [y[i] + k4[i] for i in r], k4

    def _dopri5(self, t: float, h: float, x: list[float]) -> tuple[list[float], list[float]]:
        self._held = self._slices()
        r = range(NX)
        k1 = self._derivatives(t, x)
        k2 = self._derivatives(t + 1.0 / 5.0 * h, [x[i] + h * (1.0 / 5.0 * k1[i]) for i in r])
        y = [x[i] + h * (3.0 / 40.0 * k1[i] + 9.0 / 40.0 * k2[i]) for i in r]
        k3 = self._derivatives(t + 3.0 / 10.0 * h, y)
        y = [x[i] + h * (44.0 / 45.0 * k1[i] - 56.0 / 15.0 * k2[i] + 32.0 / 9.0 * k3[i]) for i in r]
        k4 = self._derivatives(t + 4.0 / 5.0 * h, y)
        y = [
            x[i]
            + h
            * (
                19372.0 / 6561.0 * k1[i]
                - 25360.0 / 2187.0 * k2[i]
                + 64448.0 / 6561.0 * k3[i]
                - 212.0 / 729.0 * k4[i]
            )
            for i in r
        ]
        k5 = self._derivatives(t + 8.0 / 9.0 * h, y)
        y = [
            x[i]
            + h
            * (
                9017.0 / 3168.0 * k1[i]
                - 355.0 / 33.0 * k2[i]
                + 46732.0 / 5247.0 * k3[i]
                + 49.0 / 176.0 * k4[i]
                - 5103.0 / 18656.0 * k5[i]
            )
            for i in r
        ]
        k6 = self._derivatives(t + h, y)
        y = [
            x[i]
            + h
            * (
                35.0 / 384.0 * k1[i]
                + 500.0 / 1113.0 * k3[i]
                + 125.0 / 192.0 * k4[i]
                - 2187.0 / 6784.0 * k5[i]
                + 11.0 / 84.0 * k6[i]
            )
            for i in r
        ]
        k7 = self._derivatives(t + h, y)
        e = [
            h
            * (
                71.0 / 57600.0 * k1[i]
                - 71.0 / 16695.0 * k3[i]
                + 71.0 / 1920.0 * k4[i]
                - 17253.0 / 339200.0 * k5[i]
                + 22.0 / 525.0 * k6[i]
                - 1.0 / 40.0 * k7[i]
            )
            for i in r
        ]
        return y, e

    def _rosw3(self, t: float, h: float, x: list[float]) -> tuple[list[float], list[float]]:
        self._held = self._slices()
        r = range(NX)
        ih = 1.0 / h
        if self.left == 0:
            f_jacobian([t], x, *self._held, [0.0] * NX, self.j, [0.0] * NX)
            self.left = KEEP
            self.hw = 0.0
        if not abs(h - self.hw) <= 1e-9 * h:
            f_factor(self.j, ih / GAMMA, self.w)
            self.hw = h
        w = self.w
        k1 = self._derivatives(t, x)
        f_solve(w, k1)
        y = [x[i] + 2.0 * k1[i] for i in r]
        f = self._derivatives(t + 0.871733043016918 * h, y)
        k2 = [f[i] - ih * (4.588560720558084 * k1[i]) for i in r]
        f_solve(w, k2)
        y = [x[i] + (1.4192173174557652 * k1[i] - 0.2592322116729698 * k2[i]) for i in r]
        f = self._derivatives(t + 0.7315799577888524 * h, y)
        k3 = [f[i] - ih * (4.184760482319161 * k1[i] - 0.285192017355496 * k2[i]) for i in r]
        f_solve(w, k3)
        y = [
            x[i]
            + (4.184760482319161 * k1[i] - 0.285192017355496 * k2[i] + 2.2942803602790423 * k3[i])
            for i in r
        ]
        f = self._derivatives(t + h, y)
        k4 = [
            f[i]
            - ih
            * (6.36817920012836 * k1[i] + 6.795620944466837 * k2[i] - 2.870098604331055 * k3[i])
            for i in r
        ]
        f_solve(w, k4)
        e = [
            0.27774994764797034 * k1[i]
            - 1.4032398951759986 * k2[i]
            + 1.7726301276675511 * k3[i]
            + 0.5 * k4[i]
            for i in r
        ]
        self.left -= 1
        return [y[i] + k4[i] for i in r], e

    def _adaptive(self, t1: float, length: float, code: int) -> None:
        v = self.v
        largest, tolerance = v[self.IS + 1], v[self.IS + 2]
        t, h = v[0], self.h if self.h > 0 else 0.1 * largest
        order = 5 if code == 3 else 3
        exponent = -1.0 / order
        quiet = steady = 1.0
        for _ in range(order):
            quiet, steady = quiet * (SAFETY / GROW), steady * SAFETY
        method = {3: self._dopri5, 5: self._rosw3}.get(code, self._rodas3)
        left = TRIALS + TRIALS_PER_STEP * length / largest
        while t < t1:
            left -= 1
            if left < 0:
                raise ValueError(
                    f"{MODEL}: too many solver steps from {v[0]:.9g} s on, at {t:.9g} s"
                )
            if h > largest:
                h = largest
            last = t + h * (1 + 1e-9) >= t1
            hs = h if not last else length if t == v[0] else t1 - t
            x = v[self.IX : self.IXD]
            new, e = method(t, hs, x)
            error = quiet
            for i in range(NX):
                if OWNER[i] and v[OWNER[i]] == 0.0:
                    continue
                scale = tolerance * (NOMINAL[i] + abs(x[i]))
                if not abs(e[i]) <= error * scale:
                    error = abs(e[i]) / scale
                if error != error:
                    break
            if error <= 1:
                v[self.IX : self.IXD] = new
                t = t1 if last else t + hs
                if error <= steady and h >= largest:
                    continue  # it cannot grow
            elif code == 5 and self.left < KEEP - 1:
                self.left = 0  # perhaps the Jacobian was too old: once more with a new one
                continue
            if error <= quiet:
                factor = GROW
            else:
                factor = SAFETY * _math.pow(error, exponent) if _math.isfinite(error) else SHRINK
            factor = min(max(factor, SHRINK), GROW)
            if not last or error > 1 or hs * factor > h:
                h = hs * factor
            if h < SHORTEST + 4.0 * EPSILON * abs(t):
                raise ValueError(f"{MODEL}: the solver's step fell to {h:g} s at time {t:.9g} s")
        self.h = h
