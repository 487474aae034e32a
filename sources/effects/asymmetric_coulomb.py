"""Coulomb friction that differs between the two directions of rotation.

    f = -f_c (1 + a sgn v) tanh(v / v_0),   P_loss = -f v

Friction is f_c (1 + a) forward and f_c (1 - a) backward, each regularised as `coulomb` is; a = 1 is
friction forward only.

Not modelled: stiction; the asymmetry of viscous friction.

Source: Janot, Gautier, Brunot, Data set and reference models of EMPS, Workshop on Nonlinear System
Identification Benchmarks, 2019 (offset between the directions).
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

TAU_C = Quantity(
    "tau_c",
    "N.m",
    "Coulomb friction torque, mean of both directions, 0 = absent",
    start=0.3,
    minimum=0.0,
    strength=True,
)
A = Quantity(
    "a",
    "1",
    "half the difference of the directions over the mean, positive: more forward",
    start=1.0,
    minimum=-1.0,
    maximum=1.0,
    hints=SearchHints(mix="shift"),
)
W_0 = Quantity("w_0", "rad/s", "speed over which the sign is smoothed", start=2e-3, minimum=1e-6)

EFFECT = Effect(
    "asymmetric_coulomb",
    "Coulomb friction of a shaft that depends on the direction.",
    ("rotation",),
    TAU_C,
    source="Janot 2019",
    contains=("coulomb",),
)


def law(e: EffectModel) -> None:
    """Add the friction torque."""
    p, v = e.parameters(a=A, f_c=TAU_C, v_0=W_0), e.signal("velocity")
    f = -p.f_c * (1 + p.a * ca.sign(v)) * ca.tanh(v / p.v_0)
    e.add(f)
    e.loss(-f * v)
