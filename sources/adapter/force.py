"""Force on a slide, with the motion of what it acts on.

    y = u,   position' = v

The balance `inside` takes effects on the slide: they add to the force what they would give if
they acted where the FMU behind it gives or takes it. The position is counted from the start.

Not modelled: anything, unless an effect is added.

Source: definition.
"""

from __future__ import annotations

from ..component import Fidelity, Solver
from ..model import Model
from ..quantity import Quantity
from . import push

FIDELITY = Fidelity(level=2, solver=Solver("rk4", 1e-2))
GIVEN = Quantity("u", "N", "force as it is given", start=1.0)
TAKEN = Quantity("y", "N", "force as it is taken")
V = Quantity("v", "m/s", "speed of the slide")
POSITION = Quantity("position", "m", "state: position of the slide since the start")


def equations(m: Model) -> None:
    """Collect the equations."""
    push(m, GIVEN, TAKEN, "translation", (V, POSITION))
