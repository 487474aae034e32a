"""Torque, as a signal.

    y = u

Not modelled: anything, unless an effect is added.

Source: definition.
"""

from __future__ import annotations

from ..component import Fidelity
from ..model import Model
from . import pass_on

FIDELITY = Fidelity(level=9)


def equations(m: Model) -> None:
    """Collect the equations."""
    pass_on(m, "N.m", "torque")
