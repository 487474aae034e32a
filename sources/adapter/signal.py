"""A signal in whatever unit it has.

    y = u

The unit `any` stands for that of the signal; our master connects it to every other one.

Not modelled: anything, unless an effect is added.

Source: definition.
"""

from __future__ import annotations

from ..component import Fidelity
from ..model import Model
from ..quantity import Quantity
from . import UNIT, pass_on

FIDELITY = Fidelity(level=0)


def equations(m: Model) -> None:
    """Collect the equations."""
    value = m.input(Quantity("u", UNIT, "value as it is given", start=1.0))
    taken = Quantity("y", UNIT, "value as it is taken")
    m.output(taken, pass_on(m, taken, value))
