"""Rotor and carriage with an elastic screw between them.

    r = lead / (2 pi),   psi' = w_2,   w_2 = v_c / r
    J_1 phi'' = tau - tau_s,   tau_s = k (phi - psi) + d (phi' - w_2)
    (M r^2 - J_1) w_2' = tau_s + r (F_0 - F_v v_c - F_c tanh(v_c / v_0))

J_1 = share M r^2 is what turns with the rotor, so that a stiff spring is `rigid` exactly. Friction
acts on the carriage. The angles are those of the screw; x is what the motor's encoder says.

Not modelled: stiffness that depends on where the carriage is, bending of the machine's base.

Source: Spong, Modeling and control of elastic joint robots, ASME J. Dyn. Sys. 1987, for one joint;
friction as in `rigid`.
"""

from __future__ import annotations

import math

import casadi as ca

from .. import screw_axis as qs
from ..component import Fidelity, Solver
from ..model import Model
from ..quantity import Quantity

FIDELITY = Fidelity(level=1, solver=Solver("rodas3", 2.5e-4))
SHARE = Quantity(
    "share", "1", "part of the moving mass that turns with the rotor", start=0.3, minimum=1e-3,
    maximum=0.999,
)  # fmt: skip
K = Quantity("k", "N.m/rad", "stiffness of the screw", start=1.0, minimum=1e-9)
D = Quantity("d", "N.m.s/rad", "damping of its twist", minimum=0.0, start=1e-4)
TWIST = Quantity("twist", "rad", "state: twist of the screw")
CARRIAGE = Quantity("w_c", "rad/s", "state: speed of the carriage over r", nominal=100.0)


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.TAU)
    p = m.parameters(qs.LEAD, qs.MASS, SHARE, K, D, qs.F_V, qs.F_C, qs.V_0, qs.F_0, qs.X_0)
    x = m.states(qs.ANGLE, TWIST, qs.SPEED, CARRIAGE)
    radius = p.lead / (2 * math.pi)
    whole = p.M * radius**2
    rotor = p.share * whole
    v, rate = radius * x.w_c, x.speed - x.w_c
    viscous = p.F_v * v
    dry = p.F_c * ca.tanh(v / p.v_0)
    spring = m.balance(
        "spring", "compliance", deflection=x.twist, rate=rate, stiffness=p.k, damping=p.d
    )
    tau_s = p.k * x.twist + p.d * rate - spring.effort
    turned = x.angle + p.x_0 / radius
    shaft = m.balance("screw", "rotation", velocity=x.w_c, angle=turned - x.twist, load=tau_s)
    motor = m.balance("rotor", "rotation", velocity=x.speed, angle=turned, load=u.tau)
    m.derivative(x.angle, x.speed)
    m.derivative(x.twist, rate)
    m.derivative(x.speed, (u.tau - tau_s + motor.effort) / rotor)
    m.derivative(x.w_c, (tau_s + radius * (p.F_0 - viscous - dry) + shaft.effort) / (whole - rotor))
    m.output(qs.W, x.speed)
    m.output(qs.PHI, x.angle)
    m.output(qs.X, radius * x.angle)
    m.port(qs.FLANGE, u.tau, x.speed)
    m.supply(p.F_0 * v)
    m.stored_energy(rotor * x.speed**2 / 2 + (whole - rotor) * x.w_c**2 / 2 + p.k * x.twist**2 / 2)
    m.loss("friction", (viscous + dry) * v)
    m.loss("spring", p.d * rate**2)
