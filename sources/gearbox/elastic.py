"""Rotor, lossy mesh and an elastic output shaft: a two-mass drive together with its load.

    twist' = w_a / ratio - w_b
    J_a w_a' = eta^s tau_a - tau_s / ratio,   tau_s = k twist + d twist'
    tau_b = tau_s - b w_b,   J_b = 0
    s = 1 - signed (1 - tanh(tau_a w_a / P_0))

The efficiency acts on the motor's torque, so that a stiff spring gives `lossy` (`signed = 1`) or
`ratio` (`signed = 0`, the papers' constant factor, which gains power while braking). With a load
of inertia J the twist oscillates at sqrt(k (1/J + 1/(ratio^2 J_a))).
A Jacobi exchange with the load every H seconds takes k H (1/J) / (1/J + 1/(ratio^2 J_a)) from the
damping d; a Gauss-Seidel exchange takes none.

Not modelled: backlash (effect), stiffness that depends on load, distributed mass of the gears.

Source: Spong, Modeling and control of elastic joint robots, ASME J. Dyn. Sys. 1987, for one joint;
efficiency as in `lossy`.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity, Solver
from ..model import Model
from ..quantity import Quantity
from . import ETA, FLANGE_A, FLANGE_B, J_A, J_B, P_0, RATIO, TAU_A, TAU_B, W_A, W_B, B

K = Quantity(
    "k", "N.m/rad", "torsional stiffness, seen at flange b", start=6000.0, minimum=1e-6, nominal=1e3
)
D = Quantity("d", "N.m.s/rad", "damping of the twist", start=1.1, minimum=0.0)
SIGNED = Quantity(
    "signed",
    "1",
    "1: the efficiency follows the power flow, 0: it multiplies the torque in both directions",
    start=1.0,
    minimum=0.0,
    maximum=1.0,
)
TWIST = Quantity(
    "twist", "rad", "twist, angle of the rotor over the ratio less that of the load", nominal=1e-3
)
ROTOR_SPEED = Quantity("rotor_speed", "rad/s", "state: speed of the rotor", nominal=100.0)
SMALLEST_ROTOR = 1e-9
FIDELITY = Fidelity(
    level=2,
    solver=Solver("rodas3", 1e-4),
    stiff=K,
    limits={"ratio": {"signed": 0.0, "P_0": P_0.starts()[0]}, "lossy": {"signed": 1.0}},
)


def equations(m: Model) -> None:
    """Collect the equations."""
    tau_a, w_b = m.input(TAU_A), m.input(W_B)
    nominal, eta, friction = m.parameter(RATIO), m.parameter(ETA), m.parameter(B)
    stiffness, damping = m.parameter(K), m.parameter(D)
    # A rotor without inertia would have no finite acceleration.
    inertia = ca.fmax(m.parameter(J_A), SMALLEST_ROTOR)
    twist, w_a = m.state(TWIST), m.state(ROTOR_SPEED)

    ripple = m.balance("ratio", "coefficient", unit="1", value=nominal, speed=w_b)
    ratio = nominal + ripple.effort
    rate = w_a / ratio - w_b
    spring = m.balance(
        "spring", "compliance", deflection=twist, rate=rate, stiffness=stiffness, damping=damping
    )
    tau_s = stiffness * twist + damping * rate - spring.effort
    flange_b = m.balance("flange_b", "rotation", velocity=w_b, load=tau_s)
    flange_a = m.balance("flange_a", "rotation", velocity=w_a, load=tau_a)
    into_mesh = tau_a + flange_a.effort
    follows = ca.tanh(into_mesh * w_a / m.parameter(P_0))
    factor = eta ** (1 - m.parameter(SIGNED) * (1 - follows))
    m.derivative(twist, rate)
    m.derivative(w_a, (factor * into_mesh - tau_s / ratio) / inertia)
    tau_b = tau_s - friction * w_b + flange_b.effort
    m.output(W_A, w_a)
    m.output(TAU_B, tau_b)
    m.output(J_B, 0.0)
    m.port(FLANGE_A, tau_a, w_a)
    m.port(FLANGE_B, tau_b, w_b)
    m.stored_energy(inertia * w_a**2 / 2 + stiffness * twist**2 / 2)
    m.loss("mesh", (1 - factor) * into_mesh * w_a)
    m.loss("bearings", friction * w_b**2)
    m.loss("spring", damping * rate**2)
