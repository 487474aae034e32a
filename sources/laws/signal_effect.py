"""What effects on signals have in common."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca

from cosim.spec.units import per_second

from ..effect_model import EffectModel
from ..quantity import Quantity
from ..units import base_exponents, coherent

SX = Any

SHARE = Quantity("share", "1", "part of the effect that each element of the signal gets", start=1.0)


def in_unit(e: EffectModel, quantity: Quantity) -> Quantity:
    """A quantity declared with the unit of the balance."""
    return replace(quantity, unit=e.unit)


def per_time(e: EffectModel, quantity: Quantity) -> Quantity:
    """A quantity declared with the unit of the balance per second."""
    return replace(quantity, unit=per_second(e.unit))


def per_unit(e: EffectModel, quantity: Quantity) -> Quantity:
    """A quantity declared with its own unit per unit of the balance."""
    exponents = base_exponents(coherent(quantity.unit))
    for base, exponent in base_exponents(coherent(e.unit)).items():
        exponents[base] = exponents.get(base, 0) - exponent
    unit = ".".join(f"{base}{n if n != 1 else ''}" for base, n in exponents.items() if n)
    return replace(quantity, unit=unit or "1")


def sized(e: EffectModel, quantity: Quantity) -> Quantity:
    """A quantity with as many elements as the signal."""
    return replace(quantity, size=0 if e.size == 1 else e.size)


def share(e: EffectModel) -> SX:
    """1 for a scalar signal; for a vector a parameter per element, 1 unless set."""
    if e.size == 1:
        return ca.SX(1.0)
    return e.parameter(replace(SHARE, size=e.size))
