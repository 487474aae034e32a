"""Signals of a balance that a law without a name may depend on."""

from __future__ import annotations

from ..effect import KINDS
from ..effect_model import EffectModel

STATIC = ("position", "gravity")
"""Kinds of balances that a component takes as constant in time: a mass centre that moves would have
to be accelerated, which no equation accounts for."""
MOVING = tuple(kind for kind in KINDS if kind not in STATIC)
"""The other kinds."""
SIDE = ("longitudinal", "side", "radius", "resistance", "emf_constant", "stiffness", "mass")
"""Signals that hardly vary or mean a configuration."""


def drivers(e: EffectModel) -> list[str]:
    """Scalar signals of the balance that may drive a law, those that every one has first."""
    kind = KINDS[e.kind]
    names = [*kind.signals, *kind.optional]
    return [n for n in names if n not in SIDE and e.offers(n) and e.signal(n).numel() == 1]
