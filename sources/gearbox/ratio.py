"""Rigid gearbox with a constant efficiency, the papers' gain `ratio * eta`.

    w_a = ratio w_b,   tau_b = ratio eta tau_a,   J_b = ratio^2 J_a

The rotor's inertia is passed on to the load (`J_b`), because a rigid gear leaves no motion of its
own. The efficiency multiplies torque in both directions of power flow, as in the papers: on braking
it removes power from the load that does not reach the motor with the right sign, so `P_loss` turns
negative there. `lossy` repairs that.

Not modelled: elasticity, backlash, friction without load.

Source: digital twin paper (gearbox block of the UR5: ratio times efficiency).
"""

from __future__ import annotations

from ..model import Model
from ..quantity import Quantity
from . import FLANGE_A, FLANGE_B, J_A, J_B, RATIO, TAU_A, TAU_B, W_A, W_B

LEVEL = 0
ETA = Quantity(
    "eta", "1", "efficiency, factor on the torque in both directions", start=0.9, minimum=0.1, maximum=1.0
)


def equations(m: Model) -> None:
    """Collect the equations."""
    tau_a, w_b = m.input(TAU_A), m.input(W_B)
    ratio, eta, inertia = m.parameter(RATIO), m.parameter(ETA), m.parameter(J_A)
    friction = m.balance("flange_b", "rotation", velocity=w_b, load=ratio * tau_a)
    tau_b = ratio * eta * tau_a + friction.effort
    w_a = ratio * w_b
    m.output(W_A, w_a)
    m.output(TAU_B, tau_b)
    m.output(J_B, ratio**2 * inertia)
    m.port(FLANGE_A, tau_a, w_a)
    m.port(FLANGE_B, tau_b, w_b)
    m.loss("mesh", (1 - eta) * ratio * tau_a * w_b)
