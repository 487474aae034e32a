"""Viscous friction of cold grease that fades while the shaft turns.

    f = -b (1 - h) v,   t_w h' = v^2 / (v^2 + v_n^2) - h,   P_loss = b (1 - h) v^2

h is 0 cold and 1 warm. It rises with the time constant t_w at speeds above v_n and falls again at
rest. A negative b is friction that rises, f = -|b| h v; neither ever drives.

Not modelled: heat balance, ambient temperature.

Source: Bittencourt, Wernholt, Sander-Tavallaey, Brogårdh, An extended friction model to capture
load and temperature effects in robot joints, IROS 2010, reduced to one state.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.signal_effect import sized
from ..quantity import Quantity

COLD = Quantity(
    "b",
    "N.m.s/rad",
    "viscous friction of the cold shaft above the warm one, 0 = absent",
    start=0.05,
    strength=True,
)
WARM_UP = Quantity("t_w", "s", "time constant of warming up", start=60.0, minimum=1e-3)
W_N = Quantity("w_n", "rad/s", "speed that warms up halfway", start=1.0, minimum=1e-6)
WARMTH = Quantity("h", "1", "0 cold, 1 warm")

EFFECT = Effect(
    "temperature_drift",
    "Friction of a shaft that falls while it warms up.",
    ("rotation",),
    COLD,
    source="Bittencourt 2010",
)


def law(e: EffectModel) -> None:
    """Add the friction torque."""
    velocity, warmth = e.signal("velocity"), e.state(sized(e, WARMTH))
    target = velocity**2 / (velocity**2 + e.parameter(W_N) ** 2)
    e.derivative(warmth, (target - warmth) / e.parameter(WARM_UP))
    cold = e.parameter(COLD)
    torque = -(ca.fmax(cold, 0) * (1 - warmth) + ca.fmax(-cold, 0) * warmth) * velocity
    e.add(torque)
    e.loss(-torque * velocity)
