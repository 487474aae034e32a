"""Coulomb friction, regularised around standstill.

    f = -f_c tanh(v / v_0),   P_loss = f_c v tanh(v / v_0)

`v_0` must be well below the speeds of interest; at standstill the law creeps instead of sticking
(`bristle` sticks). On an inertia J the friction reacts within v_0 J / f_c: where another component
owns the inertia, communication steps must stay below twice that.

Not modelled: stiction, dependence on load or temperature.

Source: Armstrong-Helouvry, Control of Machines with Friction, 1991, ch. 2.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

TAU_C = Quantity(
    "tau_c", "N.m", "Coulomb friction torque, 0 = absent", start=0.5, minimum=0.0, strength=True
)
W_0 = Quantity("w_0", "rad/s", "speed over which the sign is smoothed", start=2e-3, minimum=1e-6)

EFFECT = Effect(
    "coulomb", "Coulomb friction of a shaft.", ("rotation",), TAU_C, source="Armstrong 1991"
)


def law(e: EffectModel) -> None:
    """Add the friction torque."""
    p, v = e.parameters(f_c=TAU_C, v_0=W_0), e.signal("velocity")
    f = -p.f_c * ca.tanh(v / p.v_0)
    e.add(f)
    e.loss(-f * v)
