"""Pseudo-random numbers that every implementation of a model draws alike.

Two linear congruential generators are combined:

    a_{k+1} = 40014 a_k mod 2147483563,   b_{k+1} = 40692 b_k mod 2147483399
    u = ((a - b) mod 2147483562) / 2147483563,   in (0, 1), period 2.3e18

All products stay below 2^53, so the arithmetic is exact in doubles. Normal numbers come in pairs:

    n_1 = sqrt(-2 ln u_1) cos(2 pi u_2),   n_2 = sqrt(-2 ln u_1) sin(2 pi u_2)

Source: L'Ecuyer 1988, Communications of the ACM 31(6), Fig. 3; Box and Muller 1958.
"""

from __future__ import annotations

import math
import zlib
from typing import Any

import casadi as ca

from ..quantity import Quantity

SX = Any
_A1, _M1 = 40014.0, 2147483563.0
_A2, _M2 = 40692.0, 2147483399.0
_WARM_UP = 4  # numbers thrown away, so that neighbouring seeds do not start alike

RANDOM = Quantity("random", "1", "state of the random numbers, 0 = not seeded yet", size=2)


def seed_quantity(name: str) -> Quantity:
    """The parameter `seed`; its default differs from name to name."""
    return Quantity(
        "seed",
        "1",
        "whole number that selects the random numbers; give every instance its own",
        start=float(1 + zlib.crc32(name.encode()) % 1_000_000),
        minimum=1.0,
        maximum=2147483398.0,
        variability="fixed",
    )


def _modulo(value: SX, modulus: float) -> SX:
    return value - modulus * ca.floor(value / modulus)


class Random:
    """Draws numbers from a sampled state; put `state` into the update of the clock at the end.

    Args:
        state: the two sampled values of `RANDOM`; they are seeded where they are 0.
        seed: a whole number.
    """

    def __init__(self, state: SX, seed: SX) -> None:
        seed = ca.floor(seed + 0.5)
        a = 1.0 + _modulo(seed * _A1, _M1 - 1.0)
        b = 1.0 + _modulo(seed * _A2, _M2 - 1.0)
        for _ in range(_WARM_UP):
            a, b = _modulo(_A1 * a, _M1), _modulo(_A2 * b, _M2)
        self._a = ca.if_else(state[0] > 0, state[0], a)
        self._b = ca.if_else(state[1] > 0, state[1], b)

    @property
    def state(self) -> SX:
        """The state after all draws so far."""
        return ca.vertcat(self._a, self._b)

    def uniform(self) -> SX:
        """One number between 0 and 1, both excluded."""
        self._a, self._b = _modulo(_A1 * self._a, _M1), _modulo(_A2 * self._b, _M2)
        difference = self._a - self._b
        return ca.if_else(difference < 1.0, difference + _M1 - 1.0, difference) / _M1

    def normals(self, count: int) -> SX:
        """A column of independent standard normal numbers."""
        drawn: list[SX] = []
        while len(drawn) < count:
            radius = ca.sqrt(-2.0 * ca.log(self.uniform()))
            angle = 2.0 * math.pi * self.uniform()
            drawn += [radius * ca.cos(angle), radius * ca.sin(angle)]
        return ca.vertcat(*drawn[:count])
