"""Closed loop: PID on the pose asks for an acceleration, inverse dynamics turns it into torques.

    xi'' = xi_set'' + Kd (xi_set' - xi') + Kp (xi_set - xi) + I,   I' = Ki (xi_set - xi)
    Gamma = sat(W (W^T W)^-1 (M R xi'' + h) + f_s tanh(q'/w_0) + f_v q', tau_max)

with M, h, W and friction at the measured heading and steering angles and the set velocities: the
sign of friction follows the set motion, so that standstill does not chatter. Each axis follows its
set motion like a mass on spring and damper, with poles from s^3 + Kd s^2 + Kp s + Ki.

Not modelled: motors, gears, sampling, anti-windup of the integral part.

Source: computed torque control, e.g. Siciliano et al., Robotics, 2009, ch. 8; torques as in
`inverse_dynamics`. The paper closes no loop.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity, Solver
from ..model import Model
from ..quantity import Quantity
from .torques import least_torques, output_torques, read_base, read_signals

FIDELITY = Fidelity(level=1, solver=Solver("rk4", 1e-3))
KP = Quantity(
    "Kp", "1/s2", "proportional gains for x, y and heading", 75.0, minimum=0.0, nominal=50.0, size=3
)
KI = Quantity(
    "Ki", "1/s3", "integral gains for x, y and heading", 125.0, minimum=0.0, nominal=100.0, size=3
)
KD = Quantity(
    "Kd", "1/s", "derivative gains for x, y and heading", 15.0, minimum=0.0, nominal=10.0, size=3
)
TAU_MAX = Quantity("tau_max", "N.m", "torque limit of each axle", start=60.0, minimum=1e-6)
CORRECTION = Quantity(
    "correction", "1", "integral parts for x, y [m/s2] and heading [rad/s2]", size=3
)


def equations(m: Model) -> None:
    """Collect the equations."""
    signals, base = read_signals(m), read_base(m)
    p = m.parameters(KI, KD, KP, TAU_MAX)
    x = m.states(CORRECTION)
    error = signals.pose_set - signals.pose
    m.derivative(x.correction, p.Ki * error)
    acceleration = (
        signals.acceleration_set
        + p.Kd * (signals.rate_set - signals.rate)
        + p.Kp * error
        + x.correction
    )
    wanted = least_torques(base, signals.pose[2], signals.beta, signals.rate_set, acceleration)
    tau_beta, tau_phi = (ca.fmax(-p.tau_max, ca.fmin(torque, p.tau_max)) for torque in wanted)
    output_torques(m, signals, signals.beta, (tau_beta, tau_phi))
