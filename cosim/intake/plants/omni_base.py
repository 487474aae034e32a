"""An omnidirectional base on three off-centre steerable wheels, from its constraints.

Nine coordinates X = (x, y, theta, steering angles, wheel angles); the six conditions that no wheel
slips, A X' = 0, are kept by forces of constraint:

    [T  A^T] [X''    ]   [forces - velocity forces]
    [A   0 ] [-lambda] = [-A' X'                  ]

T is the inertia of platform and wheel sets, all from the velocities of their mass centres.

Not modelled: slip, load transfer between the wheels, motors and gears.

Source: omnidirectional base paper; its geometry and inertias are assumed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from ...errors import CosimError

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Machine:
    """What one base is like [SI units].

    Attributes:
        f_s, f_v: dry and viscous friction of each axle [N.m], [N.m.s/rad].
        m_p, I_p: mass of the platform [kg], yaw inertia about its mass centre [kg.m2].
        M_pa, K: pivot friction of a wheel's patch at standstill [N.m], and per spin over rolling
            speed [N.m2].
    """

    f_s: float = 5.0
    f_v: float = 1.5
    m_p: float = 220.0
    I_p: float = 17.6
    M_pa: float = 0.0
    K: float = 1.0


AXES = 0.35 * np.array([[np.cos(a), np.sin(a)] for a in np.radians([60.0, 180.0, 300.0])])
OFFSET, RADIUS, BEHIND = 0.08, 0.10, 0.06
SET_MASS, SET_INERTIA, SPIN_INERTIA, CENTRE = 10.0, 0.05, 0.03, 0.02
DRY = 0.02
"""Axle speed over which dry friction changes sign [rad/s]."""
STANDING = 0.005
"""Rolling speed that counts as standstill [m/s]."""
TOLERANCE = 1e-8
"""Relative tolerance of the solver: nanometres over a run."""


def _constraints(theta: float, beta: Vector) -> Vector:
    """A (6 x 9): no slip across the wheels, then along them, in terms of world velocities."""
    c, s = np.cos(theta), np.sin(theta)
    result = np.zeros((6, 9))
    for i, ((x, y), b) in enumerate(zip(AXES, beta, strict=True)):
        along = np.array([np.cos(b), np.sin(b)])
        aside = np.array([-np.sin(b), np.cos(b)])
        foot = np.array([x, y]) - OFFSET * along
        for row, way in ((i, aside), (3 + i, along)):
            result[row, 0] = way[0] * c - way[1] * s
            result[row, 1] = way[0] * s + way[1] * c
            result[row, 2] = way[1] * foot[0] - way[0] * foot[1]
        result[i, 3 + i] = -OFFSET  # the foot swings behind its axis
        result[3 + i, 6 + i] = RADIUS  # rolls backward for a positive angle
    return result


def _centres(theta: float, beta: Vector) -> list[tuple[float, Vector]]:
    """Mass and velocity map (2 x 9, world) of platform and wheel sets."""
    c, s = np.cos(theta), np.sin(theta)
    found = []
    places = [np.array([CENTRE, 0.0])]
    places += [
        a - BEHIND * np.array([np.cos(b), np.sin(b)]) for a, b in zip(AXES, beta, strict=True)
    ]
    for number, (x, y) in enumerate(places):
        motion = np.zeros((2, 9))
        motion[0, 0] = motion[1, 1] = 1.0
        motion[:, 2] = (-s * x - c * y, c * x - s * y)
        if number:
            b = theta + beta[number - 1]
            motion[:, 2 + number] = BEHIND * np.array([np.sin(b), -np.cos(b)])
        found.append((SET_MASS if number else 0.0, motion))
    return found


class Plant:
    """The equations of one base."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine

    def inertia(self, coordinates: Vector) -> Vector:
        """T."""
        theta, beta = float(coordinates[2]), coordinates[3:6]
        total = np.zeros((9, 9))
        for mass, motion in _centres(theta, beta):
            total += (mass or self.machine.m_p) * motion.T @ motion
        total[2, 2] += self.machine.I_p
        for i in range(3):
            turning = np.zeros(9)
            turning[[2, 3 + i]] = 1.0
            total += SET_INERTIA * np.outer(turning, turning)
            total[6 + i, 6 + i] += SPIN_INERTIA
        return total

    def bias(self, coordinates: Vector, rates: Vector) -> Vector:
        """Velocity forces: inertia forces of the mass centres where all X'' are 0."""
        theta, beta = float(coordinates[2]), coordinates[3:6]
        w = rates[2]
        result = np.zeros(9)
        for number, (mass, motion) in enumerate(_centres(theta, beta)):
            if number:
                turn = theta + beta[number - 1]
                ahead = np.array([np.cos(turn), np.sin(turn)])
                x, y = AXES[number - 1]
                axis = np.array([np.cos(theta) * x - np.sin(theta) * y,
                                 np.sin(theta) * x + np.cos(theta) * y])  # fmt: skip
                pulled = -(w**2) * axis + BEHIND * (w + rates[2 + number]) ** 2 * ahead
            else:
                pulled = -(w**2) * CENTRE * np.array([np.cos(theta), np.sin(theta)])
            result += (mass or self.machine.m_p) * motion.T @ pulled
        return result

    def friction(self, rates: Vector) -> Vector:
        """Generalised forces of axles and patches, in world axes."""
        m = self.machine
        result = np.zeros(9)
        axles = rates[3:]
        result[3:] = -m.f_s * np.tanh(axles / DRY) - m.f_v * axles
        if m.M_pa:
            spin, rolling = rates[2] + rates[3:6], RADIUS * rates[6:]
            ask = m.K * spin / np.sqrt(rolling**2 + STANDING**2)
            scrub = -m.M_pa * ask / np.sqrt(m.M_pa**2 + ask**2)
            result[3:6] += scrub
            result[2] += float(np.sum(scrub))
        return result

    def free(self, coordinates: Vector, twist: Vector) -> Vector:
        """X' of a twist (x', y', theta') that no wheel slips at."""
        held = _constraints(float(coordinates[2]), coordinates[3:6])
        return np.concatenate([twist, -np.linalg.solve(held[:, 3:], held[:, :3] @ twist)])

    def pulled(self, coordinates: Vector, rates: Vector) -> Vector:
        """A' X', along the motion."""
        step = 1e-6
        ends = [
            _constraints(float(c[2]), c[3:6]) @ rates
            for c in (coordinates - step * rates, coordinates + step * rates)
        ]
        return np.asarray((ends[1] - ends[0]) / (2.0 * step))

    def accelerations(self, coordinates: Vector, rates: Vector, torques: Vector) -> Vector:
        """X'' (9) under the torques of the six motors."""
        held = _constraints(float(coordinates[2]), coordinates[3:6])
        matrix = np.block([[self.inertia(coordinates), held.T], [held, np.zeros((6, 6))]])
        acting = self.friction(rates) - self.bias(coordinates, rates)
        acting[3:] += torques
        right = np.concatenate([acting, -self.pulled(coordinates, rates)])
        return np.asarray(np.linalg.solve(matrix, right)[:9])


