"""Commanded motion of a mobile base: speeds in body axes, speeds and heading in the world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from ..component import Component, Solver
from ..model import Model
from ..quantity import Quantity

SX = Any
SEGMENTS = 4

V_SET = Quantity("v_set", "m/s", "forward speed commanded from outside, added to the profile")
W_SET = Quantity("w_set", "rad/s", "yaw rate commanded from outside, added to the profile")
V_D = Quantity("v_d", "m/s", "set forward speed of the base", start=0.5)
W_D = Quantity("w_d", "rad/s", "set yaw rate, positive to the left", start=0.2)
XD_D = Quantity("xd_d", "m/s", "set speed along the world's x axis", start=0.5)
YD_D = Quantity("yd_d", "m/s", "set speed along the world's y axis")
PHI_D = Quantity("phi_d", "rad", "set heading in the world, unwrapped")
HEADING = Quantity("heading", "rad", "set heading in the world at present")

T_0 = Quantity("t_0", "s", "start of the first segment", start=1.0)
DURATION = Quantity(
    "duration",
    "s",
    "time from the start of a segment to that of the next, ramps included",
    start=(10.0, 0.0, 0.0, 0.0),
    minimum=0.0,
    size=SEGMENTS,
)
SPEED = Quantity(
    "speed",
    "m/s",
    "speed of each segment, negative backward; after the last it is 0",
    start=(0.5, 0.0, 0.0, 0.0),
    size=SEGMENTS,
)
CURVATURE = Quantity(
    "curvature",
    "rad/m",
    "curvature of each segment, 1 / radius, positive to the left, 0 = straight",
    size=SEGMENTS,
)
TURN = Quantity(
    "turn",
    "rad/s",
    "yaw rate of each segment besides that of the curvature, for turns on the spot",
    size=SEGMENTS,
)
A = Quantity("a", "m/s2", "acceleration between two speeds", start=0.5, minimum=1e-6)
ALPHA = Quantity(
    "alpha", "rad/s2", "yaw acceleration between two values of `turn`", start=1.0, minimum=1e-6
)
T_CURVE = Quantity("t_curve", "s", "time over which the curvature changes", start=0.5, minimum=1e-6)
SMOOTH = Quantity(
    "smooth",
    "1",
    "0: constant acceleration on a ramp; 1: acceleration that rises from and falls to 0",
    minimum=0.0,
    maximum=1.0,
)

COMPONENT = Component(
    "trajectory",
    "Commanded speeds of a mobile base as function of time.",
    device="in1",
    source="digital twin paper, trajectory block (its speed profiles are not printed)",
    energy=False,
)
SOLVER = Solver("rk4", step=1e-2)


@dataclass(frozen=True)
class Profile:
    """Path speed, curvature and additional yaw rate at an instant."""

    speed: SX
    curvature: SX
    turn: SX


def profile(m: Model) -> Profile:
    """The segments' values at the present time.

    A value that goes from one segment to the next by d over the time tau contributes
    `d * ramp((t - start of the segment) / tau)`; the contributions are added, so ramps may overlap.
    """
    p = m.parameters(T_0, DURATION, SPEED, CURVATURE, TURN, A, ALPHA, T_CURVE, SMOOTH)

    def ramp(begin: SX, length: SX) -> SX:
        r = ca.fmax(0.0, ca.fmin(1.0, (m.t - begin) / length))
        return (1.0 - p.smooth) * r + p.smooth * r**2 * (3.0 - 2.0 * r)

    shortest = 1e-9  # where two values are equal there is nothing to ramp
    now = Profile(ca.SX(0.0), p.curvature[0], ca.SX(0.0))
    begin = p.t_0
    for k in range(SEGMENTS + 1):
        ended = k == SEGMENTS
        d_speed = (0.0 if ended else p.speed[k]) - (p.speed[k - 1] if k else 0.0)
        d_turn = (0.0 if ended else p.turn[k]) - (p.turn[k - 1] if k else 0.0)
        d_curve = 0.0 if ended or not k else p.curvature[k] - p.curvature[k - 1]
        now = Profile(
            now.speed + d_speed * ramp(begin, ca.fmax(ca.fabs(d_speed) / p.a, shortest)),
            now.curvature + d_curve * ramp(begin, p.t_curve),
            now.turn + d_turn * ramp(begin, ca.fmax(ca.fabs(d_turn) / p.alpha, shortest)),
        )
        if not ended:
            begin = begin + p.duration[k]
    return now
