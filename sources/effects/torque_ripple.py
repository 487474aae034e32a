"""Torque constant that varies with the angle: commutation ripple.

    k = K (1 + r cos(n theta + psi))

Torque and back-EMF use the same k, so their powers stay equal.

Not modelled: harmonics of the ripple, phase currents.

Source: Hanselman, Brushless Permanent Magnet Motor Design, 2006, ch. 8.
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.angle import ANGLE, shown_angle
from ..quantity import Quantity

R = Quantity("r", "1", "amplitude over the torque constant, 0 = absent", start=0.03, strength=True)
N = Quantity(
    "n",
    "1",
    "cycles per revolution of the motor",
    start=12.0,
    minimum=0.1,
    hints=SearchHints(cycles=ANGLE.name),
)
PSI = Quantity("psi", "rad", "phase at angle 0", hints=SearchHints(mix="turn"))

EFFECT = Effect(
    "torque_ripple",
    "Torque constant that repeats with the angle.",
    ("coefficient",),
    R,
    needs=("turning",),
    source="Hanselman 2006",
    unit="N.m/A",
)


def law(e: EffectModel) -> None:
    """Add the variation of the constant."""
    p, K = e.parameters(N, PSI, R), e.signal("value")
    theta = shown_angle(e, "turning")
    e.add(p.r * K * ca.cos(p.n * theta + p.psi))
