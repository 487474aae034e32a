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

from .. import gearbox as qs
from ..component import Fidelity, Solver
from ..model import Model
from ..quantity import Quantity

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
    limits={"ratio": {"signed": 0.0, "P_0": qs.P_0.starts()[0]}, "lossy": {"signed": 1.0}},
)


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.TAU_A, qs.W_B)
    p = m.parameters(qs.RATIO, qs.ETA, qs.B, K, D, qs.J_A, qs.P_0, SIGNED)
    x = m.states(TWIST, ROTOR_SPEED)
    # A rotor without inertia would have no finite acceleration.
    j_a = ca.fmax(p.J_a, SMALLEST_ROTOR)
    w_a = x.rotor_speed

    ripple = m.balance("ratio", "coefficient", unit="1", value=p.ratio, turning=u.w_b)
    ratio = p.ratio + ripple.effort
    rate = w_a / ratio - u.w_b
    spring = m.balance(
        "spring", "compliance", deflection=x.twist, rate=rate, stiffness=p.k, damping=p.d
    )
    tau_s = p.k * x.twist + p.d * rate - spring.effort
    flange_b = m.balance("flange_b", "rotation", velocity=u.w_b, load=tau_s)
    flange_a = m.balance("flange_a", "rotation", velocity=w_a, load=u.tau_a)
    into_mesh = u.tau_a + flange_a.effort
    s = 1 - p.signed * (1 - ca.tanh(into_mesh * w_a / p.P_0))
    factor = p.eta**s
    m.derivative(x.twist, rate)
    m.derivative(w_a, (factor * into_mesh - tau_s / ratio) / j_a)
    tau_b = tau_s - p.b * u.w_b + flange_b.effort
    m.output(qs.W_A, w_a)
    m.output(qs.TAU_B, tau_b)
    m.output(qs.J_B, 0.0)
    m.port(qs.FLANGE_A, u.tau_a, w_a)
    m.port(qs.FLANGE_B, tau_b, u.w_b)
    m.stored_energy(j_a * w_a**2 / 2 + p.k * x.twist**2 / 2)
    m.loss("mesh", (1 - factor) * into_mesh * w_a)
    m.loss("bearings", p.b * u.w_b**2)
    m.loss("spring", p.d * rate**2)
