"""Tracks that skid by constant fractions of their speed.

    V_R = s(i_right) r w2,  V_L = s(i_left) r w3,   s(i) = 1 - i for i >= 0, 1/(1 + i) for i < 0
    v = (V_R + V_L)/2,  w_z = (V_R - V_L)/B,  v_y = -v tan(alpha)
    x' = v cos beta - v_y sin beta,  y' = v sin beta + v_y cos beta,  beta' = w_z

`s` inverts i = (r w - V)/max(|r w|, |V|) for forward motion; used for backward motion as it stands,
a track slips as much backwards as forwards. The coefficients belong to a side, not to the outer and
inner track: a turn to the other side needs them exchanged. A locked track (w = 0) cannot skid here;
the shifts e2, e3 of `two_wheeled` can say what this form cannot, and this form can say what they
cannot: slip in straight driving.

Not modelled: forces (tau2 and tau3 are 0), the dependence of the coefficients on anything.

Source: crawler paper, Eq 1 and 2 (third line of Eq 1 and the denominator of Eq 2 corrected, see
README).
"""

from __future__ import annotations

import casadi as ca

from .. import crawler as qs
from ..component import Fidelity, Solver
from ..model import SX, Model
from ..quantity import Quantity
from .pose import integrate_pose, output_kinematic, pose_states, track_speeds, virtual_wheels

FIDELITY = Fidelity(level=0, solver=Solver("rk4", 2e-3))

I_RIGHT = Quantity(
    "i_right",
    "1",
    "skid of the right track, positive when the track outruns the floor",
    start=0.13,
    minimum=-0.95,
    maximum=0.95,
)
I_LEFT = Quantity(
    "i_left",
    "1",
    "skid of the left track, positive when the track outruns the floor",
    minimum=-0.95,
    maximum=0.95,
)
ALPHA = Quantity(
    "alpha",
    "rad",
    "sideslip angle, positive to the right",
    minimum=-1.5,
    maximum=1.5,
)


def skid_factor(i: SX) -> SX:
    """Speed over the floor by speed of the track; s and its slope are continuous at i = 0."""
    return ca.if_else(i < 0, 1 / (1 + ca.fmin(i, 0)), 1 - i)


def equations(m: Model) -> None:
    """Collect the equations."""
    speeds = track_speeds(m)
    p = m.parameters(qs.R, qs.B, ALPHA, I_RIGHT, I_LEFT)
    right = skid_factor(p.i_right) * p.r * speeds.w2
    left = skid_factor(p.i_left) * p.r * speeds.w3
    v, w_z = (right + left) / 2, (right - left) / p.B
    integrate_pose(m, pose_states(m), v, -v * ca.tan(p.alpha), w_z)
    output_kinematic(m, speeds, *virtual_wheels(p.r, p.B, speeds, v, w_z))
