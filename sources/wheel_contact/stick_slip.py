"""Smooth stick-slip friction under a given normal load.

    mu(v) = mu_s (v/v_c) (3 - (v/v_c)^2)/2                          for v <= v_c
          = mu_d + (mu_s - mu_d) exp(-((v/v_c - 1)/2)^2)            for v > v_c
    f = -mu(v) f_n s/v,   v = |s|

Below v_c it creeps: a side force F on wheels that carry N drifts at F v_c/(1.5 mu_s N). v_c of a
few mm/s bends the path of a base visibly; take v_c <= 2 mm/s or `brush`.

Not modelled: true standstill under load (`brush`), dependence of mu on load.

Source: digital twin paper (Spatial Contact Force with static and dynamic coefficient and critical
velocity); the blending is ours, MathWorks does not publish its own.
"""

from __future__ import annotations

from ..component import Fidelity, Solver
from ..laws import floor
from ..model import SX, Model
from .wheel import Contact, Friction, wheel

FIDELITY = Fidelity(level=2, solver=Solver("rodas3_adaptive", 1e-3, 1e-5))


def stick_slip(m: Model) -> Friction:
    """The friction law with its parameters."""
    law = floor.stick_slip(m)

    def friction(c: Contact) -> tuple[SX, SX]:
        return law(c.s_x, c.s_y, c.f_n, c.x, c.y)

    return friction


def equations(m: Model) -> None:
    """Collect the equations."""
    wheel(m, stick_slip(m))
