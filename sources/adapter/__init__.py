"""What passes between two FMUs, handed on as it is: room for effects where an FMU has none."""

from __future__ import annotations

from ..component import Component
from ..model import Model
from ..quantity import Quantity

U, Y = "u", "y"
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


def pass_on(m: Model, unit: str, what: str) -> None:
    """Hand a value on, with what effects on the signal add to it."""
    value = m.input(Quantity(U, unit, f"{what} as it is given", start=1.0))
    signal = m.balance("value", "signal", unit=unit, value=value)
    m.output(Quantity(Y, unit, f"{what} as it is taken"), value + signal.effort)


def push(m: Model, unit: str, what: str, kind: str, shaft: tuple[Quantity, Quantity]) -> None:
    """Hand an effort on, with what effects on the motion beside it and on the signal add to it.

    Args:
        m: the model.
        unit, what: of the effort.
        kind: of the balance.
        shaft: speed, an input, and the place that its integral is.
    """
    effort = m.input(Quantity(U, unit, f"{what} as it is given", start=1.0))
    speed, sign = m.input(shaft[0]), m.parameter(SIGN)
    place = m.state(shaft[1])
    m.derivative(place, speed)
    name = "angle" if kind == "rotation" else "position"
    signals = {"velocity": speed, name: place, "load": sign * effort}
    inside = m.balance("inside", kind, **signals)
    signal = m.balance("value", "signal", unit=unit, value=effort)
    m.output(
        Quantity(Y, unit, f"{what} as it is taken"), effort + sign * inside.effort + signal.effort
    )
