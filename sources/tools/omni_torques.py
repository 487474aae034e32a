"""Inverse dynamics of the omnidirectional base in numbers.

Equations and source: `sources/omni_base/inverse_dynamics.py`.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..omni_base.inverse_dynamics import motor_torques
from ..omni_base.rigid_body import Geometry, Masses
from ..variant import build_model

Vector = NDArray[np.float64]


@lru_cache(maxsize=None)
def _function(device: str, friction: bool) -> ca.Function:
    variables = build_model(f"omni_base.{device}/dynamic").of_role("parameter")
    p = {v.name: v.start for v in variables}
    l_a, x_g, y_g = p["l_A"], p["x_G"], p["y_G"]
    alpha = np.array([p[f"alpha_A[{i}]"] for i in (1, 2, 3)])
    geometry = Geometry(
        ca.DM(l_a * np.cos(alpha)),
        ca.DM(l_a * np.sin(alpha)),
        ca.DM([p[f"e[{i}]"] for i in (1, 2, 3)]),
        ca.DM([p[f"r[{i}]"] for i in (1, 2, 3)]),
    )
    masses = Masses(
        p["m_p"],
        p["m_p"] * x_g,
        p["m_p"] * y_g,
        p["I_p"] + p["m_p"] * (x_g**2 + y_g**2),
        p["m_w"],
        p["d"],
        p["I_s"],
        p["I_phi"],
    )
    theta = ca.SX.sym("theta")
    beta, rates, acceleration = (ca.SX.sym(n, 3) for n in ("beta", "rates", "acceleration"))
    axles = (p["f_s"], p["f_v"], p["w_0"]) if friction else (0.0, 0.0, 1.0)
    torques = motor_torques(geometry, masses, theta, beta, rates, acceleration, axles)
    return ca.Function("torques", [theta, beta, rates, acceleration], list(torques))


def torques(
    theta: float,
    beta: ArrayLike,
    rates: ArrayLike,
    acceleration: ArrayLike,
    *,
    device: str = "paper",
    friction: bool = True,
) -> tuple[Vector, Vector]:
    """Least steering and rolling torques (3 each) [N.m] for a wanted acceleration.

    Args:
        theta, beta: heading and steering angles [rad].
        rates, acceleration: velocity and acceleration of (x, y, theta) in the world.
        device: parameter file of the base.
        friction: compensate the axles' friction.
    """
    found = _function(device, friction)(
        theta, *(np.asarray(v, dtype=float) for v in (beta, rates, acceleration))
    )
    return np.asarray(found[0]).ravel(), np.asarray(found[1]).ravel()
