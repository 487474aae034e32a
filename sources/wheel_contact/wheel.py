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

from .. import wheel_contact as qs
from ..laws.contact import SMALL, normal_force, rolling_resistance
from ..model import SX, Model
from ..quantity import Quantity

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
    u = m.inputs(qs.TAU, qs.J_ADDED, qs.V_X, qs.V_Y, qs.V_Z, qs.W_Z, qs.Z, qs.F_N, qs.X_W, qs.Y_W)
    p = m.parameters(qs.R, qs.J_W, qs.C_RR, qs.W_RR, qs.T_TURN)
    x = m.states(qs.ANGLE, qs.SPEED)
    phi, w = x.angle, x.speed

    runout = m.balance("radius", "coefficient", unit="m", value=p.r, angle=phi)
    r = p.r + runout.effort
    slope = ca.jacobian(r, phi)  # of an eccentric wheel, else structurally 0
    toe = m.balance("toe", "coefficient", unit="rad", value=0).effort
    direction = toe - p.t_turn * u.w_z
    cos, sin = ca.cos(direction), ca.sin(direction)

    if computes_normal:
        m.input_rate(u.z, u.v_z)
        law = m.parameters(K, B, WIDTH)
        f_n, energy, loss = normal_force(r - u.z, slope * w - u.v_z, law.k, law.b, law.width)
        m.stored_energy(energy)
        m.loss("normal", loss)
        lift = slope * f_n
        m.port(qs.HUB_Z, f_n, u.v_z)
    else:
        f_n, lift = u.f_n, 0
        m.port(qs.HUB_Z, 0, u.v_z)  # a rigid floor: the given force does no work

    s_x = cos * u.v_x + sin * u.v_y - r * w
    s_y = cos * u.v_y - sin * u.v_x
    along, across = friction(Contact(s_x, s_y, f_n, r * w, u.x_w, u.y_w))
    if not elastic:
        m.loss("slip", -(along * s_x + across * s_y))
    resistance = rolling_resistance(p.c_rr, f_n, r, w, p.w_rr)
    m.loss("rolling", resistance * w)

    axle = m.balance(
        "axle",
        "rotation",
        velocity=w,
        angle=phi,
        load=u.tau,
        normal=f_n,
        radius=r,
    )
    floor = m.balance(
        "floor",
        "pivot",
        spin=u.w_z,
        rolling=ca.sqrt((r * w) ** 2 + SMALL),
        normal=f_n,
    )
    m.derivative(phi, w)
    m.derivative(
        w,
        (u.tau - r * along - resistance - lift + axle.effort) / (p.J_w + u.J_added),
    )
    f_x = m.output(qs.F_X, cos * along - sin * across)
    f_y = m.output(qs.F_Y, sin * along + cos * across)
    m.output(qs.F_Z, f_n)
    m_z = m.output(qs.M_Z, floor.effort)
    m.output(qs.W, w)
    m.output(qs.PHI, phi)
    m.stored_energy((p.J_w + u.J_added) * w**2 / 2)
    m.port(qs.AXLE, u.tau, w)
    m.port(qs.HUB_X, f_x, u.v_x)
    m.port(qs.HUB_Y, f_y, u.v_y)
    m.port(qs.YAW, m_z, u.w_z)
