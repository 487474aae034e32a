"""From the set motion of a differential-drive base to the set speeds of its two motors."""

from __future__ import annotations

from typing import Any

import casadi as ca

from ..component import Component
from ..model import Model
from ..quantity import Quantity
from ..trajectory import PHI_D, V_D, W_D, XD_D, YD_D

SX = Any
__all__ = ["COMPONENT", "PHI_D", "V_D", "W_D", "XD_D", "YD_D", "motor_speeds"]

W_L_REF = Quantity("w_l_ref", "rad/s", "set speed of the left motor, positive drives forward")
W_R_REF = Quantity("w_r_ref", "rad/s", "set speed of the right motor, positive drives forward")
R = Quantity("r", "m", "radius of the drive wheels that the controller assumes", 0.1, minimum=1e-6)
TRACK = Quantity(
    "track", "m", "distance of the drive wheels that the controller assumes", 0.41, minimum=0.0
)
RATIO = Quantity("ratio", "1", "motor speed per wheel speed", 10.167, minimum=1e-3, maximum=1e4)

COMPONENT = Component(
    "inverse_kinematics",
    "Set speeds of the two motors of a differential-drive base.",
    device="mir250",
    source="digital twin paper, Eq 1, with a = half the track",
    energy=False,
)


def motor_speeds(m: Model, v_d: SX, w_d: SX) -> None:
    """Outputs of a base that shall move forward with v_d and turn with w_d, and its balances."""
    p = m.parameters(R, TRACK, RATIO)
    half = 0.5 * p.track
    both = p.ratio / p.r * ca.vertcat(v_d - half * w_d, v_d + half * w_d)
    both += m.balance("command", "signal", unit="rad/s", value=both).effort
    left, right = both[0], both[1]
    left += m.balance("left", "signal", unit="rad/s", value=left).effort
    right += m.balance("right", "signal", unit="rad/s", value=right).effort
    m.output(W_L_REF, left)
    m.output(W_R_REF, right)
