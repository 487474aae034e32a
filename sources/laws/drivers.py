"""Signals of a balance that a law without a name may depend on."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from ..effect import KINDS
from ..effect_model import EffectModel
from ..model import SX
from ..quantity import Quantity

STATIC = ("position", "gravity")
"""Kinds of balances that a component takes as constant in time: a mass centre that moves would have
to be accelerated, which no equation accounts for."""
MANY = ("picture",)
"""Kinds of many points, each of which would have a curve of its own."""
MOVING = tuple(kind for kind in KINDS if kind not in (*STATIC, *MANY))
"""The other kinds."""
SIDE = ("longitudinal", "side", "radius", "resistance", "emf_constant", "stiffness", "mass")
"""Signals that hardly vary or mean a configuration."""


def drivers(e: EffectModel, share: SX) -> dict[str, SX]:
    """Scalar signals of the balance that may drive a law, those that every one has first.

    Of a body that is its velocity along the effort, share . (velocity, rate).

    Args:
        e: the effect.
        share: part of the effort that each element of the balance gets.
    """
    if e.kind == "body":
        return {"velocity": ca.dot(share, ca.vertcat(e.signal("velocity"), e.signal("rate")))}
    kind = KINDS[e.kind]
    names = [n for n in (*kind.signals, *kind.optional) if n not in SIDE and e.offers(n)]
    return {n: e.signal(n) for n in names if e.signal(n).numel() == 1}


def shared(e: EffectModel, share: Quantity) -> SX:
    """Parts of an effort that each element of a balance gets, 1 where it has one."""
    size = 6 if e.kind == "body" else e.size
    return e.parameter(replace(share, size=size)) if size > 1 else ca.SX(1)
