"""Stribeck friction: what friction exceeds its sliding value at low speed.

    f = -f_s exp(-(v / v_s)^2) tanh(v / v_0),   P_loss = -f v

It adds to the Coulomb and viscous friction of the component or of other effects. `v_0` must be well
below `v_s`, and `v_s` below the speeds of interest; at standstill the law creeps instead of
sticking (`bristle` sticks).

Not modelled: memory of the friction, dependence on load.

Source: Armstrong-Helouvry, Control of Machines with Friction, 1991, ch. 2.
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

TAU_S = Quantity(
    "tau_s",
    "N.m",
    "friction torque close to standstill above the sliding one, 0 = absent",
    start=0.3,
    minimum=0.0,
    strength=True,
)
W_S = Quantity(
    "w_s",
    "rad/s",
    "speed over which the excess decays",
    start=0.5,
    minimum=1e-6,
    hints=SearchHints(decades=(0.01, 30.0)),
)
W_0 = Quantity("w_0", "rad/s", "speed over which the sign is smoothed", start=2e-3, minimum=1e-6)

EFFECT = Effect(
    "stribeck",
    "Friction of a shaft that falls with speed.",
    ("rotation",),
    TAU_S,
    source="Armstrong 1991",
)


def law(e: EffectModel) -> None:
    """Add the friction torque."""
    p, v = e.parameters(v_s=W_S, f_s=TAU_S, v_0=W_0), e.signal("velocity")
    f = -p.f_s * ca.exp(-((v / p.v_s) ** 2)) * ca.tanh(v / p.v_0)
    e.add(f)
    e.loss(-f * v)
