"""Rigid gearbox whose efficiency follows the direction of power flow.

    w_a = ratio w_b,   tau_b = ratio eta^s tau_a - b w_b,   J_b = ratio^2 J_a
    s = tanh(tau_a w_a / P_0):  +1 the motor drives, -1 the load drives

The mesh loss (1 - eta^s) tau_a w_a is never negative. At standstill eta^s is 1 and the gear holds
without loss: real gears hold anything between eta and 1/eta there.

Not modelled: elasticity, backlash, self-locking, efficiency that depends on load.

Source: Pelchen, Schweiger, Otter, Modeling and simulating the efficiency of gearboxes, 2nd
International Modelica Conference, 2002; the blend over P_0 replaces their case distinction.
"""

from __future__ import annotations

import casadi as ca

from .. import gearbox as qs
from ..component import Fidelity, Solver
from ..model import Model
from .rigid import rigid

FIDELITY = Fidelity(level=1, solver=Solver("rodas3", 1e-3))


def equations(m: Model) -> None:
    """Collect the equations."""
    p = m.parameters(qs.ETA, qs.P_0)
    rigid(m, lambda torque, speed: p.eta ** ca.tanh(torque * speed / p.P_0))
