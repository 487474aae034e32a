"""Two virtual wheels whose shifts follow from the track speeds, mirrored for right turns.

    e_outer = (1 - k) (a + b |w2 - w3| + c w_inner) + k e_outer_locked
    e_inner = (1 - k) (e_inner_turning - h (b |w2 - w3| + c w_inner)) + k e_inner_locked
    k = exp(-(w_inner/w_lock)^2)

The outer track is the one whose wheel turns faster; `w_inner` is the absolute speed of the other
one and `k` tells a locked inner track from a turning one. With b = c the outer shift grows with the
speed of the outer wheel; with h = 1 the inner shift gives what the outer one takes, so that the sum
stays the same. Which is which is blended over `w_even`:

    s = tanh((|w2| - |w3|)/w_even),  e2 = (e_outer + e_inner)/2 + s (e_outer - e_inner)/2,  e3: -s

so that a turn on the spot gets equal shifts on both sides. Kinematics as in `two_wheeled`. The
shifts follow the speeds without delay.

Not modelled: forces (tau2 and tau3 are 0), floor and load, transients of e2 and e3. The law is a
fit to left turns with a forward inner track; right turns, turns on the spot and reversing are
extrapolated by symmetry.

Source: crawler paper, Table 2: least squares over SET2 to SET5 for `a` and `b`, mean of SET1 for
the locked track (`sources/tools/crawler_identification.py` computes both); h: docs/crawler_slip.md.
"""

from __future__ import annotations

import casadi as ca

from .. import crawler as qs
from ..component import Fidelity, Solver
from ..model import Model
from ..quantity import Quantity
from .pose import integrate_pose, output_kinematic, pose_states, track_speeds, two_wheel_motion

FIDELITY = Fidelity(level=1, solver=Solver("rk4", 2e-3))

SLIP_A = Quantity(
    "slip_a", "m", "shift of the outer virtual wheel at equal speeds", start=0.0280, nominal=0.01
)
SLIP_B = Quantity(
    "slip_b",
    "m.s/rad",
    "growth of the outer shift with the speed difference of the track wheels",
    start=0.00368,
    nominal=1e-3,
)
SLIP_C = Quantity(
    "slip_c",
    "m.s/rad",
    "growth of the outer shift with the speed of the inner track wheel",
    nominal=1e-3,
)
E_INNER = Quantity("e_inner", "m", "shift of the inner virtual wheel", nominal=0.01)
EXCHANGE = Quantity(
    "exchange",
    "1",
    "share of the outer shift's growth that the inner shift loses, h",
    minimum=-1.0,
    maximum=2.0,
)
E_OUTER_LOCKED = Quantity(
    "e_outer_locked",
    "m",
    "shift of the outer virtual wheel while the inner track is locked",
    start=0.0928,
    minimum=-0.04,
    nominal=0.01,
)
E_INNER_LOCKED = Quantity(
    "e_inner_locked",
    "m",
    "shift of the inner virtual wheel while the inner track is locked",
    start=-0.0043,
    minimum=-0.04,
    nominal=0.01,
)
W_LOCK = Quantity(
    "w_lock", "rad/s", "speed below which the inner track counts as locked", start=0.1, minimum=1e-3
)
W_EVEN = Quantity(
    "w_even",
    "rad/s",
    "speed difference over which outer and inner track change roles",
    start=0.02,
    minimum=1e-4,
)
E_MINIMUM = -0.04
"""Least shift [m] that the linear law may reach, so that the virtual wheels never meet."""
SPEED_FLOOR = 1e-6
"""Speed [rad/s] over which absolute values are rounded."""


def equations(m: Model) -> None:
    """Collect the equations."""
    speeds = track_speeds(m)
    p = m.parameters(
        qs.R,
        qs.B,
        qs.X_V,
        SLIP_A,
        SLIP_B,
        SLIP_C,
        E_INNER,
        EXCHANGE,
        E_OUTER_LOCKED,
        E_INNER_LOCKED,
        W_LOCK,
        W_EVEN,
    )

    right, left, difference = (
        ca.sqrt(w**2 + SPEED_FLOOR**2) for w in (speeds.w2, speeds.w3, speeds.w2 - speeds.w3)
    )
    side = ca.tanh((right - left) / p.w_even)
    w_inner = (right + left) / 2 - side * (right - left) / 2
    locked = ca.exp(-((w_inner / p.w_lock) ** 2))
    growth = p.slip_b * difference + p.slip_c * w_inner
    turning = ca.fmax(p.slip_a + growth, E_MINIMUM)
    outer = (1 - locked) * turning + locked * p.e_outer_locked
    given = ca.fmax(p.e_inner - p.exchange * growth, E_MINIMUM)
    inner = (1 - locked) * given + locked * p.e_inner_locked
    e2 = (outer + inner) / 2 + side * (outer - inner) / 2
    e3 = (outer + inner) / 2 - side * (outer - inner) / 2

    v, w_z = two_wheel_motion(p.r, p.B, e2, e3, speeds)
    integrate_pose(m, pose_states(m), v, -p.x_V * w_z, w_z)
    output_kinematic(m, speeds, e2, e3)
