"""Motor set speeds from the set speeds in world axes and the set heading.

    w_r_ref = (N / r) (cos(phi_d) xd_d + sin(phi_d) yd_d + a w_d)
    w_l_ref = (N / r) (cos(phi_d) xd_d + sin(phi_d) yd_d - a w_d),   a = track / 2

The set heading is used, not the measured one, so a heading error does not feed back. The sideways
part -sin(phi_d) xd_d + cos(phi_d) yd_d of the command is lost.

Not modelled: limits; the controller's r and track need not be the true ones.

Source: digital twin paper, Eq 1.
"""

from __future__ import annotations

import casadi as ca

from .. import inverse_kinematics as qs
from ..component import Fidelity
from ..model import Model
from . import motor_speeds

FIDELITY = Fidelity(level=1)


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.V_D, qs.W_D, qs.XD_D, qs.YD_D, qs.PHI_D)
    motor_speeds(m, ca.cos(u.phi_d) * u.xd_d + ca.sin(u.phi_d) * u.yd_d, u.w_d)
