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

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.signal_effect import sized
from ..quantity import Quantity

B = Quantity(
    "b",
    "N.m.s/rad",
    "viscous friction of the cold shaft above the warm one, 0 = absent",
    start=0.05,
    strength=True,
)
T_W = Quantity(
    "t_w",
    "s",
    "time constant of warming up",
    start=60.0,
    minimum=1e-3,
    hints=SearchHints(decades=(0.5, 1000.0)),
)
W_N = Quantity("w_n", "rad/s", "speed that warms up halfway", start=1.0, minimum=1e-6)
H = Quantity("h", "1", "0 cold, 1 warm")

EFFECT = Effect(
    "temperature_drift",
    "Friction of a shaft that falls while it warms up.",
    ("rotation",),
    B,
    source="Bittencourt 2010",
    contains=("viscous",),  # what has not begun to warm up
)


def law(e: EffectModel) -> None:
    """Add the friction torque."""
    p, v = e.parameters(v_n=W_N, t_w=T_W, b=B), e.signal("velocity")
    h = e.state(sized(e, H))
    e.derivative(h, (v**2 / (v**2 + p.v_n**2) - h) / p.t_w)
    f = -(ca.fmax(p.b, 0) * (1 - h) + ca.fmax(-p.b, 0) * h) * v
    e.add(f)
    e.loss(-f * v)
