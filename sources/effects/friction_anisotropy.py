"""Friction that differs between the directions along and across a track or wheel.

    mu_across = mu_along (1 + k)

The force keeps its magnitude law per direction, f = -N (mu_along u_x, mu_across u_y)/|u|, and so
dissipates at every sliding velocity.

Not modelled: the turning of the force towards the direction of least friction that an elliptic
friction cone would add.

Source: grousers and tread patterns grip differently along and across, Wong, Theory of Ground
Vehicles, ch. 6 (separate longitudinal and lateral coefficients).
"""

from __future__ import annotations

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

EXCESS = Quantity(
    "excess",
    "1",
    "friction across relative to friction along, minus 1, 0 = absent",
    start=0.1,
    minimum=-1.0,
    strength=True,
)

EFFECT = Effect(
    "friction_anisotropy",
    "Friction that differs along and across a track or wheel.",
    ("coefficient",),
    EXCESS,
    needs=("longitudinal",),
    source="Wong, Theory of Ground Vehicles, ch. 6",
)


def law(e: EffectModel) -> None:
    """Change the coefficient across the track."""
    k, mu_along = e.parameter(EXCESS), e.signal("longitudinal")
    e.add(k * mu_along)
