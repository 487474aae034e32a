"""Swivelling caster with viscous swivel damping and smooth stick-slip friction on the floor.

Motion of fork and wheel as in `fork.py`, friction mu(v) as in `wheel_contact/stick_slip.py`.

Not modelled: dry friction of the swivel (effect `coulomb` on the balance `swivel`), scrub torque
(effect `pivot_torque`), camber and shimmy of an elastic tread.

Source: digital twin paper, block CasterWheel; the masses of fork and wheel are added.
"""

from __future__ import annotations

from ..component import Fidelity, Solver
from ..laws import floor
from ..model import SX, Model
from .fork import fork

FIDELITY = Fidelity(level=1, solver=Solver("rodas3_adaptive", 1e-3, 1e-5))


def equations(m: Model) -> None:
    """Collect the equations."""
    law = floor.stick_slip(m)

    def friction(s_h: SX, s_n: SX, load: SX, rolling: SX, x: SX, y: SX) -> tuple[SX, SX]:
        return law(s_h, s_n, load, x, y)

    fork(m, friction)
