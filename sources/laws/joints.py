"""The joints of a device: how many there are, and which of them slide instead of turning."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca

from ..component import Port
from ..model import Model
from ..quantity import Quantity

SX = Any

ALONG = {
    "rad": "m",
    "rad/s": "m/s",
    "rad/s2": "m/s2",
    "N.m": "N",
    "kg.m2": "kg",
    "N.m/rad": "N/m",
    "N.m.s/rad": "N.s/m",
    "N.m/A": "N/A",
    "N.m/(rad.s)": "N/(m.s)",
}
"""Unit at a joint that turns -> unit at one that slides."""
_SIX = (0.0,) * 6


@dataclass(frozen=True)
class Joints:
    """Joints of a device.

    Attributes:
        prismatic: for each joint, whether it slides.
    """

    prismatic: tuple[bool, ...]

    @classmethod
    def of_device(cls, m: Model) -> Joints:
        """Those that the device file's `prismatic` tells; six revolute ones without it."""
        return cls(tuple(bool(flag) for flag in m.given("prismatic", _SIX)))

    def __len__(self) -> int:
        return len(self.prismatic)

    def __iter__(self) -> Iterator[int]:
        return iter(range(len(self.prismatic)))

    def sized(self, quantity: Quantity) -> Quantity:
        """A vector with one element per joint, in the units of each."""
        size = len(self.prismatic)
        start = quantity.start
        if isinstance(start, tuple) and len(start) != size:
            start = 0.0
        if not any(self.prismatic) or quantity.unit not in ALONG:
            return replace(quantity, size=size, start=start)
        along = ALONG[quantity.unit]
        units = tuple(along if flag else quantity.unit for flag in self.prismatic)
        return replace(quantity, size=size, start=start, unit="1", units=units)

    def port(self, port: Port) -> Port:
        """A port whose effort and flow have one element per joint."""
        return replace(port, effort=self.sized(port.effort), flow=self.sized(port.flow))

    def efforts(self, m: Model, *, speed: SX, angle: SX, load: SX) -> SX:
        """Open the balances of the joints, together (if all turn) and one by one.

        Returns what effects add to the joints.
        """
        total = ca.SX.zeros(len(self))
        if not any(self.prismatic):
            total = m.balance("joint", "rotation", velocity=speed, angle=angle, load=load).effort
        single = []
        for i, slides in enumerate(self.prismatic):
            name = f"joint_{i + 1}"
            if slides:
                balance = m.balance(
                    name, "translation", velocity=speed[i], position=angle[i], load=load[i]
                )
            else:
                balance = m.balance(
                    name, "rotation", velocity=speed[i], angle=angle[i], load=load[i]
                )
            single.append(balance.effort)
        return total + ca.vertcat(*single)
