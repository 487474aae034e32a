"""Viscous friction that differs between the two directions.

    f = b_d |v|,   P_loss = -b_d v |v|

It adds b_d to the viscous friction of backward motion and takes it off that of forward motion: with
a component's b the coefficients are b - b_d forward and b + b_d backward. Alone it would give power
in one direction; it is passive as long as |b_d| is below the viscous friction of the shaft.

Not modelled: the asymmetry of dry friction (`asymmetric_coulomb`).

Source: Janot, Gautier, Brunot, Data set and reference models of EMPS, Workshop on Nonlinear System
Identification Benchmarks, 2019 (F_v+ and F_v-).
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

DIFFERENCE = Quantity(
    "b_d",
    "N.m.s/rad",
    "half the viscous friction backward less that forward, 0 = absent",
    start=0.02,
    strength=True,
)

EFFECT = Effect(
    "asymmetric_viscous",
    "Viscous friction of a shaft that depends on the direction.",
    ("rotation",),
    DIFFERENCE,
    source="Janot 2019",
)


def law(e: EffectModel) -> None:
    """Add the friction torque."""
    velocity = e.signal("velocity")
    torque = e.parameter(DIFFERENCE) * ca.fabs(velocity)
    e.add(torque)
    e.loss(-torque * velocity)
