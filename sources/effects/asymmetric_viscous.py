"""Viscous friction that differs between the two directions.

    f = b_d |v| - |b_d| v,   P_loss = |b_d| v^2 - b_d v |v|

It adds 2 |b_d| to the viscous friction of one direction: of backward motion if b_d is positive, of
forward motion if it is negative. With a component's b the coefficients are b and b + 2 |b_d|; it
never drives, whatever b is.

Not modelled: the asymmetry of dry friction (`asymmetric_coulomb`).

Source: Janot, Gautier, Brunot, Data set and reference models of EMPS, Workshop on Nonlinear System
Identification Benchmarks, 2019 (F_v+ and F_v-).
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

B_D = Quantity(
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
    B_D,
    source="Janot 2019",
)


def law(e: EffectModel) -> None:
    """Add the friction torque."""
    b_d, v = e.parameter(B_D), e.signal("velocity")
    f = b_d * ca.fabs(v) - ca.fabs(b_d) * v
    e.add(f)
    e.loss(-f * v)
