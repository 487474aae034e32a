"""What passes between two FMUs, handed on as it is: room for effects where an FMU has none."""

from __future__ import annotations

from typing import Any

from cosim.spec import units

from ..component import Component
from ..model import Model
from ..quantity import Quantity

SX = Any
UNIT = units.ANY
"""Of a signal whose unit is that of the value."""
COMPONENT = Component(
    "adapter",
    "A value on its way from one FMU to another, passed on as it is.",
    source="definition",
    energy=False,
    relay=True,
)
SIGN = Quantity(
    "sign",
    "1",
    "+1 where a positive value accelerates what moves, -1 where it brakes",
    start=1.0,
    minimum=-1.0,
    maximum=1.0,
)


def pass_on(m: Model, taken: Quantity, value: SX) -> SX:
    """The value with what effects on the signal add to it."""
    return value + m.balance("value", "signal", unit=taken.unit, value=value, sensor=taken).effort


def push(
    m: Model, effort: Quantity, taken: Quantity, kind: str, motion: tuple[Quantity, Quantity]
) -> None:
    """Hand an effort on, with what effects on the motion beside it and on the signal add to it.

    Args:
        m: the model.
        effort, taken: as it is given, an input, and as it is taken, an output.
        kind: of the balance.
        motion: speed, an input, and the place that its integral is.
    """
    value, speed, sign = m.input(effort), m.input(motion[0]), m.parameter(SIGN)
    place = m.state(motion[1])
    m.derivative(place, speed)
    name = "angle" if kind == "rotation" else "position"
    signals = {"velocity": speed, name: place, "load": sign * value}
    inside = m.balance("inside", kind, **signals)
    m.output(taken, pass_on(m, taken, value) + sign * inside.effort)
