"""Cogging: the magnets' preference for some angles, without current.

    f = -f_c sin(n theta + psi),   E = f_c (1 - cos(n theta + psi)) / n

Conservative; n counts cycles per revolution of the shaft it is attached to, so it need not be
an integer when that is the slow side of a gearbox. Axles and swivels of wheels have no magnets:
it acts on the shafts of what drives them.

Not modelled: harmonics of the ripple.

Source: Hanselman, Brushless Permanent Magnet Motor Design, 2006, ch. 4.
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.angle import ANGLE, shown_angle
from ..quantity import Quantity

TAU_C = Quantity("tau_c", "N.m", "amplitude of the torque, 0 = absent", start=0.05, strength=True)
N = Quantity(
    "n",
    "1",
    "cycles per revolution of the shaft",
    start=12.0,
    minimum=0.1,
    hints=SearchHints(cycles=ANGLE.name),
)
PSI = Quantity("psi", "rad", "phase at angle 0", hints=SearchHints(mix="turn"))

EFFECT = Effect(
    "cogging",
    "Torque of a shaft that repeats with its angle.",
    ("rotation",),
    TAU_C,
    unless=("normal", "radius"),
    source="Hanselman 2006",
)


def law(e: EffectModel) -> None:
    """Add the torque."""
    p, theta = e.parameters(f_c=TAU_C, n=N, psi=PSI), shown_angle(e, "velocity")
    argument = p.n * theta + p.psi
    e.add(-p.f_c * ca.sin(argument))
    e.stored_energy(p.f_c * (1 - ca.cos(argument)) / p.n)
    e.loss(0)
