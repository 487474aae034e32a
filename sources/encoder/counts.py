"""Incremental encoder: the speed is the difference of counts over the last window.

    c(t) = floor(theta(t) n / (2 pi) + phase),   theta' = w
    w_meas = 2 pi (c(t) - c(t - T)) / (n T)
    phi_meas = 2 pi floor(phi n / (2 pi) + phase) / n

The window moves along with time; a reader who samples it every T gets the difference between his
samples. The angle of T ago is taken from ten samples per window, exact at the samples. The counter
integrates `w` itself, so a speed that is held over a communication step gives the counts of that
step whatever the order in which the components are stepped. Before the start the shaft is taken as
turning at the speed of the first tick. The resolution of the speed is 2 pi / (n T).

Not modelled: errors of the graduation, noise of the period measurement (effect `noise`).

Source: rig sheets motor_bench, crawler, mobile_manipulator (count difference over the last window).
"""

from __future__ import annotations

import math
from typing import Any

import casadi as ca

from .. import encoder as qs
from ..component import Fidelity, Solver
from ..laws.history import History
from ..model import Model
from ..quantity import Quantity

SX = Any
FIDELITY = Fidelity(level=1, solver=Solver("rk4", step=1e-3))
SAMPLES = 10  # of the angle per window

N = Quantity("n", "1", "counts per revolution of the shaft", 4096.0, minimum=1.0)
WINDOW = Quantity(
    "window",
    "s",
    "duration T over which counts are compared",
    0.01,
    minimum=1e-6,
    variability="fixed",
)
PHASE = Quantity(
    "phase", "1", "position between two counts at angle 0", 0.5, minimum=0.0, maximum=1.0
)
THETA = Quantity("theta", "rad", "angle that the counter has seen")


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.PHI, qs.W)
    p = m.parameters(N, WINDOW, PHASE)
    x = m.states(THETA)
    count = 2.0 * math.pi / p.n
    m.derivative(x.theta, u.w)
    past = History(
        m, "angle", x.theta, unit="rad", period=p.window / SAMPLES, slots=SAMPLES + 2, slope=u.w
    )

    def counts(angle: SX) -> SX:
        return ca.floor(angle / count + p.phase)

    speed = count * (counts(x.theta) - counts(past.at(p.window))) / p.window
    speed += m.balance("speed", "signal", unit="rad/s", value=speed, sensor=qs.W_MEAS).effort
    angle = count * counts(u.phi)
    angle += m.balance("angle", "signal", unit="rad", value=angle, sensor=qs.PHI_MEAS).effort
    m.output(qs.W_MEAS, speed)
    m.output(qs.PHI_MEAS, angle)
