"""Parameters of a wheel's friction on the floor, and the laws that take them from a model."""

from __future__ import annotations

from collections.abc import Callable

from ..model import SX, Model
from ..quantity import Quantity
from . import contact

MU = Quantity("mu", "1", "friction coefficient of the wheel on the floor", start=0.7, minimum=0.0)
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
REST = Quantity(
    "rest",
    "1",
    "creep coefficients at standstill over the rolling ones",
    start=1.0,
    minimum=1e-6,
)
V_CREEP = Quantity(
    "v_creep",
    "m/s",
    "rolling speed between standstill and rolling",
    start=0.02,
    minimum=1e-6,
    nominal=0.02,
)


def stick_slip(m: Model) -> Callable[[SX, SX, SX, SX, SX], tuple[SX, SX]]:
    """Smooth stick-slip, (s_x, s_y, load, x, y) -> forces; effects on `mu` act on mu_d alike."""
    p = m.parameters(MU_S, MU_D, V_C)

    def friction(s_x: SX, s_y: SX, load: SX, x: SX, y: SX) -> tuple[SX, SX]:
        patch = m.balance("mu", "coefficient", unit="1", value=p.mu_s, x=x, y=y)
        share = 1 + patch.effort / p.mu_s
        return contact.stick_slip(s_x, s_y, load * share, p.mu_s, p.mu_d, p.v_c)

    return friction
