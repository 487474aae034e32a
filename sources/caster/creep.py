"""Swivelling caster whose wheel creeps in proportion to its force, up to Coulomb's limit.

Motion of fork and wheel as in `fork.py`, friction as in `wheel_contact/creep.py`:

    p_h = -s_h/c_h,  p_n = -s_n/c_n,   f = p / sqrt(1 + |p|^2/(mu N)^2)

Not modelled: dry friction of the swivel (effect `coulomb` on the balance `swivel`), scrub torque
(effect `pivot_torque`), static excess of mu.

Source: digital twin paper, block CasterWheel; Johnson, Contact Mechanics, 1985, ch. 8 for creep.
"""

from __future__ import annotations

from ..component import Fidelity, Solver
from ..laws import contact
from ..laws.floor import MU, REST, V_CREEP
from ..model import SX, Model
from ..quantity import Quantity
from .fork import fork

FIDELITY = Fidelity(level=2, solver=Solver("rodas3_adaptive", 1e-3, 1e-5))
C_H = Quantity(
    "c_h",
    "m/(N.s)",
    "creep velocity per force, along the wheel",
    start=1e-6,
    minimum=1e-12,
    nominal=1e-6,
)
C_N = Quantity(
    "c_n", "m/(N.s)", "creep velocity per side force", start=1e-6, minimum=1e-12, nominal=1e-6
)


def equations(m: Model) -> None:
    """Collect the equations."""
    p = m.parameters(MU, C_H, C_N, REST, V_CREEP)

    def friction(s_h: SX, s_n: SX, load: SX, rolling: SX, x: SX, y: SX) -> tuple[SX, SX]:
        patch = m.balance("mu", "coefficient", unit="1", value=p.mu, x=x, y=y)
        return contact.creep(
            s_h,
            s_n,
            contact.creep_coefficient(p.c_h, p.rest, rolling, p.v_creep),
            contact.creep_coefficient(p.c_n, p.rest, rolling, p.v_creep),
            (p.mu + patch.effort) * load,
        )

    fork(m, friction)
