"""Interface of the base to an arm: the arm's inertia comes in, the mount's motion goes out.

The mount applies the wrench [F; M] = Lambda [a; alpha] + p to the arm (body axes, at the mount
point), with the arm's inertia Lambda and bias p, gravity included; the base feels its negative.
Base and arm thus move together without iteration, though they are separate components.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca

from .. import mobile_base as qs
from ..laws.planar_frame import rotated
from ..laws.symmetric import unpack
from ..model import SX, Model


@dataclass(frozen=True)
class Mount:
    """What the arm asks of the base.

    Attributes:
        x, y: position in front of and to the left of O [m].
        height: above the floor [m].
        inertia: Lambda (6x6).
        bias: p (6), with what a floor that leans does.
        lean: what gravity differs from straight down (3).
    """

    x: SX
    y: SX
    height: SX
    inertia: SX
    bias: SX

    lean: SX

    def leaning(self, lean: SX) -> Mount:
        """The same where gravity has changed by so much (3), body axes [m/s2].

        To the arm that is an acceleration of the mount the other way.
        """
        return replace(self, bias=self.bias - self.inertia[:, :3] @ lean, lean=lean)


def read_mount(m: Model) -> Mount:
    """Declare the inputs of the arm and the place of its mount."""
    u = m.inputs(qs.ARM_INERTIA, qs.ARM_BIAS)
    p = m.parameters(qs.MOUNT_X, qs.MOUNT_Y, qs.MOUNT_Z)
    inertia = unpack(u.arm_inertia, 6)
    return Mount(p.mount_x, p.mount_y, p.mount_z, inertia, u.arm_bias, ca.SX.zeros(3))


def write_motion(
    m: Model,
    mount: Mount,
    position: SX,
    quaternion: SX,
    velocity: SX,
    rate: SX,
    acceleration: SX,
    angular: SX,
) -> None:
    """Declare the outputs for the arm."""
    m.output(qs.MOUNT_POSITION, position)
    m.output(qs.MOUNT_QUATERNION, quaternion)
    m.output(qs.MOUNT_VELOCITY, velocity)
    m.output(qs.MOUNT_RATE, rate)
    m.output(qs.MOUNT_ACCELERATION, acceleration - mount.lean)
    m.output(qs.MOUNT_ANGULAR_ACCELERATION, angular)


def write_planar_motion(
    m: Model,
    mount: Mount,
    pose: tuple[SX, SX, SX],
    twist: tuple[SX, SX, SX],
    accelerations: tuple[SX, SX, SX],
) -> tuple[SX, SX]:
    """Declare the outputs for the arm of a base that moves in the plane.

    Args:
        m: the model.
        mount: the mount.
        pose: x, y, heading of O.
        twist: velocity of O in body axes and yaw rate.
        accelerations: acceleration of O (second derivative of the position) in body axes and yaw
            acceleration.

    Returns:
        The velocity of the mount, body axes.
    """
    x, y, phi = pose
    v_x, v_y, w = twist
    a_x, a_y, alpha = accelerations
    d_x, d_y = rotated(phi, mount.x, mount.y)
    v_mx, v_my = v_x - w * mount.y, v_y + w * mount.x
    write_motion(
        m,
        mount,
        ca.vertcat(x + d_x, y + d_y, mount.height),
        ca.vertcat(ca.cos(phi / 2), 0, 0, ca.sin(phi / 2)),
        ca.vertcat(v_mx, v_my, 0),
        ca.vertcat(0, 0, w),
        ca.vertcat(
            a_x - alpha * mount.y - w**2 * mount.x, a_y + alpha * mount.x - w**2 * mount.y, 0
        ),
        ca.vertcat(0, 0, alpha),
    )
    return v_mx, v_my
