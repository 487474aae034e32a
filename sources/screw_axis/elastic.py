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

from ..component import Fidelity, Solver
from ..model import Model
from ..quantity import Quantity
from . import ANGLE, F_0, F_C, F_V, FLANGE, LEAD, MASS, PHI, SPEED, TAU, V_0, X_0, W, X

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
    torque = m.input(TAU)
    radius = m.parameter(LEAD) / (2 * math.pi)
    whole = m.parameter(MASS) * radius**2
    rotor = m.parameter(SHARE) * whole
    stiffness, damping = m.parameter(K), m.parameter(D)
    angle, twist = m.state(ANGLE), m.state(TWIST)
    speed, carriage = m.state(SPEED), m.state(CARRIAGE)
    v, rate = radius * carriage, speed - carriage
    viscous = m.parameter(F_V) * v
    dry = m.parameter(F_C) * ca.tanh(v / m.parameter(V_0))
    offset = m.parameter(F_0)
    spring = m.balance(
        "spring", "compliance", deflection=twist, rate=rate, stiffness=stiffness, damping=damping
    )
    tau_s = stiffness * twist + damping * rate - spring.effort
    turned = angle + m.parameter(X_0) / radius
    shaft = m.balance("screw", "rotation", velocity=carriage, angle=turned - twist, load=tau_s)
    motor = m.balance("rotor", "rotation", velocity=speed, angle=turned, load=torque)
    m.derivative(angle, speed)
    m.derivative(twist, rate)
    m.derivative(speed, (torque - tau_s + motor.effort) / rotor)
    m.derivative(
        carriage, (tau_s + radius * (offset - viscous - dry) + shaft.effort) / (whole - rotor)
    )
    m.output(W, speed)
    m.output(PHI, angle)
    m.output(X, radius * angle)
    m.port(FLANGE, torque, speed)
    m.supply(offset * v)
    m.stored_energy(
        rotor * speed**2 / 2 + (whole - rotor) * carriage**2 / 2 + stiffness * twist**2 / 2
    )
    m.loss("friction", (viscous + dry) * v)
    m.loss("spring", damping * rate**2)
