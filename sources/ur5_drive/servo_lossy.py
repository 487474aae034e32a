"""As `servo`, with a gear efficiency that follows the direction of power flow.

    tau = N eta^s K_t i - b qd,   s = tanh(P / P_0),   P = N K_t i qd

s = +1 while the motor drives and -1 while the joint drives it; the mesh loss (1 - eta^s) P is never
negative. At standstill eta^s is 1 and the gear holds without loss, where a real one holds with
anything between eta and 1/eta of the motor's torque.

Not modelled: as `servo`, but for the braking gear.

Source: Pelchen, Schweiger, Otter, Modeling and simulating the efficiency of gearboxes, 2nd
International Modelica Conference, 2002; the blend over P_0 replaces their case distinction.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity, Solver
from ..model import SX, Model
from ..quantity import Quantity
from .gearmotor import gear, read, winding
from .servo import control

FIDELITY = Fidelity(level=2, solver=Solver("rodas3", 1e-4))
P_0 = Quantity("P_0", "W", "power over which the efficiency changes side", start=0.5, minimum=1e-6)


def equations(m: Model) -> None:
    """Collect the equations."""
    servo = read(m)
    coils = winding(m, servo.speed, control(m, servo))
    p = m.parameters(P_0)

    def factor(eta: SX, power: SX) -> SX:
        return eta ** ca.tanh(power / p.P_0)

    gear(m, servo, coils, factor)
