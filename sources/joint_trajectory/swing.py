"""Joints that swing sinusoidally about a pose, fading in and out; by default joint 1 alone.

    q = q_hold + amplitude w(t) sin(2 pi f (t - t_start))

w is 1 but for quintic ramps at both ends.

Not modelled: limits of speed or torque.

Source: digital twin paper, tests IY and CY (base moves while joint 1 of the stretched arm swings).
"""

from __future__ import annotations

import math

import casadi as ca

from .. import joint_trajectory as qs
from ..component import Fidelity
from ..laws.joints import Joints
from ..model import Model
from ..quantity import Quantity
from .path import output_path, window

FIDELITY = Fidelity(level=1)
AMPLITUDE = Quantity(
    "amplitude",
    "rad",
    "amplitudes of the swing",
    start=(0.3, 0.0, 0.0, 0.0, 0.0, 0.0),
    nominal=0.3,
    size=6,
)
FREQUENCY = Quantity("f", "Hz", "frequency of the swing", start=0.4, minimum=0.0)
DURATION = Quantity("duration", "s", "from first to last motion", start=10.0, minimum=1e-3)


def equations(m: Model) -> None:
    """Collect the equations."""
    joints = Joints.of_device(m)
    of_joints = joints.sized(qs.Q_HOLD), joints.sized(AMPLITUDE)
    p = m.parameters(qs.T_START, DURATION, qs.RAMP, FREQUENCY, *of_joints)
    faded = window(m, p.t_start, p.duration, p.ramp)
    phase = 2 * math.pi * p.f * (m.t - p.t_start)
    output_path(m, p.q_hold + p.amplitude * faded * ca.sin(phase))
