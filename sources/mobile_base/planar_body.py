"""The rigid body of a base in the plane, whatever its wheels are (equations: `planar.py`)."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from .. import mobile_base as qs
from ..laws import planar_body
from ..laws.symmetric import solve
from ..model import SX, Balance, Model
from ..quantity import Quantity
from . import body as bs
from .mount import Mount, write_planar_motion
from .wheels import Places

PRELOAD = Quantity(
    "preload", "N", "load of a drive wheel that does not depend on the weight", minimum=0.0
)
SHARE = Quantity(
    "share",
    "1",
    "stiffness of a drive wheel's suspension over that of a caster",
    start=1.0,
    minimum=0.0,
)


@dataclass(frozen=True)
class Carried:
    """Mass that the casters leave to the body, about O.

    Attributes:
        mass: in total [kg].
        x, y: first moment [kg.m].
        inertia: about the vertical [kg.m2].
    """

    mass: SX
    x: SX
    y: SX
    inertia: SX

    @property
    def matrix(self) -> SX:
        """Force and moment per acceleration of O and yaw acceleration (3x3)."""
        return rigid(self.mass, self.x, self.y, self.inertia)


def rigid(mass: SX, s_x: SX, s_y: SX, inertia: SX) -> SX:
    """Force and moment per acceleration of O and yaw acceleration (3x3) of a rigid body."""
    return ca.vertcat(
        ca.horzcat(mass, 0, -s_y), ca.horzcat(0, mass, s_x), ca.horzcat(-s_y, s_x, inertia)
    )


class PlanarBody:
    """Declares body, cabinet and drive wheels as one rigid body; `close` sets its motion.

    Args:
        m: the model.
        mount: of the arm.
        places: of the wheels.
        carried: what the casters leave to the body; they count its kinetic energy themselves.

    Attributes:
        pose: x, y, heading of O.
        twist: velocity of O in body axes and yaw rate.
        loads: of the wheels left, right, and of the casters [N].
    """

    def __init__(self, m: Model, mount: Mount, places: Places, carried: Carried) -> None:
        p = m.parameters(
            bs.MASS,
            bs.COM_X,
            bs.COM_Y,
            bs.CABINET_MASS,
            bs.DRIVE_MASS,
            bs.I_ZZ,
            bs.CABINET_I_ZZ,
            bs.DRIVE_INERTIA,
        )
        x = m.states(qs.POSE_X, qs.POSE_Y, qs.POSE_PHI, bs.VEL_X, bs.VEL_Y, bs.YAW_RATE)
        self._m, self._places, self._carried = m, places, carried
        self._states = x
        self.pose = (x.pose_x, x.pose_y, x.pose_phi)
        self.twist = (x.vel_x, x.vel_y, x.yaw_rate)
        com = ca.vertcat(p.com_x, p.com_y, 0)
        com += m.balance("load", "position", value=com).effort

        # without the casters, which count their own kinetic energy
        own = p.mass + p.cabinet_mass + 2 * p.drive_mass
        s_x, s_y = p.mass * com[0], p.mass * com[1]
        yaw = (
            p.I_zz
            + p.mass * (com[0] ** 2 + com[1] ** 2)
            + p.cabinet_I_zz
            + 2 * (p.drive_inertia + p.drive_mass * places.half_track**2)
        )
        cos, sin = ca.cos(x.pose_phi), ca.sin(x.pose_phi)
        body = m.balance(
            "body",
            "body",
            velocity=ca.vertcat(x.vel_x, x.vel_y, 0),
            rate=ca.vertcat(0, 0, x.yaw_rate),
            gravity=ca.vertcat(0, 0, -bs.GRAVITY),
            position=ca.vertcat(x.pose_x, x.pose_y, places.radius),
            rotation=ca.vertcat(
                ca.horzcat(cos, -sin, 0), ca.horzcat(sin, cos, 0), ca.horzcat(0, 0, 1)
            ),
            mass=own + carried.mass,
            first_moment=ca.vertcat(s_x + carried.x, s_y + carried.y, 0),
        )
        self._mount = mount.leaning(body.lean)
        self._own = own + body.mass
        self._s_x, self._s_y = s_x + body.first_moment[0], s_y + body.first_moment[1]
        self._yaw = yaw + body.inertia[2, 2]
        self._body = body
        self.loads = self._loads(body)

    def close(self, force_x: SX, force_y: SX, moment: SX, relief: SX) -> SX:
        """Set the motion under what the wheels do, about O, and its outputs.

        Args:
            force_x, force_y, moment: of the wheels, without what the casters leave to the body.
            relief: what the swinging forks take off the mass (3x3).

        Returns:
            Power that the body spends on moving what the casters leave to it [W].
        """
        m, mount, x, carried = self._m, self._mount, self._states, self._carried
        w = x.yaw_rate
        total, yaw = self._own + carried.mass, self._yaw + carried.inertia
        s_x, s_y = self._s_x + carried.x, self._s_y + carried.y
        # velocity components change by v' = a - w x v: their part of what the forks take off
        turning = relief @ ca.vertcat(w * x.vel_y, -w * x.vel_x, 0)
        # rates of O and body to the mount's: [a_m; alpha] = reach [a; alpha] - w^2 (r, 0)
        reach = ca.SX.eye(3)
        reach[0, 2], reach[1, 2] = -mount.y, mount.x
        arm = mount.inertia[[0, 1, 5], [0, 1, 5]]
        arm_bias = mount.bias[[0, 1, 5]] - w**2 * arm @ ca.vertcat(mount.x, mount.y, 0)
        force = (
            ca.vertcat(
                force_x + self._body.effort[0] + s_x * w**2,
                force_y + self._body.effort[1] + s_y * w**2,
                moment + self._body.effort[5],
            )
            + turning
            - reach.T @ arm_bias
        )
        a = solve(rigid(total, s_x, s_y, yaw) + reach.T @ arm @ reach - relief, force)
        cos, sin = ca.cos(x.pose_phi), ca.sin(x.pose_phi)
        m.derivative(x.vel_x, a[0] + w * x.vel_y)
        m.derivative(x.vel_y, a[1] - w * x.vel_x)
        m.derivative(w, a[2])
        m.derivative(x.pose_x, cos * x.vel_x - sin * x.vel_y)
        m.derivative(x.pose_y, sin * x.vel_x + cos * x.vel_y)
        m.derivative(x.pose_phi, w)
        for quantity, value in (
            (qs.X, x.pose_x),
            (qs.Y, x.pose_y),
            (qs.PHI, x.pose_phi),
            (qs.Z, self._places.radius),
            (qs.V, x.vel_x),
            (bs.V_Y, x.vel_y),
            (qs.W_Z, w),
        ):
            m.output(quantity, value)
        v_mx, v_my = write_planar_motion(m, mount, self.pose, self.twist, (a[0], a[1], a[2]))
        m.stored_energy(
            planar_body.kinetic_energy(
                self._own, self._s_x, self._s_y, self._yaw, x.vel_x, x.vel_y, w
            )
        )
        wrench = arm @ (reach @ a) + arm_bias
        m.supply(-(wrench[0] * v_mx + wrench[1] * v_my + wrench[2] * w))
        twist = ca.vertcat(*self.twist)
        swing = carried.matrix @ a - w**2 * ca.vertcat(carried.x, carried.y, 0)
        return ca.dot(twist, swing - relief @ a - turning)

    def _loads(self, body: Balance) -> list[SX]:
        """Wheel loads left, right, and of the casters."""
        mount, places, carried = self._mount, self._places, self._carried
        p = self._m.parameters(PRELOAD, SHARE)
        f, n = body.effort[:3], body.effort[3:]
        force, moment = mount.bias[:3], mount.bias[3:]
        weight = bs.GRAVITY * (self._own + carried.mass) - f[2] + force[2]
        height = mount.height
        m_x = (
            n[0]
            - places.radius * f[1]
            - bs.GRAVITY * (self._s_y + carried.y)
            - (moment[0] + mount.y * force[2] - height * force[1])
        )
        m_y = (
            n[1]
            + places.radius * f[0]
            + bs.GRAVITY * (self._s_x + carried.x)
            - (moment[1] + height * force[0] - mount.x * force[2])
        )
        level = (weight - 2 * p.preload) / (4 + 2 * p.share)
        pitch = m_y / (4 * places.x**2)
        roll = -m_x / (4 * places.y**2 + 2 * p.share * places.half_track**2)
        half = places.half_track
        drives = [p.preload + p.share * (level + roll * y) for y in (half, -half)]
        casters = [level + pitch * x + roll * y for x, y in places.casters]
        return [ca.fmax(0, load) for load in (*drives, *casters)]
