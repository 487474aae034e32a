"""What the fidelities of the arm share: the mount, the links with their load, and the outputs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import casadi as ca

from .. import serial_arm as qs
from ..laws.base_parameters import ELEMENTS, standard_parameters
from ..laws.base_parameters import find as base_parameters
from ..laws.chain import Chain, free_axes, standard_dh
from ..laws.joints import Joints
from ..laws.rigid_chain import ForwardDynamics, Posture, upper_triangle
from ..laws.rotation import product, quaternion_rate, rotation_matrix, rotation_vector
from ..model import SX, Model
from ..quantity import Quantity


class MountMotion(NamedTuple):
    """Motion of the mount: pose in the world, twist and acceleration in its own axes."""

    position: SX
    quaternion: SX
    velocity: SX
    rate: SX
    acceleration: SX
    angular_acceleration: SX


def read_mount(m: Model) -> MountMotion:
    """Declare the inputs that say how the mount moves."""
    u = m.inputs(
        qs.MOUNT_POSITION,
        qs.MOUNT_QUATERNION,
        qs.MOUNT_VELOCITY,
        qs.MOUNT_RATE,
        qs.MOUNT_ACCELERATION,
        qs.MOUNT_ANGULAR_ACCELERATION,
    )
    return MountMotion(
        u.mount_position,
        u.mount_quaternion,
        u.mount_velocity,
        u.mount_rate,
        u.mount_acceleration,
        u.mount_angular_acceleration,
    )


def at_rest(mount: MountMotion) -> MountMotion:
    """The same pose without motion."""
    zero = ca.SX.zeros(3)
    return MountMotion(mount.position, mount.quaternion, zero, zero, zero, zero)


def move_mount(m: Model, mount: MountMotion) -> None:
    """Tell the energy test how the mount's pose and velocity follow from its twist."""
    m.input_rate(mount.position, rotation_matrix(mount.quaternion) @ mount.velocity)
    m.input_rate(mount.quaternion, quaternion_rate(mount.quaternion, mount.rate))
    m.input_rate(mount.velocity, mount.acceleration - ca.cross(mount.rate, mount.velocity))
    m.input_rate(mount.rate, mount.angular_acceleration)


def joint_inputs(m: Model) -> tuple[SX, SX]:
    """Declare the torques on the joints and the inertias that their rotors add."""
    joints = Joints.of_device(m)
    u = m.inputs(joints.sized(qs.TAU), joints.sized(qs.J_ADDED))
    return u.tau, u.J_added


def joint_states(m: Model) -> tuple[SX, SX]:
    """Declare positions and speeds of the joints."""
    joints = Joints.of_device(m)
    x = m.states(joints.sized(qs.ANGLE), joints.sized(qs.SPEED))
    return x.angle, x.speed


def joint_efforts(m: Model, speed: SX, angle: SX, torque: SX) -> SX:
    """Open the balances of the joints, all together and one by one; what effects add to them."""
    return Joints.of_device(m).efforts(m, speed=speed, angle=angle, load=torque)


def chain(m: Model, *, adjustable: bool = True) -> Chain:
    """The links of the device: from standard DH data as numbers, else with base parameters.

    Base parameters are parameters of the FMU. A change of one goes to the parameter of a link after
    which it is named; the others keep the device's numbers. Torques of a mount at rest depend on
    nothing else; how a moving mount feels the arm may.
    """
    if "alpha" in m.values:
        return standard_dh(
            *(m.constant(name) for name in ("d", "a", "alpha", "mass", "centre", "inertia"))
        )
    rotation, offset, prismatic = (m.constant(key) for key in ("rotation", "offset", "prismatic"))
    mass = m.constant("mass")
    standard = standard_parameters(mass, m.constant("centre"), m.constant("inertia"))
    values = [[ca.SX(value) for value in row] for row in standard]
    for base in base_parameters(rotation, offset, prismatic) if adjustable else ():
        start = base.value(standard)
        told = "with what shows only together with it" if base.others else "alone"
        quantity = Quantity(
            base.name,
            base.unit,
            f"base parameter: {ELEMENTS[base.element]} of link {base.link} about its joint, {told}",
            start=start,
            nominal=abs(start) or 1.0,
        )
        change = m.parameter(quantity) - start
        values[base.link - 1][base.element] += change
    return free_axes(
        rotation,
        offset,
        prismatic,
        [row[0] for row in values],
        [row[1:4] for row in values],
        [row[4:] for row in values],
    )


