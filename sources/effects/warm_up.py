"""Viscous friction that fades with the time since the drives were switched on.

    b = b_warm (1 + k exp(-(t_on + t) / t_w))

`b_warm` is the coefficient without the effect and t the time of the simulation, which begins t_on
after the drives were switched on. Runs that began one after another differ by it, though each
alone hardly shows it.

Not modelled: how much the drives moved meanwhile (`temperature_drift`), ambient temperature.

Source: Bittencourt, Wernholt, Sander-Tavallaey, Brogårdh, An extended friction model to capture
load and temperature effects in robot joints, IROS 2010 (joints warm up exponentially).
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

K = Quantity(
    "k",
    "1",
    "viscous friction of the cold drive above the warm one, relative, 0 = absent",
    start=0.2,
    minimum=-0.95,
    maximum=20.0,
    strength=True,
)
T_W = Quantity(
    "t_w",
    "s",
    "time constant of warming up",
    start=120.0,
    minimum=5.0,
    maximum=5000.0,
    hints=SearchHints(decades=(5.0, 5000.0)),
)
T_ON = Quantity("t_on", "s", "time from switching on to t = 0", nominal=100.0)

EFFECT = Effect(
    "warm_up",
    "Viscous friction that falls with the time since the drives were switched on.",
    ("coefficient",),
    K,
    source="Bittencourt 2010",
    unit="N.m.s/rad",
)


def law(e: EffectModel) -> None:
    """Add what the cold drive has more."""
    p, b_warm = e.parameters(T_ON, T_W, K), e.signal("value")
    e.add(p.k * ca.exp(-(p.t_on + e.t) / p.t_w) * b_warm)
