"""Servo without inner life: stiff springs and dampers between set and actual joint motion.

    tau = k (q_set - q) + d (qd_set - qd)
    i = tau / (eta N K_t),   u = R i + K_t N qd

Current and voltage are those a lossless hold of this torque would take; nothing limits them. Under
gravity a joint of a UR5 sags by some tenths of a milliradian. The damping is such that hold and arm
can exchange every millisecond: d h/J_b < 6/11, the limit of extrapolation by parabolas, with the
rotors' inertia alone.

Not modelled: integral action, limits, dynamics of the winding, friction (attach it as an effect).

Source: textbook.
"""

from __future__ import annotations

import casadi as ca

from .. import ur5_drive as qs
from ..component import Fidelity, Solver
from ..model import Model
from ..quantity import Quantity
from .gearmotor import effort, output_current, read

FIDELITY = Fidelity(level=0, solver=Solver("rk4", 1e-4))
K = Quantity(
    "k",
    "N.m/rad",
    "stiffness of the hold",
    start=(2e5, 2e5, 2e5, 2e4, 2e4, 2e4),
    minimum=0.0,
    nominal=1e5,
    size=6,
)
D = Quantity(
    "d",
    "N.m.s/rad",
    "damping of the hold",
    start=(500.0, 500.0, 500.0, 80.0, 80.0, 80.0),
    minimum=0.0,
    nominal=1e3,
    size=6,
)


def equations(m: Model) -> None:
    """Collect the equations."""
    servo = read(m)
    p = m.parameters(qs.N, qs.K_T, K, D, qs.ETA, qs.R_A)
    hold = p.k * (servo.q_set - servo.q) + p.d * (servo.qd_set - servo.qd)
    torque = hold + effort(
        m, "joint", "rotation", velocity=servo.speed, angle=servo.angle, load=hold
    )
    i = hold / (p.eta * p.N * p.K_t)
    m.output(qs.TAU, torque)
    m.output(qs.I, i)
    m.output(qs.U, p.R_a * i + p.K_t * p.N * servo.speed)
    output_current(m, i)
    m.output(qs.J_B, p.N**2 * m.parameter(qs.J_M))
    m.port(qs.JOINT, torque, servo.speed)
    m.supply(ca.dot(hold, servo.speed))
