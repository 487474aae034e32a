"""Winding with inductance under the commanded voltage.

    L_a i' = u_set - R_a i - K_t w,   tau = K_t i - b_m w

Not modelled: switching of the amplifier within its PWM period, its voltage limit, saturation.

Source: Leonhard, Control of Electrical Drives, 2001, ch. 5.
"""

from __future__ import annotations

from .. import bare_motor as qs
from ..component import Fidelity, Solver
from ..dc_motor import CURRENT, W
from ..dc_motor.machine import machine
from ..model import Model

# L-stable: the winding's time constant may be below the step.
FIDELITY = Fidelity(level=0, solver=Solver("rodas3", 1e-3))


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.U_SET, W)
    x = m.states(CURRENT)
    u_set = u.u_set + m.balance("command", "signal", unit="V", value=u.u_set).effort
    machine(m, x.current, x.current, u_set, u.w)
