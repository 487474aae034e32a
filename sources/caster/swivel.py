"""Swivelling caster with viscous swivel damping and smooth stick-slip friction on the floor.

Motion of fork and wheel as in `fork.py`, friction mu(v) as in `wheel_contact/stick_slip.py`.

Not modelled: dry friction of the swivel (effect `coulomb` on the balance `swivel`), scrub torque
(effect `pivot_torque`), camber and shimmy of an elastic tread.

Source: digital twin paper, block CasterWheel; the masses of fork and wheel are added.
"""

from __future__ import annotations

from ..component import Solver
from ..laws import contact
from ..model import SX, Model
from ..quantity import Quantity
from .fork import fork

LEVEL = 1
SOLVER = Solver("rodas3_adaptive", 1e-3, 1e-5)
MU_S = Quantity("mu_s", "1", "static friction coefficient", start=0.7, minimum=1e-6)
MU_D = Quantity("mu_d", "1", "dynamic friction coefficient", start=0.5, minimum=0.0)
V_C = Quantity(
    "v_c",
    "m/s",
    "critical velocity, where friction is largest",
    start=0.002,
    minimum=1e-6,
    nominal=2e-3,
)


def equations(m: Model) -> None:
    """Collect the equations."""
    mu_s, mu_d, v_c = m.parameter(MU_S), m.parameter(MU_D), m.parameter(V_C)

    def friction(s_h: SX, s_n: SX, load: SX, rolling: SX, x: SX, y: SX) -> tuple[SX, SX]:
        patch = m.balance("mu", "coefficient", unit="1", value=mu_s, x=x, y=y)
        share = 1 + patch.effort / mu_s
        return contact.stick_slip(s_h, s_n, load * share, mu_s, mu_d, v_c)

    fork(m, friction)
