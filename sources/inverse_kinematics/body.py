"""Motor set speeds from the set speeds in body axes.

    w_r_ref = (N / r) (v_d + (track / 2) w_d),   w_l_ref = (N / r) (v_d - (track / 2) w_d)

Not modelled: limits; the controller's r and track need not be the true ones.

Source: digital twin paper, Eq 1 in body form.
"""

from __future__ import annotations

from ..component import Fidelity
from ..model import Model
from . import PHI_D, V_D, W_D, XD_D, YD_D, motor_speeds

FIDELITY = Fidelity(level=0)


def equations(m: Model) -> None:
    """Collect the equations."""
    v_d, w_d = m.input(V_D), m.input(W_D)
    for unused in (XD_D, YD_D, PHI_D):
        m.input(unused)
    motor_speeds(m, v_d, w_d)
