"""Winding that heats up with its losses and so gains resistance.

    R = R_0 (1 + alpha r_th p),   t_th p' = R i^2 - p,   temperature rise = r_th p
    f = -(R - R_0) i,   P_loss = (R - R_0) i^2

p is the copper loss behind the thermal time constant; `R_0` is the resistance at the temperature at
which `p = 0`.

Not modelled: iron and friction losses as heat sources, weaker magnets, a housing with a second time
constant.

Source: thermal model of first order, Leonhard, Control of Electrical Drives, 2001, ch. 4.
"""

from __future__ import annotations

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.signal_effect import sized
from ..quantity import Quantity

R_TH = Quantity(
    "r_th",
    "K/W",
    "thermal resistance of the winding to ambient, 0 = absent",
    start=1.5,
    minimum=0.0,
    strength=True,
)
T_TH = Quantity(
    "t_th",
    "s",
    "thermal time constant",
    start=60.0,
    minimum=1e-3,
    hints=SearchHints(decades=(0.5, 1000.0)),
)
ALPHA = Quantity("alpha", "1/K", "temperature coefficient of resistance, copper", start=0.00393)
P = Quantity("p", "W", "copper loss behind the thermal time constant", nominal=10.0)
RISE = Quantity("rise", "K", "temperature rise of the winding")

EFFECT = Effect(
    "winding_heating",
    "Resistance of a winding that rises with its temperature.",
    ("winding",),
    R_TH,
    needs=("resistance",),
    source="Leonhard 2001",
)


def law(e: EffectModel) -> None:
    """Add the voltage across the additional resistance."""
    k = e.parameters(R_TH, ALPHA, T_TH)  # p is the copper loss
    s = e.signals(i="current", R_0="resistance")
    p = e.state(sized(e, P))
    rise = e.output(sized(e, RISE), k.r_th * p)
    added = s.R_0 * k.alpha * rise
    e.derivative(p, ((s.R_0 + added) * s.i**2 - p) / k.t_th)
    e.add(-added * s.i)
    e.loss(added * s.i**2)
