"""A wheel on a flat floor: normal force, friction with and without creep, rolling resistance.

Source: spring-damper with a smooth onset and stick-slip friction as in MathWorks' Spatial Contact
Force block, whose blending formulas are not published: those here are C1 and ours. Creep: Johnson,
Contact Mechanics, 1985, ch. 8.
"""

from __future__ import annotations

from typing import Any

import casadi as ca

SX = Any

FORCE_FLOOR = 1e-6
"""Friction limit [N] below which creep friction becomes viscous: keeps a lifted wheel regular."""


SMALL = 1e-24
"""Added to squared speeds and lengths (SI), so that their roots have a slope at 0."""


def normal_force(d: SX, d_dot: SX, k: SX, b: SX, width: SX) -> tuple[SX, SX, SX]:
    """Normal force, elastic energy and loss power of a floor that is penetrated by the depth `d`.

    f = max(0, s (k d + b d')),  s = x^2 (3 - 2 x),  x = d/width limited to 0 ... 1
    """
    x = ca.fmax(0, ca.fmin(d / width, 1))
    s = x * x * (3 - 2 * x)
    elastic = s * k * d
    f = ca.fmax(0, elastic + s * b * d_dot)
    rise = width**2 * x**4 * (3 / 4 - 2 / 5 * x)  # integral of s d over the transition
    beyond = ca.fmax(d, width)
    energy = k * (rise + (beyond * beyond - width**2) / 2)
    return f, energy, (f - elastic) * d_dot


def stick_slip(s_x: SX, s_y: SX, f_n: SX, mu_s: SX, mu_d: SX, v_c: SX) -> tuple[SX, SX]:
    """Friction force against the slip velocity s, v = |s|:

    mu(v) = mu_s (v/v_c) (3 - (v/v_c)^2)/2                          for v <= v_c
          = mu_d + (mu_s - mu_d) exp(-((v/v_c - 1)/2)^2)            for v > v_c
    """
    square = (s_x * s_x + s_y * s_y) / (v_c * v_c)
    ratio = ca.sqrt(ca.fmax(square, 1))  # v/v_c, 1 below v_c
    mu = mu_d + (mu_s - mu_d) * ca.exp(-(((ratio - 1) / 2) ** 2))
    gain = -f_n * mu * (3 - ca.fmin(square, 1)) / (2 * v_c * ratio)
    return gain * s_x, gain * s_y


def creep(s_x: SX, s_y: SX, c_x: SX, c_y: SX, limit: SX) -> tuple[SX, SX]:
    """Friction that creeps in proportion to its force and cannot exceed a limit.

    p_i = -s_i/c_i,   f_i = p_i / sqrt(1 + |p|^2/limit^2)
    """
    p_x, p_y = -s_x / c_x, -s_y / c_y
    bound = ca.fmax(limit, FORCE_FLOOR)
    scale = bound / ca.sqrt(bound * bound + p_x * p_x + p_y * p_y)
    return scale * p_x, scale * p_y


def creepage(s_x: SX, s_y: SX, speed: SX, c_x: SX, c_y: SX, load: SX, limit: SX) -> tuple[SX, SX]:
    """Friction in proportion to load and creepage, that approaches a limit.

    p_i = -c_i load s_i/speed,   f_i = p_i tanh(|p|/limit)/(|p|/limit)
    """
    p_x, p_y = -c_x * load * s_x / speed, -c_y * load * s_y / speed
    ratio = ca.sqrt(p_x * p_x + p_y * p_y + SMALL) / ca.fmax(limit, FORCE_FLOOR)
    scale = ca.tanh(ratio) / ratio
    return scale * p_x, scale * p_y


def creep_coefficient(c: SX, rest: SX, v: SX, v_creep: SX) -> SX:
    """Creep coefficient at the rolling speed v, `c (rest + (1 - rest) v^2/(v^2 + v_creep^2))`."""
    square = v * v
    return c * (rest + (1 - rest) * square / (square + v_creep * v_creep))


def rolling_resistance(c: SX, f_n: SX, r: SX, w: SX, w_0: SX) -> SX:
    """Moment against rolling, `c f_n r tanh(w/w_0)`."""
    return c * f_n * r * ca.tanh(w / w_0)