def _smooth(times: Vector, start: float, lasting: float) -> tuple[Vector, Vector, Vector]:
    """A step from 0 to 1 and its two derivatives."""
    s = np.clip((times - start) / lasting, 0.0, 1.0)
    return (
        s**3 * (10.0 - 15.0 * s + 6.0 * s**2),
        30.0 * s**2 * (1.0 - s) ** 2 / lasting,
        60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / lasting**2,
    )


def torques(
    machine: Machine, times: Vector, move: tuple[float, float, float], start: float, lasting: float
) -> Vector:
    """Smallest torques that move a base as asked, straight in the world from the origin.

    Args:
        machine: as whoever asks believes it to be.
        times: [s].
        move: along x, along y, about the vertical [m, m, rad].
        start, lasting: [s].

    Returns:
        One row per time: three steering, three rolling torques [N.m].
    """
    plant, result = Plant(machine), np.zeros((times.size, 6))
    part, speed, rate = _smooth(times, start, lasting)
    way = np.array(move)
    fine = np.linspace(0.0, float(times[-1]), 20 * (times.size - 1) + 1)
    fine_speed = _smooth(fine, start, lasting)[1]
    beta = np.zeros(3)
    steered = np.zeros((fine.size, 3))
    for k in range(1, fine.size):  # the wheels swing behind the motion
        before = _smooth(fine[k - 1 : k], start, lasting)[0][0]
        middle = np.concatenate([before * way, beta, np.zeros(3)])
        beta = beta + (fine[k] - fine[k - 1]) * plant.free(middle, fine_speed[k - 1] * way)[3:6]
        steered[k] = beta
    for k in range(times.size):
        if speed[k] == 0.0 and rate[k] == 0.0:
            continue
        coordinates = np.concatenate([part[k] * way, steered[20 * k], np.zeros(3)])
        rates = plant.free(coordinates, speed[k] * way)
        held = _constraints(float(coordinates[2]), coordinates[3:6])
        loose = np.vstack([np.eye(3), -np.linalg.solve(held[:, 3:], held[:, :3])])
        pulled = -np.linalg.solve(held[:, 3:], plant.pulled(coordinates, rates))
        wanted = loose @ (rate[k] * way) + np.concatenate([np.zeros(3), pulled])
        needed = plant.inertia(coordinates) @ wanted + plant.bias(coordinates, rates)
        needed -= plant.friction(rates)
        result[k] = np.linalg.pinv(loose.T[:, 3:]) @ (loose.T @ needed)
    return np.round(result, 6)


def simulate(machine: Machine, times: Vector, asked: Vector) -> dict[str, Vector]:
    """Drive a base from rest by torques, linear between times.

    Args:
        machine: what it is like.
        times: [s].
        asked: one row per time, as of `torques`.

    Returns:
        Columns at these times: x, y [m], theta [rad], beta_1 ... beta_3 [rad].

    Raises:
        CosimError: the equations cannot be solved further.
    """
    plant = Plant(machine)

    def rates(time: float, state: Vector) -> Vector:
        motors = np.array([np.interp(time, times, asked[:, i]) for i in range(6)])
        moving = plant.free(state[:9], state[9:12])
        return np.concatenate([moving, plant.accelerations(state[:9], moving, motors)[:3]])

    found = solve_ivp(
        rates, (0.0, float(times[-1])), np.zeros(12), method="LSODA", t_eval=times, rtol=TOLERANCE,
        atol=1e-2 * TOLERANCE, max_step=0.05,
    )  # fmt: skip
    if not found.success:
        raise CosimError(f"the plant stopped at {found.t[-1]:.3f} s: {found.message}")
    x = found.y
    return {"x": x[0], "y": x[1], "theta": x[2], **{f"beta_{i + 1}": x[3 + i] for i in range(3)}}
