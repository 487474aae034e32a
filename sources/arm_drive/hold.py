"""Servos whose torque follows from the error at once: spring, damper and integral part.

    e = q_set - q,   s' = k_i e  (held while the torque is at its limit)
    tau_motor = sat(k e + d (qd_set - qd) + s, tau_max)
    tau = tau_motor - F_v qd - F_c tanh(qd / w_0)

For arms whose motors and controller are not known. What the servos need is supplied.

Not modelled: motors, gears, sampling, other friction (attach it as an effect).

Source: Siciliano et al., Robotics: Modelling, Planning and Control, 2009, ch. 8.5.
"""

from __future__ import annotations

import casadi as ca

from .. import arm_drive as qs
from ..component import Fidelity, Solver
from ..laws.joints import Joints
from ..model import Model
from ..quantity import Quantity

FIDELITY = Fidelity(level=0, solver=Solver("rk4", 1e-3))
K = Quantity("k", "N.m/rad", "stiffness of the servos", start=1e4, minimum=0.0, nominal=1e4, size=2)
D = Quantity("d", "N.m.s/rad", "damping of the servos", start=1e3, minimum=0.0, nominal=1e3, size=2)
K_I = Quantity("k_i", "N.m/(rad.s)", "integral gains", start=0.0, minimum=0.0, nominal=1e5, size=2)
TAU_MAX = Quantity("tau_max", "N.m", "limits of the torques", start=1e6, minimum=1e-9, size=2)
J_B = Quantity(
    "J_rotor", "kg.m2", "inertias of the rotors, seen at the joints", minimum=0.0, size=2
)
F_V = Quantity("F_v", "N.m.s/rad", "viscous friction", minimum=0.0, size=2)
F_C = Quantity("F_c", "N.m", "Coulomb friction", minimum=0.0, size=2)
W_0 = Quantity("w_0", "rad/s", "speed over which the sign is smoothed", start=0.05, minimum=1e-6)
INTEGRAL = Quantity("integral", "N.m", "state: integral parts of the torques", size=2)


def equations(m: Model) -> None:
    """Collect the equations."""
    joints = Joints.of_device(m)
    u = m.inputs(*(joints.sized(each) for each in (qs.Q_SET, qs.QD_SET, qs.Q, qs.QD)))
    m.input_rate(u.q, u.qd)
    p = m.parameters(*(joints.sized(each) for each in (K, D, K_I, TAU_MAX, J_B)))
    x = m.states(joints.sized(INTEGRAL))
    error = u.q_set - u.q
    wanted = p.k * error + p.d * (u.qd_set - u.qd) + x.integral
    hold = ca.fmax(-p.tau_max, ca.fmin(wanted, p.tau_max))
    m.derivative(x.integral, ca.if_else(ca.fabs(wanted) < p.tau_max, p.k_i * error, 0))
    drag = m.parameters(joints.sized(F_V), joints.sized(F_C), W_0)
    friction = drag.F_v * u.qd + drag.F_c * ca.tanh(u.qd / drag.w_0)
    torque = hold - friction + joints.efforts(m, speed=u.qd, angle=u.q, load=hold)
    m.output(joints.sized(qs.TAU), torque)
    m.output(joints.sized(qs.TAU_MOTOR), hold)
    m.output(joints.sized(qs.J_OUT), p.J_rotor)
    m.port(joints.port(qs.JOINT), torque, u.qd)
    m.supply(ca.dot(hold, u.qd))
    m.loss("friction", ca.dot(friction, u.qd))
