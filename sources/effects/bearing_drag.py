"""Drag of grease in a rolling bearing, growing with the 2/3 power of speed.

    tau = -tau_ref u (u^2 + u_0^2)^(-1/6),   u = w/w_ref,   P_loss = -tau w

Below u_0 w_ref the drag is viscous, so that its slope at standstill is finite.

Not modelled: load-dependent friction of the races (`load_friction`), seals (`coulomb`), warm-up.

Source: Palmgren, Ball and Roller Bearing Engineering, 1959; Harris, Kotzalas, Essential Concepts of
Bearing Technology, 2006, ch. 10.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

TAU_REF = Quantity(
    "tau_ref", "N.m", "drag torque at w_ref, 0 = absent", start=0.05, minimum=0.0, strength=True
)
W_REF = Quantity("w_ref", "rad/s", "reference speed", start=10.0, minimum=1e-3)
U_0 = Quantity(
    "u_0", "1", "speed over w_ref below which the drag is viscous", start=0.01, minimum=1e-6
)

EFFECT = Effect(
    "bearing_drag", "Grease drag of a bearing.", ("rotation",), TAU_REF, source="Palmgren 1959"
)


def law(e: EffectModel) -> None:
    """Add the drag."""
    p, w = e.parameters(W_REF, TAU_REF, U_0), e.signal("velocity")
    u = w / p.w_ref
    tau = -p.tau_ref * u * (u**2 + p.u_0**2) ** (-1 / 6)
    e.add(tau)
    e.loss(-ca.dot(tau, w))
