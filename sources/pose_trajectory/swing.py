"""Sines in x, y and heading that fade in and out: ellipses, figures of eight, turning or not.

    x = x_0 + A_x w(t) sin(n_x phi),  y = y_0 + A_y w(t) sin(n_y phi),  theta likewise,
    phi = 2 pi f (t - t_start)

w is 1 but for quintic ramps at both ends. n = (1, 2, ...) draws a figure of eight.

Not modelled: limits of speed or torque.

Source: textbook (Lissajous figures).
"""

from __future__ import annotations

import math

import casadi as ca

from .. import pose_trajectory as qs
from ..component import Fidelity
from ..joint_trajectory.path import window
from ..model import Model
from ..quantity import Quantity
from . import output_motion, start_pose

FIDELITY = Fidelity(level=1)
A_X = Quantity("A_x", "m", "amplitude along the world's x axis", start=1.0)
A_Y = Quantity("A_y", "m", "amplitude along the world's y axis", start=0.5)
A_THETA = Quantity("A_theta", "rad", "amplitude of the heading", start=0.5)
N = Quantity("n", "1", "multiples of the frequency in x, y and heading", (1.0, 2.0, 1.0), size=3)
FREQUENCY = Quantity("f", "Hz", "frequency", start=0.1, minimum=0.0)
DURATION = Quantity("duration", "s", "from first to last motion", start=20.0, minimum=1e-3)
RAMP = Quantity("ramp", "s", "time to fade in and out", start=2.0, minimum=1e-3)


def equations(m: Model) -> None:
    """Collect the equations."""
    t_start, start = m.parameter(qs.T_START), start_pose(m)
    p = m.parameters(A_X, A_Y, A_THETA, FREQUENCY, N, DURATION, RAMP)
    amplitude = ca.vertcat(p.A_x, p.A_y, p.A_theta)
    phase = 2 * math.pi * p.f * (m.t - t_start) * p.n
    faded = window(m, t_start, p.duration, p.ramp)
    output_motion(m, start + faded * amplitude * ca.sin(phase))
