"""Torque that a wheel's contact patch resists turning with, from pressure, load and friction.

Patch of length `ell` and width `width` under the load F with the parabolic pressure
p(x) = 4 p_max (x/ell)(1 - x/ell), p_max = 1.5 F/(width ell), constant across:

    line   M = integral |x - ell/2| mu p width dx = (3/16) mu F ell
    area   M = integral integral sqrt((x - ell/2)^2 + y^2) mu p dx dy
    edge   M = mu F ell/2  (arm taken from the patch's edge)

Source: omnidirectional base paper, Eq 37 to 42 and 51 to 53; corrections in
`sources/omni_base/README.md`.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

Pressure = Literal["parabolic", "uniform"]


def footprint_length(radius: float, deflection: float) -> float:
    """Length of the patch of a rigid wheel that sinks by `deflection`: 2 sqrt(2 r d - d^2) [m]."""
    return 2.0 * math.sqrt(2.0 * radius * deflection - deflection**2)


def line_moment(mu: float, load: float, length: float) -> float:
    """Pivot torque of a narrow patch with parabolic pressure [N.m]."""
    return 3.0 / 16.0 * mu * load * length


def edge_moment(mu: float, load: float, length: float) -> float:
    """Moment of the friction about the edge of the patch instead of its middle [N.m]."""
    return mu * load * length / 2.0


def area_moment(
    mu: float,
    load: float,
    length: float,
    width: float,
    pressure: Pressure = "parabolic",
    order: int = 200,
) -> float:
    """Pivot torque of a patch of finite width [N.m], by Gauss-Legendre quadrature.

    The integrand has a kink in the middle of the patch; it is integrated over one quadrant.
    """
    node, weight = np.polynomial.legendre.leggauss(order)
    s, w = (node + 1) / 2, weight / 2  # on 0 ... 1
    x, y = length / 2 * s[:, None], width / 2 * s[None, :]
    shape = 1.5 * (1 - s**2) if pressure == "parabolic" else np.ones_like(s)
    return float(mu * load * np.sum(w[:, None] * w[None, :] * shape[:, None] * np.hypot(x, y)))


def rolling_coefficient(mass: float, exponent: float = 2.5) -> float:
    """K_res = 0.80 (m/75 kg)^p, in the paper's unit N.cm2, of a wheel that turns while it rolls."""
    return 0.80 * math.pow(mass / 75.0, exponent)


def mass_for_coefficient(coefficient: float, exponent: float = 2.5) -> float:
    """Mass [kg] that gives a printed K_res [N.cm2]."""
    return 75.0 * math.pow(coefficient / 0.80, 1.0 / exponent)


def saturated_moment(
    k: float, limit: float, spin: float, rolling: float, floor: float = 5e-3
) -> float:
    """Torque against the spin, K spin/rolling up to `limit`: -limit u/sqrt(1 + u^2) [N.m].

    Args:
        k: coefficient K_res [N.m2].
        limit: torque at standstill M_pa [N.m].
        spin: turning rate of the patch on the floor, yaw rate plus steering rate [rad/s].
        rolling: rolling speed [m/s].
        floor: least rolling speed that counts [m/s].
    """
    u = k * spin / (limit * max(abs(rolling), floor))
    return -limit * u / math.sqrt(1 + u * u)
