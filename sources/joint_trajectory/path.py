"""What all paths of joints share."""

from __future__ import annotations

import casadi as ca

from .. import joint_trajectory as qs
from ..laws.joints import Joints
from ..model import SX, Model


def smooth(s: SX) -> SX:
    """Step from 0 to 1 over 0 <= s <= 1 with continuous second derivative."""
    s = ca.fmax(0, ca.fmin(s, 1))
    return s**3 * (10 - 15 * s + 6 * s**2)


def window(m: Model, start: SX, duration: SX, ramp: SX) -> SX:
    """1 from `start` over `duration`, fading in and out within it."""
    return smooth((m.t - start) / ramp) * smooth((start + duration - m.t) / ramp)


def output_path(m: Model, q: SX) -> None:
    """Output the angles and their time derivatives."""
    joints, speed = Joints.of_device(m), ca.jacobian(q, m.t)
    m.output(joints.sized(qs.Q_SET), q)
    m.output(joints.sized(qs.QD_SET), speed)
    m.output(joints.sized(qs.QDD_SET), ca.jacobian(speed, m.t))
