"""A mobile manipulator: a body on two driven wheels and four casters, with or without an arm.

Everything that moves is a mass point with an inertia, placed in the axes of the body about O, the
middle between the drive wheels:

    sum over masses (J_v^T m J_v + J_w^T I J_w) q'' = sum J_v^T (m g - m a_0) + J_w^T (-I alpha_0
        - w x I w) + contact forces + torques of swivels and joints

with J_v, J_w their velocities per velocity of the body (6), the swivels (4) and the joints (6), and
a_0, alpha_0 their accelerations where all q'' are 0. Wheels spin on their own. A wheel stands on
a spring and a damper; friction grows with the slip up to the critical velocity and falls beyond it.

Not modelled: angular momentum of the wheels' spin, rotors' gyroscopics, rolling resistance,
sampling of the controllers.

Source: digital twin paper of MiR250 and UR5 (blocks, dimensions); masses of the arm from its maker.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from ...errors import CosimError

Vector = NDArray[np.float64]
GRAVITY = 9.81
"""[m/s2]"""
SETTLED = 3.0
"""Time [s] for which the machine stands before its log begins: springs and servos come to rest."""
TOLERANCE = 1e-6
"""Relative tolerance of the solver: poses change by less than 1e-6 m with a tenth of it."""
LONGEST = 0.05
"""Longest step [s]: no change of the command is stepped over."""
DIFFERENCE = 1e-7
"""Relative step of differences: a tenth of the digits."""
FOLDED = (0.0, -np.pi / 2, 0.0, -np.pi / 2, 0.0, 0.0)
STRETCHED = (np.pi / 2, -0.1, 0.2, -0.1 - np.pi / 2, -np.pi / 2, 0.0)
"""[rad] Poses of the arm: upright, and stretched to the right."""
MOUNT = 0.70
"""Height of the arm's mount above the floor [m]."""
FLANGE = 2.9
"""Mass of the arm's base flange [kg], a disc of 75 mm radius."""


@dataclass(frozen=True)
class Machine:
    """What one machine is like; SI units, motor values at the motor's shaft.

    Attributes:
        grip, sliding: friction coefficients of all wheels, at the critical velocity and beyond.
        critical: slip velocity of the largest friction [m/s].
        kp_speed, ki_speed: of the wheels' speed loops [A.s/rad], [A/rad].
        rotor: inertia of a drive motor's rotor [kg.m2].
    """

    grip: float = 0.7
    sliding: float = 0.5
    critical: float = 0.002
    kp_speed: float = 1.6
    ki_speed: float = 8.4
    rotor: float = 2.0e-4


@dataclass(frozen=True)
class Command:
    """What a run asks for; between its times everything is interpolated.

    Attributes:
        times: [s], from 0.
        speed, rate: of the base, forward [m/s] and about the vertical [rad/s].
        joints: set angles of the arm, one row per time [rad].
    """

    times: Vector
    speed: Vector
    rate: Vector
    joints: Vector = field(default_factory=lambda: np.zeros((0, 6)))


# -- masses ----------------------------------------------------------------------------------------

R_DRIVE, R_CASTER, HALF_TRACK = 0.100, 0.0625, 0.205
PIVOTS = np.array([[0.25, 0.1875], [0.25, -0.1875], [-0.25, 0.1875], [-0.25, -0.1875]])
TRAIL, HUB, WHEEL, CASTER_Z = 0.0382, 0.31, 0.471, 0.08
SPRING, DAMPER, ONSET = 1e5, 1500.0, 1e-4
J_DRIVE, J_CASTER, B_CASTER, B_SWIVEL = 0.00716, 0.00092, 2e-3, 0.05
J_FORK = 0.00031 + 0.0005
RATIO, EFFICIENCY = 10.167, 0.90
K_T, R_A, L_A, B_M = 0.13, 0.10, 2e-4, 5e-4
KP_I, KI_I, U_MAX, I_MAX, ACC_MAX, T_REF = 0.19, 94.0, 48.0, 41.4, 50.8, 1e-3

