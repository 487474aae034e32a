"""Friction in proportion to the transmitted torque, as in gears and loaded bearings.

    f = -mu |tau| tanh(v / v_0),   P_loss = mu |tau| v tanh(v / v_0)

It takes power in both directions of power flow: a gearbox of efficiency eta loses as much as
mu = 1 - eta while driving.

Not modelled: friction without load, lubrication.

Source: Waiboer, Aarts, Jonker, Velocity dependence of joint friction in robotic manipulators with
gear transmissions, ECCOMAS Multibody Dynamics, 2005.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

MU = Quantity(
    "mu",
    "1",
    "friction torque per transmitted torque, 0 = absent",
    start=0.05,
    minimum=0.0,
    strength=True,
)
W_0 = Quantity("w_0", "rad/s", "speed over which the sign is smoothed", start=2e-3, minimum=1e-6)

EFFECT = Effect(
    "load_friction",
    "Friction of a shaft in proportion to the torque that it transmits.",
    ("rotation",),
    MU,
    needs=("load",),
    source="Waiboer 2005",
)


def law(e: EffectModel) -> None:
    """Add the friction torque."""
    p, s = e.parameters(mu=MU, v_0=W_0), e.signals(v="velocity", tau="load")
    f = -p.mu * ca.fabs(s.tau) * ca.tanh(s.v / p.v_0)
    e.add(f)
    e.loss(-f * s.v)
