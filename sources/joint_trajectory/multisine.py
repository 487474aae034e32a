"""Excitation of all joints at once by sums of sines, no frequency used twice.

    q_j = q_hold_j + amplitude_j w(t) sum_k sin(2 pi f (j + n k) (t - t_start) + psi_k) / 5
    psi_k = -pi k (k - 1)/5,   j = 1..n,   k = 0..4

The joints' spectra do not overlap within a period 1/f, and Schroeder's phases keep the peaks low.

Not modelled: limits of speed or torque.

Source: Swevers et al., IEEE Trans. Robotics and Automation 13(5), 1997, 730-740; Schroeder, IEEE
Trans. Information Theory 16, 1970.
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

FIDELITY = Fidelity(level=2)
LINES = 5
AMPLITUDE = Quantity(
    "amplitude", "rad", "sums of the amplitudes of a joint's sines", start=0.5, size=6
)
FREQUENCY = Quantity("f", "Hz", "distance of the frequencies", start=0.05, minimum=0.0)
DURATION = Quantity("duration", "s", "from first to last motion", start=20.0, minimum=1e-3)


def equations(m: Model) -> None:
    """Collect the equations."""
    joints = Joints.of_device(m)
    amplitude, q_hold = joints.sized(AMPLITUDE), joints.sized(qs.Q_HOLD)
    p = m.parameters(qs.T_START, amplitude, DURATION, qs.RAMP, FREQUENCY, q_hold)
    faded = window(m, p.t_start, p.duration, p.ramp)
    base = 2 * math.pi * p.f * (m.t - p.t_start)
    waves = [
        sum(
            ca.sin((joint + len(joints) * k) * base - math.pi * k * (k - 1) / LINES) / LINES
            for k in range(LINES)
        )
        for joint in range(1, len(joints) + 1)
    ]
    output_path(m, p.q_hold + p.amplitude * faded * ca.vertcat(*waves))