DH_D = (0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996)
DH_A = (0.0, -0.425, -0.3922, 0.0, 0.0, 0.0)
DH_ALPHA = (np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0)
LINK_MASS = np.array([3.761, 8.058, 2.846, 1.37, 1.3, 0.365])
LINK_CENTRE = np.array([
    [0.0, -0.02561, 0.00193], [0.2125, 0.0, 0.11336], [0.15, 0.0, 0.0265],
    [0.0, -0.0018, 0.01634], [0.0, 0.0018, 0.01634], [0.0, 0.0, -0.001159],
])  # fmt: skip
_TENSORS = (
    (0.0070021, 0.00648091, 0.00657286, 7.3e-07, -1.053e-05, 0.00049994),
    (0.01505885, 0.33388086, 0.33247207, -5.4e-05, 5.63e-06, -1.81e-06),
    (0.00399632, 0.07879254, 0.0784851, -1.365e-05, 0.00137272, -6.6e-06),
    (0.00165491, 0.00135962, 0.00126279, -2.82e-06, -4.38e-06, 0.00010157),
    (0.00135617, 0.00127827, 0.00096614, -2.74e-06, 4.44e-06, -5.048e-05),
    (0.00018694, 0.00018908, 0.00025756, 6e-08, -1.7e-07, -9.2e-07),
)
LINK_INERTIA = np.array([
    [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]] for xx, yy, zz, xy, xz, yz in _TENSORS
])  # fmt: skip
ARM_N = 101.0
ARM_ETA = np.array([0.80, 0.80, 0.80, 0.75, 0.75, 0.75])
ARM_B = np.array([8.0, 8.0, 8.0, 3.0, 3.0, 3.0])
ARM_KT = np.array([0.12, 0.12, 0.12, 0.10, 0.10, 0.10])
ARM_R = np.array([0.5, 0.5, 0.5, 1.8, 1.8, 1.8])
ARM_L = np.array([6e-4, 6e-4, 6e-4, 1.5e-3, 1.5e-3, 1.5e-3])
ARM_J = np.array([1e-4, 1e-4, 1e-4, 2e-5, 2e-5, 2e-5])
ARM_KP = np.array([500.0, 500.0, 500.0, 400.0, 400.0, 400.0])
ARM_KI = np.array([400.0, 400.0, 400.0, 300.0, 300.0, 300.0])
ARM_KD = np.array([2.0, 2.0, 2.0, 1.6, 1.6, 1.6])
ARM_TF = 1.0 / (2.0 * np.pi * 400.0)


