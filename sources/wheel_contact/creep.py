"""Coulomb friction with linear creep below its limit, softer sideways than forward.

    p_x = -s_x/c_x,  p_y = -s_y/c_y,   f = p / sqrt(1 + |p|^2/(mu f_n)^2)
    c_i = c_i0 (rest + (1 - rest) v^2/(v^2 + v_creep^2)),   v = r w

At small force the wheel creeps at c_i f_i. The creep coefficients may fall to `rest` times their
value when the wheel does not roll.

Not modelled: stiction (mu does not depend on the slip velocity), true standstill under side force
(`brush`).

Source: Johnson, Contact Mechanics, 1985, ch. 8 (creep of rolling bodies); the limit is Coulomb's.
"""

from __future__ import annotations

from ..component import Fidelity, Solver
from ..laws import contact
from ..laws.floor import MU
from ..model import SX, Model
from .rolling import creep_coefficients
from .wheel import Contact, wheel

FIDELITY = Fidelity(level=1, solver=Solver("rodas3_adaptive", 1e-3, 1e-5))


def equations(m: Model) -> None:
    """Collect the equations."""
    p = m.parameters(MU)

    def friction(c: Contact) -> tuple[SX, SX]:
        patch = m.balance("mu", "coefficient", unit="1", value=p.mu, x=c.x, y=c.y)
        c_x, c_y = creep_coefficients(m, c)
        return contact.creep(c.s_x, c.s_y, c_x, c_y, (p.mu + patch.effort) * c.f_n)

    wheel(m, friction)
