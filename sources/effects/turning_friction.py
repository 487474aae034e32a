"""Dry friction against the turning of a body, however it moves along.

    M = -M_t tanh(w_z / w_0),   P_loss = M_t w_z tanh(w_z / w_0)

about the body's vertical: a skirt, a hose or a tail that scrubs over the floor, or what a machine
that skids resists beyond the friction of its contacts. `pivot_torque` acts at one contact, and
fades where that rolls; this one turns no fork and does not fade.

Not modelled: stiction, a force beside the moment, dependence on the load.

Source: Armstrong-Helouvry, Control of Machines with Friction, 1991, ch. 2.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

M_T = Quantity(
    "M_t", "N.m", "friction torque against turning, 0 = absent", start=1.0, minimum=0.0,
    strength=True,
)  # fmt: skip
W_0 = Quantity("w_0", "rad/s", "yaw rate over which the sign is smoothed", start=0.01, minimum=1e-6)

EFFECT = Effect(
    "turning_friction",
    "Dry friction against the turning of a body.",
    ("body",),
    M_T,
    needs=("mass",),  # a body that stands on a floor gives it, a tool in a hand does not
    source="Armstrong 1991",
)


def law(e: EffectModel) -> None:
    """Add the torque about the vertical."""
    p, w = e.parameters(M_t=M_T, w_0=W_0), e.signal("rate")[2]
    M = -p.M_t * ca.tanh(w / p.w_0)
    e.add(ca.vertcat(ca.SX.zeros(5), M))
    e.loss(-M * w)
