"""What the swivelling fidelities share: fork and wheel under a given friction law.

With h = (cos psi, sin psi) along the wheel and n across it, trail t, yaw rate W = w_z + psi' of the
fork, total mass m and first moment c = m_w t + m_f t x_f behind the pivot, inertia J about it:

    s_h = v.h - r w,   s_n = v.n - t W,   (f_h, f_n) by the friction law
    J_c w' = -r f_h - b_w w - c_rr N r tanh(w/w_rr) + axle
    T = -t f_n - b_s psi' + swivel + floor + tau_f
    J W' = T + c a.n                                 (a: acceleration of the pivot)
    force on the body at the pivot: f_h h + f_n n + c (W' n - W^2 h) - m a
    moment on the body: b_s psi' - swivel

a is eliminated. The state is the fork's angular momentum about the pivot, L = J W - c v.n, whose
rate T + c W v.h holds no acceleration. The force on the body is split into

    f_h h + f_n n + (c/J) T n - c W^2 h + (c^2/J) w_z (v.h) n                 `f_x`, `f_y`
    -m a + (c^2/J) n (n.v')                                                  `mass`, `relief`

with v' the rates of the velocity components in body axes, of which the body computes the second
line. The kinetic energy m |v|^2/2 - c W v.n + J W^2/2 counts here.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

from .. import caster as qs
from ..laws.contact import SMALL, rolling_resistance
from ..model import SX, Model
from ..quantity import Quantity

TRAIL = Quantity("trail", "m", "wheel axis behind the swivel axis", start=0.0382, minimum=1e-4)
R = Quantity("r", "m", "rolling radius", start=0.0625, minimum=1e-3)
J_C = Quantity("J_c", "kg.m2", "spin inertia of the wheel", start=0.00092, minimum=1e-9)
J_T = Quantity("J_t", "kg.m2", "yaw inertia of the wheel about its centre", start=5e-4, minimum=0.0)
J_F = Quantity(
    "J_f", "kg.m2", "yaw inertia of the fork about its mass centre", start=3e-4, minimum=1e-9
)
X_F = Quantity("x_f", "1", "mass centre of the fork behind the swivel axis, in trails")
B_S = Quantity("b_s", "N.m.s/rad", "viscous damping of the swivel", start=0.05, minimum=0.0)
B_W = Quantity("b_w", "N.m.s/rad", "viscous friction of the wheel bearing", minimum=0.0)
C_RR = Quantity("c_rr", "1", "rolling resistance coefficient", minimum=0.0, nominal=0.01)
W_RR = Quantity(
    "w_rr",
    "rad/s",
    "wheel speed over which the rolling resistance changes sign",
    start=0.1,
    minimum=1e-6,
)

SWIVEL_ANGLE = Quantity("swivel_angle", "rad", "state: swivel angle psi")
MOMENTUM = Quantity(
    "momentum", "N.m.s", "state: angular momentum of fork and wheel about the pivot", nominal=1e-3
)
SPIN = Quantity("spin", "rad/s", "state: wheel speed")

Friction = Callable[[SX, SX, SX, SX, SX, SX], tuple[SX, SX]]
"""(s_h, s_n, normal force, r w, x, y) -> forces along the wheel and across it."""


class Swing:
    """Inertia of fork and wheel about the pivot.

    Attributes:
        trail: wheel axis behind the swivel axis [m].
        mass, moment, inertia: m, c, J of fork and wheel together [kg], [kg.m], [kg.m2].
    """

    def __init__(self, read: Callable[[Quantity], SX]) -> None:
        fork_mass, wheel_mass, self.trail = read(qs.M_F), read(qs.M_W), read(TRAIL)
        behind = read(X_F) * self.trail
        self.mass = fork_mass + wheel_mass
        self.moment = wheel_mass * self.trail + fork_mass * behind
        self.inertia = read(J_T) + read(J_F) + wheel_mass * self.trail**2 + fork_mass * behind**2

    def rate(self, momentum: SX, aside: SX) -> SX:
        """Yaw rate W of the fork [rad/s] by its momentum and the pivot's velocity v.n [m/s]."""
        return momentum / self.inertia + self.moment / self.inertia * aside


def fork(m: Model, friction: Friction) -> None:
    """Collect the equations of a swivelling caster with the given friction."""
    u = m.inputs(qs.V_X, qs.V_Y, qs.W_Z, qs.F_N, qs.X_W, qs.Y_W, qs.TAU_F)
    swing = Swing(m.parameter)
    p = m.parameters(R, J_C, B_S, B_W, C_RR, W_RR)
    x = m.states(SPIN, SWIVEL_ANGLE, MOMENTUM)
    w, psi = x.spin, x.swivel_angle
    trail, mass, moment, inertia = swing.trail, swing.mass, swing.moment, swing.inertia

    ratio = moment / inertia
    h_x, h_y = ca.cos(psi), ca.sin(psi)
    ahead, aside = h_x * u.v_x + h_y * u.v_y, h_x * u.v_y - h_y * u.v_x
    rate = swing.rate(x.momentum, aside)
    turning = rate - u.w_z

    s_h, s_n = ahead - p.r * w, aside - trail * rate
    f_h, f_n = friction(s_h, s_n, u.f_n, p.r * w, u.x_w, u.y_w)
    m.loss("slip", -(f_h * s_h + f_n * s_n))
    resistance = rolling_resistance(p.c_rr, u.f_n, p.r, w, p.w_rr)
    m.loss("rolling", resistance * w)
    m.loss("swivel", p.b_s * turning**2)
    m.loss("bearing", p.b_w * w**2)

    swivel = m.balance("swivel", "rotation", velocity=turning, angle=psi, normal=u.f_n)
    axle = m.balance("axle", "rotation", velocity=w, normal=u.f_n, radius=p.r)
    floor = m.balance(
        "floor",
        "pivot",
        spin=rate,
        rolling=ca.sqrt((p.r * w) ** 2 + SMALL),
        normal=u.f_n,
    )
    hinge = swivel.effort - p.b_s * turning
    torque = hinge + floor.effort + u.tau_f - trail * f_n
    m.derivative(w, (axle.effort - p.r * f_h - p.b_w * w - resistance) / p.J_c)
    m.derivative(psi, turning)
    m.derivative(x.momentum, torque + moment * rate * ahead)

    relief = ratio * moment
    along = f_h - moment * rate**2
    across = f_n + ratio * torque + relief * u.w_z * ahead
    f_x = m.output(qs.F_X, along * h_x - across * h_y)
    f_y = m.output(qs.F_Y, along * h_y + across * h_x)
    m.output(qs.F_Z, u.f_n)
    m_z = m.output(qs.M_Z, -hinge)
    m.output(qs.PSI, psi)
    m.output(qs.W, w)
    m.output(qs.W_F, rate)
    m.output(qs.MASS, mass)
    m.output(qs.RELIEF, ca.vertcat(relief * h_y * h_y, -relief * h_x * h_y, relief * h_x * h_x))
    m.stored_energy(
        (mass * (u.v_x**2 + u.v_y**2) - relief * aside**2 + x.momentum**2 / inertia) / 2
        + p.J_c * w**2 / 2
    )
    m.port(qs.PIVOT_X, f_x, u.v_x)
    m.port(qs.PIVOT_Y, f_y, u.v_y)
    m.port(qs.YAW, m_z, u.w_z)
    m.port(qs.FORK, u.tau_f, rate)
