"""Amplifier that gives no voltage for small commands: pulses too short to switch.

    f = -sat(u, u_dz)

The winding sees u - sat(u, u_dz). What it does not get is not drawn from the supply either, so
nothing is lost. The distortion by dead time, which follows the sign of the current instead of the
command's, is `brush_drop`.

Not modelled: current ripple, discontinuous conduction.

Source: Mohan, Undeland, Robbins, Power Electronics, 2003, ch. 8.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

U_DZ = Quantity(
    "u_dz", "V", "half width of the dead zone, 0 = absent", start=0.5, minimum=0.0, strength=True
)

EFFECT = Effect(
    "pwm_dead_zone",
    "Dead zone of the amplifier's voltage.",
    ("winding",),
    U_DZ,
    needs=("voltage",),
    source="Mohan 2003",
)


def law(e: EffectModel) -> None:
    """Add the missing voltage."""
    u_dz, s = e.parameter(U_DZ), e.signals(u="voltage", i="current")
    sat = ca.fmax(-u_dz, ca.fmin(s.u, u_dz))
    e.add(-sat)
    e.supply(-sat * s.i)
    e.loss(0)
