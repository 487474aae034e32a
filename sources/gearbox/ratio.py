"""Rigid gearbox with a constant efficiency, the papers' gain `ratio * eta`.

    w_a = ratio w_b,   tau_b = ratio eta tau_a - b w_b,   J_b = ratio^2 J_a

The rotor's inertia is passed on to the load (`J_b`), because a rigid gear leaves no motion of its
own. The efficiency multiplies torque in both directions of power flow, as in the papers: when the
load drives the motor, more power reaches the motor than the load gives, so `P_loss` turns negative
there. `lossy` repairs that.

Not modelled: elasticity, backlash, friction without load.

Source: digital twin paper (gearbox block of the UR5: ratio times efficiency).
"""

from __future__ import annotations

from .. import gearbox as qs
from ..component import Fidelity, Solver
from ..model import Model
from .rigid import rigid

# No states of its own; bristles and angles of effects are stiff.
FIDELITY = Fidelity(level=0, solver=Solver("rodas3", 1e-3))


def equations(m: Model) -> None:
    """Collect the equations."""
    p = m.parameters(qs.ETA)
    rigid(m, lambda _torque, _speed: p.eta)
