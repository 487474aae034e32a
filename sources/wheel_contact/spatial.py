"""Stick-slip friction under a spring-damper floor: the load follows from the height of the wheel.

    d = r - z,  x = d/width limited to 0 ... 1,  s = x^2 (3 - 2 x)
    f_z = max(0, s (k d + b d')),   friction as in `stick_slip` with f_n = f_z

Not modelled: camber (the contact lies below the wheel centre), tread that remembers, an uneven
floor.

Source: digital twin paper, Contact block; MathWorks, Spatial Contact Force.
"""

from __future__ import annotations

from ..component import Fidelity, Solver
from ..model import Model
from .stick_slip import stick_slip
from .wheel import wheel

FIDELITY = Fidelity(level=3, solver=Solver("rodas3_adaptive", 1e-3, 1e-5))


def equations(m: Model) -> None:
    """Collect the equations."""
    wheel(m, stick_slip(m), computes_normal=True)
