"""Friction of a gear in proportion to the torques on both of its sides, greater at low speed.

    f = -mu p (1 + g p) (1 + e exp(-(v / v_s)^2)) s,   p = |tau_m - r tau_e|,   s = tanh(v / v_0)
    P_loss = -f v

tau_m is the motor's torque behind the gear, tau_e that of weight and process on its output: the
teeth of a gear that holds a load are pressed together even where the motor has let go. With r,
e and g = 0 it is `load_friction`. `v_0` must be well below `v_s`.

Not modelled: what accelerations add to the torque on the teeth, friction without load (`coulomb`,
`stribeck`); at standstill the law creeps instead of sticking.

Source: Duclusaud, Passault, Padois, Ly, Extended friction models for the physics simulation of
servo actuators, ICRA 2025 (load-dependent Stribeck models, motor and external torque weighted
apart).
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

MU = Quantity(
    "mu",
    "1",
    "friction torque per torque of the motor, 0 = absent",
    start=0.1,
    minimum=0.0,
    strength=True,
)
R = Quantity(
    "r", "1", "weight of the output's torque, that of the motor's being 1", start=0.5, minimum=0.0
)
E = Quantity(
    "e", "1", "friction close to standstill over the sliding one, less 1", start=0.2, minimum=0.0
)
G = Quantity(
    "g", "1/(N.m)", "growth of the friction coefficient with the torque on the teeth", minimum=0.0
)
W_S = Quantity(
    "w_s",
    "rad/s",
    "speed over which that excess decays",
    start=0.5,
    minimum=1e-6,
    hints=SearchHints(decades=(0.01, 30.0)),
)
W_0 = Quantity("w_0", "rad/s", "speed over which the sign is smoothed", start=2e-3, minimum=1e-6)

EFFECT = Effect(
    "gear_friction",
    "Friction of a gear in proportion to the torques on both of its sides.",
    ("rotation",),
    MU,
    needs=("load", "reaction"),
    source="Duclusaud 2025",
)


def law(e: EffectModel) -> None:
    """Add the friction torque."""
    k = e.parameters(r=R, e=E, v_s=W_S, g=G, mu=MU, v_0=W_0)  # p is the torque on the teeth
    v, tau_m, tau_e = e.signal("velocity"), e.signal("load"), e.signal("reaction")
    p = ca.fabs(tau_m - k.r * tau_e)
    low = 1 + k.e * ca.exp(-((v / k.v_s) ** 2))
    pressed = p * (1 + k.g * p)
    f = -k.mu * pressed * low * ca.tanh(v / k.v_0)
    e.add(f)
    e.loss(-f * v)