@dataclass(frozen=True)
class Links:
    """The links at the present joint positions and speeds on the present mount.

    Attributes:
        mount: motion of the mount.
        posture: the chain with what effects add to the tool.
        qd: joint speeds.
        gravity: in mount axes.
        load: wrench of the effects on the flange, in its axes.
        tool_twist: velocity and angular velocity of the flange, in its axes.
    """

    mount: MountMotion
    posture: Posture
    qd: SX
    gravity: SX
    load: SX
    tool_twist: SX

    def accelerate(self, torque: SX, rotor: SX) -> ForwardDynamics:
        """Motion of the joints under their torques; the bias includes gravity."""
        dynamics = self.posture.forward_dynamics(
            self.qd,
            torque,
            rotor,
            base_rate=self.mount.rate,
            base_acceleration=self.mount.acceleration - self.gravity,
            base_angular_acceleration=self.mount.angular_acceleration,
            load=self.load,
        )
        weight = dynamics.inertia[:, :3] @ self.gravity
        return replace(dynamics, bias=dynamics.bias - weight)

    def energy(self) -> tuple[SX, SX]:
        """Kinetic and potential energy; zero height is the world's origin."""
        rates = self.posture.rates(self.qd, self.mount.rate)
        velocities = self.posture.velocities(rates, self.mount.velocity, self.mount.rate, self.qd)
        whole = self.posture.mass_properties()
        up = rotation_matrix(self.mount.quaternion).T
        moment = whole.first_moment + whole.mass * (up @ self.mount.position)
        return self.posture.kinetic_energy(rates, velocities), -ca.dot(self.gravity, moment)


def links(m: Model, mount: MountMotion, q: SX, qd: SX) -> Links:
    """Build the chain of the device and open the balances of gravity and of the tool."""
    p = m.parameters(qs.GRAVITY)
    level = ca.vertcat(0, 0, -p.gravity)
    tilted = level + m.balance("base", "gravity", value=level).effort
    rotation = rotation_matrix(mount.quaternion)
    gravity = rotation.T @ tilted
    posture = Posture(chain(m), q)
    rates = posture.rates(qd, mount.rate)
    velocities = posture.velocities(rates, mount.velocity, mount.rate, qd)
    position, turn = posture.flange()
    velocity, rate = posture.flange_motion(rates, velocities)
    tool = m.balance(
        "tool",
        "body",
        velocity=velocity,
        rate=rate,
        gravity=turn.T @ gravity,
        position=mount.position + rotation @ position,
        rotation=rotation @ turn,
    )
    posture = posture.carrying(tool.mass, tool.first_moment, tool.inertia)
    return Links(mount, posture, qd, gravity, tool.effort, ca.vertcat(velocity, rate))


def output_motion(
    m: Model, mount: MountMotion, q: SX, qd: SX, posture: Posture, torque: SX
) -> None:
    """Output joint motion and tool pose and bind the port of the joints.

    `q`, `qd` belong to the gear outputs, `posture` to the links.
    """
    position, _ = posture.flange()
    rotation = rotation_matrix(mount.quaternion)
    attitude = product(mount.quaternion, posture.flange_quaternion())
    joints = Joints.of_device(m)
    m.output(joints.sized(qs.Q), q)
    m.output(joints.sized(qs.QD), qd)
    m.output(qs.TOOL_POSITION, mount.position + rotation @ position)
    m.output(qs.TOOL_ROTATION, rotation_vector(attitude))
    m.port(joints.port(qs.JOINT), torque, qd)


def output_wrench(m: Model, mount: MountMotion, inertia: SX, bias: SX, wrench: SX) -> None:
    """Output the wrench and what it consists of; bind the ports of the mount."""
    m.output(qs.WRENCH, wrench)
    m.output(qs.ARM_INERTIA, upper_triangle(inertia))
    m.output(qs.ARM_BIAS, bias)
    m.port(qs.MOUNT_TRANSLATION, m.output(qs.MOUNT_FORCE, wrench[:3]), mount.velocity)
    m.port(qs.MOUNT_ROTATION, m.output(qs.MOUNT_MOMENT, wrench[3:]), mount.rate)
