"""Rolling without slip, up to a stiff linear creep that knows no friction limit.

    f_x = -s_x/c_x,  f_y = -s_y/c_y
    c_i = c_i0 (rest + (1 - rest) v^2/(v^2 + v_creep^2)),   v = r w

The wheel constraint of the papers, with the forces that keep it.

Not modelled: sliding (`creep`, `stick_slip`), dependence on load.

Source: digital twin paper (pure rolling); Johnson, Contact Mechanics, 1985, ch. 8 for creep.
"""

from __future__ import annotations

from ..component import Fidelity, Solver
from ..laws.contact import creep_coefficient
from ..laws.floor import REST, V_CREEP
from ..model import SX, Model
from ..quantity import Quantity
from .wheel import Contact, wheel

FIDELITY = Fidelity(level=0, solver=Solver("rodas3_adaptive", 1e-3, 1e-5))
C_X = Quantity(
    "c_x",
    "m/(N.s)",
    "creep velocity per force, along the wheel",
    start=1e-6,
    minimum=1e-12,
    nominal=1e-6,
)
C_Y = Quantity(
    "c_y", "m/(N.s)", "creep velocity per side force", start=1e-6, minimum=1e-12, nominal=1e-6
)


def creep_coefficients(m: Model, c: Contact) -> tuple[SX, SX]:
    """Creep coefficients of a contact, with what effects add."""
    p = m.parameters(REST, V_CREEP)

    def coefficient(name: str, quantity: Quantity) -> SX:
        value = m.parameter(quantity)
        balance = m.balance(name, "coefficient", unit="m/(N.s)", value=value, speed=c.rolling)
        return creep_coefficient(value, p.rest, c.rolling, p.v_creep) + balance.effort

    c_y = coefficient("creep_y", C_Y)
    return coefficient("creep_x", C_X), c_y


def equations(m: Model) -> None:
    """Collect the equations."""

    def friction(c: Contact) -> tuple[SX, SX]:
        c_x, c_y = creep_coefficients(m, c)
        return -c.s_x / c_x, -c.s_y / c_y

    wheel(m, friction)
