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
    phi, w, w_2 = x.angle, x.speed, x.w_c
    r = p.lead / (2 * math.pi)
    whole = p.M * r**2
    j_1 = p.share * whole
    v_c, rate = r * w_2, w - w_2
    viscous = p.F_v * v_c
    dry = p.F_c * ca.tanh(v_c / p.v_0)
    spring = m.balance(
        "spring", "compliance", deflection=x.twist, rate=rate, stiffness=p.k, damping=p.d
    )
    tau_s = p.k * x.twist + p.d * rate - spring.effort
    turned = phi + p.x_0 / r
    shaft = m.balance("screw", "rotation", velocity=w_2, angle=turned - x.twist, load=tau_s)
    motor = m.balance("rotor", "rotation", velocity=w, angle=turned, load=u.tau)
    m.derivative(phi, w)
    m.derivative(x.twist, rate)
    m.derivative(w, (u.tau - tau_s + motor.effort) / j_1)
    m.derivative(w_2, (tau_s + r * (p.F_0 - viscous - dry) + shaft.effort) / (whole - j_1))
    m.output(qs.W, w)
    m.output(qs.PHI, phi)
    m.output(qs.X, r * phi)
    m.port(qs.FLANGE, u.tau, w)
    m.supply(p.F_0 * v_c)
    m.stored_energy(j_1 * w**2 / 2 + (whole - j_1) * w_2**2 / 2 + p.k * x.twist**2 / 2)
    m.loss("friction", (viscous + dry) * v_c)
    m.loss("spring", p.d * rate**2)
