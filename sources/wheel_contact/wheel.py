"""What all fidelities share: the spin of the wheel, the slip of its contact, the balances.

u = v turned into the direction of rolling;  s_x = u_x - r w,  s_y = u_y
direction of rolling: toe - t_turn w_z from the wheel's plane
(J_w + J_added) w' = tau - r f_x - c_rr f_n r tanh(w/w_rr) + axle
P_loss = -(f_x s_x + f_y s_y) + c_rr f_n r w tanh(w/w_rr)   (sliding, rolling)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from ..laws.contact import SMALL, normal_force, rolling_resistance
from ..model import SX, Model
from ..quantity import Quantity
from . import (
    ANGLE,
    AXLE,
    C_RR,
    F_N,
    F_X,
    F_Y,
    F_Z,
    HUB_X,
    HUB_Y,
    HUB_Z,
    J_ADDED,
    J_W,
    M_Z,
    PHI,
    SPEED,
    T_TURN,
    TAU,
    V_X,
    V_Y,
    V_Z,
    W_RR,
    W_Z,
    X_W,
    Y_W,
    YAW,
    R,
    W,
    Z,
)

K = Quantity("k", "N/m", "normal stiffness of tread and floor", start=1e5, minimum=1.0, nominal=1e5)
B = Quantity("b", "N.s/m", "normal damping", start=1500.0, minimum=0.0, nominal=1e3)
WIDTH = Quantity(
    "width",
    "m",
    "penetration over which the normal force sets in",
    start=1e-4,
    minimum=1e-9,
    nominal=1e-4,
)


@dataclass(frozen=True)
class Contact:
    """What a friction law reads.

    Attributes:
        s_x, s_y: slip velocity along the wheel's plane and across [m/s].
        f_n: normal force [N].
        rolling: r w, the speed at which the wheel rolls [m/s].
        x, y: world position [m].
    """

    s_x: SX
    s_y: SX
    f_n: SX
    rolling: SX
    x: SX
    y: SX


Friction = Callable[[Contact], tuple[SX, SX]]
"""Forces of the floor on the wheel along its plane and across."""


def wheel(
    m: Model, friction: Friction, *, computes_normal: bool = False, elastic: bool = False
) -> None:
    """Collect the equations of a wheel with the given friction.

    Args:
        m: the model.
        friction: gives the tangential forces.
        computes_normal: the normal force comes from the height of the wheel, not from `f_n`.
        elastic: `friction` stores energy and reports its losses itself.
    """
    torque, added = m.input(TAU), m.input(J_ADDED)
    v_x, v_y, v_z, w_z = m.input(V_X), m.input(V_Y), m.input(V_Z), m.input(W_Z)
    height, given = m.input(Z), m.input(F_N)
    x_w, y_w = m.input(X_W), m.input(Y_W)
    r, inertia = m.parameter(R), m.parameter(J_W)
    c_rr, w_rr = m.parameter(C_RR), m.parameter(W_RR)
    angle, speed = m.state(ANGLE), m.state(SPEED)

    runout = m.balance("radius", "coefficient", unit="m", value=r, angle=angle)
    radius = r + runout.effort
    slope = ca.jacobian(radius, angle)  # of an eccentric wheel, else structurally 0
    toe = m.balance("toe", "coefficient", unit="rad", value=0).effort
    direction = toe - m.parameter(T_TURN) * w_z
    cos, sin = ca.cos(direction), ca.sin(direction)

    if computes_normal:
        m.input_rate(height, v_z)
        k, b, width = m.parameter(K), m.parameter(B), m.parameter(WIDTH)
        f_n, energy, loss = normal_force(radius - height, slope * speed - v_z, k, b, width)
        m.stored_energy(energy)
        m.loss("normal", loss)
        lift = slope * f_n
        m.port(HUB_Z, f_n, v_z)
    else:
        f_n, lift = given, 0
        m.port(HUB_Z, 0, v_z)  # a rigid floor: the given force does no work

    s_x = cos * v_x + sin * v_y - radius * speed
    s_y = cos * v_y - sin * v_x
    along, across = friction(Contact(s_x, s_y, f_n, radius * speed, x_w, y_w))
    if not elastic:
        m.loss("slip", -(along * s_x + across * s_y))
    resistance = rolling_resistance(c_rr, f_n, radius, speed, w_rr)
    m.loss("rolling", resistance * speed)

    axle = m.balance(
        "axle",
        "rotation",
        velocity=speed,
        angle=angle,
        load=torque,
        normal=f_n,
        radius=radius,
    )
    floor = m.balance(
        "floor",
        "pivot",
        spin=w_z,
        rolling=ca.sqrt((radius * speed) ** 2 + SMALL),
        normal=f_n,
    )
    m.derivative(angle, speed)
    m.derivative(
        speed,
        (torque - radius * along - resistance - lift + axle.effort) / (inertia + added),
    )
    f_x = m.output(F_X, cos * along - sin * across)
    f_y = m.output(F_Y, sin * along + cos * across)
    m.output(F_Z, f_n)
    m_z = m.output(M_Z, floor.effort)
    m.output(W, speed)
    m.output(PHI, angle)
    m.stored_energy((inertia + added) * speed**2 / 2)
    m.port(AXLE, torque, speed)
    m.port(HUB_X, f_x, v_x)
    m.port(HUB_Y, f_y, v_y)
    m.port(YAW, m_z, w_z)