def cross(a: Vector, b: Vector) -> Vector:
    """Cross product along the last axis; NumPy's own takes several times as long."""
    result = np.empty(np.broadcast_shapes(a.shape, b.shape))
    result[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    result[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    result[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return result


def _body() -> tuple[Vector, Vector, Vector]:
    """Masses, centres about O and inertias of what is fixed in the body."""
    at = np.array([
        [0.0, 0.0, 0.15], [0.0, 0.0, 0.50], [0.0, HALF_TRACK, R_DRIVE], [0.0, -HALF_TRACK, R_DRIVE],
        [0.0, 0.0, MOUNT],
    ])  # fmt: skip
    at[:, 2] -= R_DRIVE
    mass = np.array([70.01, 15.0, 4.933, 4.933, FLANGE])
    thin = FLANGE * 0.075**2 / 4
    inertia = np.array([np.diag(d) for d in (
        (2.327, 4.099, 5.697), (0.40, 0.5125, 0.5125), (0.004, 0.0, 0.004), (0.004, 0.0, 0.004),
        (thin, thin, 2 * thin),
    )])  # fmt: skip
    return mass, at, inertia


@dataclass(frozen=True)
class Chain:
    """Where the links are and how they move with their joints, in the body's axes about O.

    Attributes:
        centre, inertia: of the links.
        linear, angular: velocities per joint speed, links x 3 x joints.
        linear_0, angular_0: accelerations that the joint speeds alone make.
        tool: where the tool is.
    """

    centre: Vector
    inertia: Vector
    linear: Vector
    angular: Vector
    linear_0: Vector
    angular_0: Vector
    tool: Vector


def chain(q: Vector, qd: Vector) -> Chain:
    """The arm at some angles and joint speeds, its mount at rest."""
    place, turned = np.array([0.0, 0.0, MOUNT - R_DRIVE]), np.eye(3)
    origins, axes = np.empty((6, 3)), np.empty((6, 3))
    centre, inertia = np.empty((6, 3)), np.empty((6, 3, 3))
    for i in range(6):
        origins[i], axes[i] = place, turned[:, 2]
        c, s, ca, sa = np.cos(q[i]), np.sin(q[i]), np.cos(DH_ALPHA[i]), np.sin(DH_ALPHA[i])
        place = place + turned @ np.array([DH_A[i] * c, DH_A[i] * s, DH_D[i]])
        turned = turned @ np.array([[c, -s * ca, s * sa], [s, c * ca, -c * sa], [0.0, sa, ca]])
        centre[i] = place + turned @ LINK_CENTRE[i]
        inertia[i] = turned @ LINK_INERTIA[i] @ turned.T
    moved = np.tril(np.ones((6, 6)))  # link i moves with the joints up to i
    linear = moved[:, :, None] * cross(axes[None], centre[:, None] - origins[None])
    angular = moved[:, :, None] * axes[None]
    # axes and arms turn with the joints below: their rates give the accelerations
    below = np.vstack([np.zeros(3), np.cumsum(axes * qd[:, None], axis=0)])
    axis_rate = cross(below[:6], axes)
    before = np.vstack([np.zeros(3), np.cumsum(axis_rate * qd[:, None], axis=0)])[1:]
    origin_rate = np.einsum("ijk,j->ik", np.tril(np.ones((6, 6)), -1)[:, :, None]
                            * cross(axes[None], origins[:, None] - origins[None]), qd)  # fmt: skip
    centre_rate = np.einsum("ijk,j->ik", linear, qd)
    arm = centre[:, None] - origins[None]
    arm_rate = centre_rate[:, None] - origin_rate[None]
    changing = cross(axis_rate[None], arm) + cross(axes[None], arm_rate)
    linear_0 = np.einsum("ijk,j->ik", moved[:, :, None] * changing, qd)
    return Chain(centre, inertia, linear.transpose(0, 2, 1), angular.transpose(0, 2, 1),
                 linear_0, before, place)  # fmt: skip


# -- equations -------------------------------------------------------------------------------------


class Plant:
    """The equations of one machine under one command.

    Args:
        machine: what it is like.
        command: what it is asked for.
        arm: joints that move; without, they are locked.
        pose: angles of the arm at the start.
    """

    def __init__(self, machine: Machine, command: Command, *, arm: bool, pose: Vector) -> None:
        self.machine, self.command, self.arm, self.pose = machine, command, arm, pose
        self.mass, self.centre, self.inertia = _body()
        self.joints = 6 if arm else 0
        if not arm:
            links = chain(pose, np.zeros(6))
            self.mass = np.append(self.mass, LINK_MASS)
            self.centre = np.vstack([self.centre, links.centre])
            self.inertia = np.concatenate([self.inertia, links.inertia])
        behind = WHEEL * TRAIL / (HUB + WHEEL)
        self.behind = behind
        turning = J_FORK + HUB * behind**2 + WHEEL * (TRAIL - behind) ** 2
        self.caster_inertia = np.diag([0.0, 0.0, turning])
        fixed = self.mass.size
        self.count = fixed + 4 + self.joints
        self.all_mass = np.concatenate([self.mass, np.full(4, HUB + WHEEL),
                                        LINK_MASS[: self.joints]])  # fmt: skip
        self.size = 10 + self.joints
        jac_v, jac_w = np.zeros((2, self.count, 3, self.size))
        jac_v[:, :, :3] = np.eye(3)
        jac_w[:, :, 3:6] = np.eye(3)
        self.jac_v, self.jac_w, self.fixed = jac_v, jac_w, fixed
        self.contacts = np.zeros((6, 3, self.size))
        self.contacts[:, :, :3] = np.eye(3)

    # state: x y z roll pitch yaw | psi(4) | q | v w | psi'(4) | q' | wheels(2) | casters(4)
    #        | motors: current(2) current integral(2) speed integral(2) set speed(2)
    #        | servos: integral(6) filter(6) current(6)

    def start(self) -> Vector:
        """At rest, near where the springs hold it."""
        n = self.size
        state = np.zeros(2 * n + 6 + 8 + 3 * self.joints)
        weight = float(np.sum(self.all_mass)) * GRAVITY
        state[2] = R_DRIVE - weight / 6.0 / SPRING
        if self.arm:
            state[10 : 10 + 6] = self.pose
            links = chain(self.pose, np.zeros(6))
            torque = GRAVITY * np.einsum("i,ij->j", LINK_MASS, links.linear[:, 2])
            current = torque / (ARM_N * ARM_ETA * ARM_KT)
            state[-18:-12], state[-6:] = ARM_R * current, current
        return state

    def rates(self, time: float, state: Vector) -> Vector:
        """Time derivative of the state."""
        n, joints, machine = self.size, self.joints, self.machine
        place, speed = state[:n], state[n : 2 * n]
        wheels, motors = state[2 * n : 2 * n + 6], state[2 * n + 6 : 2 * n + 14]
        roll, pitch, yaw = place[3:6]
        cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
        cy, sy = np.cos(yaw), np.sin(yaw)
        v, w = speed[:3], speed[3:6]
        up = np.array([-sp, cp * sr, cp * cr])
        psi, swing = place[6:10], speed[6:10]
        h = np.stack([np.cos(psi), np.sin(psi), np.zeros(4)], axis=1)
        n_c = np.stack([-h[:, 1], h[:, 0], np.zeros(4)], axis=1)
        seat = np.column_stack([PIVOTS, np.full(4, 0.0)])

        centre = np.empty((self.count, 3))
        inertia = np.empty((self.count, 3, 3))
        relative, relative_0 = np.zeros((2, self.count, 3))
        spin, spin_0 = np.zeros((2, self.count, 3))
        fixed, jac_v, jac_w = self.fixed, self.jac_v, self.jac_w
        centre[:fixed], inertia[:fixed] = self.centre, self.inertia
        lump = slice(fixed, fixed + 4)
        centre[lump] = seat - self.behind * h
        centre[lump, 2] = CASTER_Z - R_DRIVE
        inertia[lump] = self.caster_inertia
        relative[lump] = -self.behind * n_c * swing[:, None]
        relative_0[lump] = self.behind * h * (swing**2)[:, None]
        spin[lump, 2] = swing
        for i in range(4):
            jac_v[fixed + i, :, 6 + i] = -self.behind * n_c[i]
            jac_w[fixed + i, 2, 6 + i] = 1.0
        if joints:
            links, part = chain(place[10:], speed[10:]), slice(fixed + 4, fixed + 10)
            centre[part], inertia[part] = links.centre, links.inertia
            jac_v[part, :, 10:], jac_w[part, :, 10:] = links.linear, links.angular
            relative[part], relative_0[part] = links.linear @ speed[10:], links.linear_0
            spin[part], spin_0[part] = links.angular @ speed[10:], links.angular_0
        # w x p is -[p]x w
        jac_v[:, 0, 4], jac_v[:, 0, 5] = centre[:, 2], -centre[:, 1]
        jac_v[:, 1, 3], jac_v[:, 1, 5] = -centre[:, 2], centre[:, 0]
        jac_v[:, 2, 3], jac_v[:, 2, 4] = centre[:, 1], -centre[:, 0]
        turning = w + spin
        accelerated = cross(w, v + cross(w, centre) + 2.0 * relative) + relative_0
        turned = cross(w, spin) + spin_0
        momentum = np.einsum("ijk,ik->ij", inertia, turning)
        force = self.all_mass[:, None] * (-GRAVITY * up - accelerated)
        moment = -np.einsum("ijk,ik->ij", inertia, turned) - cross(turning, momentum)
        flat_v = jac_v.reshape(-1, n)
        flat_w = jac_w.reshape(-1, n)
        weighed = (self.all_mass[:, None, None] * jac_v).reshape(-1, n)
        matrix = flat_v.T @ weighed + flat_w.T @ (inertia @ jac_w).reshape(-1, n)
        acting = flat_v.T @ force.ravel() + flat_w.T @ moment.ravel()

        # -- wheels on the floor
        radius = np.array([R_DRIVE, R_DRIVE, R_CASTER, R_CASTER, R_CASTER, R_CASTER])
        hub = np.empty((6, 3))
        hub[0], hub[1] = (0.0, HALF_TRACK, 0.0), (0.0, -HALF_TRACK, 0.0)
        hub[2:] = seat - TRAIL * h
        hub[2:, 2] = R_CASTER - R_DRIVE
        foot = hub - radius[:, None] * up
        contacts = self.contacts
        contacts[:, 0, 4], contacts[:, 0, 5] = foot[:, 2], -foot[:, 1]
        contacts[:, 1, 3], contacts[:, 1, 5] = -foot[:, 2], foot[:, 0]
        contacts[:, 2, 3], contacts[:, 2, 4] = foot[:, 1], -foot[:, 0]
        for i in range(4):
            contacts[2 + i, :, 6 + i] = -TRAIL * n_c[i]
        moving = contacts @ speed
        depth = -(place[2] - 0.0 + foot @ up)
        climb = moving @ up
        share = np.clip(depth / ONSET, 0.0, 1.0)
        onset = share * share * (3.0 - 2.0 * share)
        load = np.maximum(0.0, onset * (SPRING * depth - DAMPER * climb))
        ahead = np.vstack([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], h])
        ahead = ahead - (ahead @ up)[:, None] * up
        ahead = ahead / np.sqrt(np.sum(ahead**2, axis=1))[:, None]
        aside = cross(up, ahead)
        slip_x = np.sum(moving * ahead, axis=1) - radius * wheels
        slip_y = np.sum(moving * aside, axis=1)
        slip = np.sqrt(slip_x**2 + slip_y**2)
        x = slip / machine.critical
        beyond = machine.sliding + (machine.grip - machine.sliding) * np.exp(
            -(((np.maximum(x, 1.0) - 1.0) / 2.0) ** 2)
        )
        # friction over slip, finite at standstill
        gain = np.where(
            x <= 1.0,
            machine.grip * (3.0 - x**2) / 2.0 / machine.critical,
            beyond / np.maximum(slip, machine.critical),
        )
        f_x, f_y = -gain * load * slip_x, -gain * load * slip_y
        push = load[:, None] * up + f_x[:, None] * ahead + f_y[:, None] * aside
        acting += np.einsum("ijk,ij->k", contacts, push)
        acting[6:10] -= B_SWIVEL * swing

        # -- drives
        driven, current, held, kept, wanted = wheels[:2], *motors.reshape(4, 2)
        v_d = np.interp(time, self.command.times, self.command.speed)
        w_d = np.interp(time, self.command.times, self.command.rate)
        ask = RATIO / R_DRIVE * np.array([v_d - HALF_TRACK * w_d, v_d + HALF_TRACK * w_d])
        set_rate = np.clip((ask - wanted) / T_REF, -ACC_MAX, ACC_MAX)
        lag = wanted - RATIO * driven
        amperes = np.clip(machine.kp_speed * lag + kept, -I_MAX, I_MAX)
        miss = amperes - current
        volts = np.clip(KP_I * miss + held, -U_MAX, U_MAX)
        torque = K_T * current - B_M * RATIO * driven
        axle = (RATIO * EFFICIENCY * torque - R_DRIVE * f_x[:2]) / (
            J_DRIVE + RATIO**2 * machine.rotor
        )
        rolling = (-R_CASTER * f_x[2:] - B_CASTER * wheels[2:]) / J_CASTER
        result = np.empty_like(state)
        result[2 * n : 2 * n + 2], result[2 * n + 2 : 2 * n + 6] = axle, rolling
        result[2 * n + 6 : 2 * n + 14] = np.concatenate([
            (volts - R_A * current - K_T * RATIO * driven) / L_A, KI_I * miss,
            machine.ki_speed * lag, set_rate,
        ])  # fmt: skip

        # -- servos of the arm
        if joints:
            q, qd = place[10:], speed[10:]
            integral, filtered, amps = state[-18:].reshape(3, 6)
            asked = np.array([
                np.interp(time, self.command.times, self.command.joints[:, i]) for i in range(6)
            ])  # fmt: skip
            error = asked - q
            change = (error - filtered) / ARM_TF
            voltage = np.clip(ARM_KP * error + integral + ARM_KD * change, -48.0, 48.0)
            acting[10:] += ARM_N * ARM_ETA * ARM_KT * amps - ARM_B * qd
            index = np.arange(10, 16)
            matrix[index, index] += ARM_N**2 * ARM_J
            result[-18:] = np.concatenate([
                ARM_KI * error, change, (voltage - ARM_R * amps - ARM_KT * ARM_N * qd) / ARM_L,
            ])  # fmt: skip

        accelerations = np.linalg.solve(matrix, acting)
        yaw_rate = (w[1] * sr + w[2] * cr) / cp
        turn = np.array([
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            up,
        ])  # fmt: skip
        result[:3] = turn @ v
        result[3], result[4], result[5] = w[0] + yaw_rate * sp, w[1] * cr - w[2] * sr, yaw_rate
        result[6:n] = speed[6:]
        result[n : 2 * n] = accelerations
        return result

    def slope(self, time: float, state: Vector) -> Vector:
        """Derivatives of the rates by the state; SciPy's own grow their steps without bound."""
        rates = self.rates(time, state)
        result = np.empty((state.size, state.size))
        for i, value in enumerate(state.tolist()):
            step = DIFFERENCE * max(abs(value), 1e-2)
            moved = state.copy()
            moved[i] += step
            result[:, i] = (self.rates(time, moved) - rates) / step
        return result


def tool(state: Vector, pose: Vector, *, arm: bool) -> Vector:
    """Place of the tool in the world [m]."""
    roll, pitch, yaw = state[3:6]
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    cy, sy = np.cos(yaw), np.sin(yaw)
    turn = np.array([
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ])  # fmt: skip
    links = chain(state[10:16] if arm else pose, np.zeros(6))
    found: Vector = state[:3] + turn @ links.tool
    return found


def simulate(
    machine: Machine, command: Command, *, arm: bool = False, pose: Any = FOLDED
) -> dict[str, Vector]:
    """Let a machine stand until it is at rest, then drive it.

    Args:
        machine: what it is like.
        command: what it is asked for.
        arm: with moving joints.
        pose: of the arm at the start.

    Returns:
        Columns at the times of the command: x, y, phi of O [m, rad] from where it stood; v, w_z
        [m/s, rad/s]; tool_x, tool_y, tool_z [m]; with an arm qd_1 ... qd_6 [rad/s].

    Raises:
        CosimError: the equations cannot be solved further.
    """
    pose = np.asarray(pose, dtype=np.float64)
    joints = command.joints if arm else np.zeros((2, 6))
    rest = Command(np.array([0.0, SETTLED]), np.zeros(2), np.zeros(2), np.vstack([joints[:1]] * 2))
    still = Plant(machine, rest, arm=arm, pose=pose)
    state = _solve(still, still.start(), np.array([0.0, SETTLED]))[-1]
    state[[0, 1, 5]] = 0.0
    plant = Plant(machine, command, arm=arm, pose=pose)
    found = _solve(plant, state, command.times)
    n = plant.size
    tools = np.array([tool(row, pose, arm=arm) for row in found])
    columns = {
        "x": found[:, 0], "y": found[:, 1], "phi": found[:, 5],
        "v": found[:, n], "w_z": found[:, n + 5],
        "tool_x": tools[:, 0], "tool_y": tools[:, 1], "tool_z": tools[:, 2],
    }  # fmt: skip
    if arm:
        columns |= {f"qd_{i + 1}": found[:, n + 10 + i] for i in range(6)}
    return columns


def _solve(plant: Plant, state: Vector, times: Vector) -> Vector:
    """States at some times, one row each."""
    with np.errstate(invalid="ignore", over="ignore"):  # SciPy's BDF begins with garbage
        found = solve_ivp(
            plant.rates, (float(times[0]), float(times[-1])), state, method="BDF", t_eval=times,
            jac=plant.slope, rtol=TOLERANCE, atol=1e-2 * TOLERANCE, max_step=LONGEST,
        )  # fmt: skip
    if not found.success:
        raise CosimError(f"the plant stopped at {found.t[-1]:.3f} s: {found.message}")
    rows: Vector = found.y.T
    return rows
