"""Motor set speeds from the set speeds in body axes.

    w_r_ref = (N / r) (v_d + (track / 2) w_d),   w_l_ref = (N / r) (v_d - (track / 2) w_d)

Not modelled: limits; the controller's r and track need not be the true ones.

Source: digital twin paper, Eq 1 in body form.
"""

from __future__ import annotations

from .. import inverse_kinematics as qs
from ..component import Fidelity
from ..model import Model
from . import motor_speeds

FIDELITY = Fidelity(level=0)


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.V_D, qs.W_D)
    for unused in (qs.XD_D, qs.YD_D, qs.PHI_D):
        m.input(unused)
    motor_speeds(m, u.v_d, u.w_d)
