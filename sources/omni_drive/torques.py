"""What the fidelities of the drive share: set motion, model of the base, torques as output."""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from .. import omni_base
from .. import omni_drive as qs
from ..model import SX, Model
from ..omni_base import platform
from ..omni_base.inverse_dynamics import motor_torques
from ..omni_base.rigid_body import Geometry, Masses
from ..pose_trajectory import SET_MOTION
from ..quantity import Quantity
from ..variant import device_values, devices


class Signals(NamedTuple):
    """Set motion (3 each) and what is measured at the base."""

    pose_set: SX
    rate_set: SX
    acceleration_set: SX
    pose: SX
    rate: SX
    beta: SX
    beta_rate: SX
    phi_rate: SX


class BaseModel(NamedTuple):
    """The base as the drive knows it; `friction` is f_s, f_v, w_0 of its axles."""

    geometry: Geometry
    masses: Masses
    friction: tuple[SX, SX, SX]


def read_signals(m: Model) -> Signals:
    """Declare the inputs."""
    motion = [ca.vertcat(*(m.input(quantity) for quantity in row)) for row in SET_MOTION]
    u = m.inputs(
        omni_base.X,
        omni_base.Y,
        omni_base.THETA,
        omni_base.X_RATE,
        omni_base.Y_RATE,
        omni_base.THETA_RATE,
        omni_base.BETA,
        omni_base.BETA_RATE,
        omni_base.PHI_RATE,
    )
    pose = ca.vertcat(u.x, u.y, u.theta)
    rate = ca.vertcat(u.xd, u.yd, u.thetad)
    return Signals(motion[0], motion[1], motion[2], pose, rate, u.beta, u.betad, u.phid)


def read_base(m: Model) -> BaseModel:
    """Declare what the drive knows of the base, with the values of the base's device."""
    known = device_values("omni_base", m.device) if m.device in devices("omni_base") else {}

    def value(quantity: Quantity) -> SX:
        entry = known.get(quantity.name)
        if entry is None:
            return m.parameter(quantity)
        start = tuple(entry.value) if isinstance(entry.value, list) else entry.value
        return m.parameter(quantity.with_start(start))

    distance, direction = value(platform.L_A), value(platform.ALPHA_A)
    geometry = Geometry(
        distance * ca.cos(direction),
        distance * ca.sin(direction),
        value(platform.E),
        value(platform.R),
    )
    mass, x_g, y_g = value(platform.M_P), value(platform.X_G), value(platform.Y_G)
    masses = Masses(
        mass,
        mass * x_g,
        mass * y_g,
        value(platform.I_P) + mass * (x_g**2 + y_g**2),
        value(platform.M_W),
        value(platform.D),
        value(platform.I_S),
        value(platform.I_PHI),
    )
    return BaseModel(
        geometry, masses, (value(platform.F_S), value(platform.F_V), value(platform.W_0))
    )


def least_torques(
    base: BaseModel, theta: SX, beta: SX, rates: SX, acceleration: SX
) -> tuple[SX, SX]:
    """Steering and rolling torques (3 each), least in the sum of squares."""
    return motor_torques(
        base.geometry, base.masses, theta, beta, rates, acceleration, base.friction
    )


def output_torques(m: Model, signals: Signals, beta_set: SX, torques: tuple[SX, SX]) -> None:
    """Open the balances of the axles, output the torques and bind the ports."""
    m.output(qs.BETA_SET, beta_set)
    for name, quantity, port, speed, torque in (
        ("steering", omni_base.TAU_BETA, qs.STEERING, signals.beta_rate, torques[0]),
        ("rolling", omni_base.TAU_PHI, qs.ROLLING, signals.phi_rate, torques[1]),
    ):
        axle = m.balance(name, "rotation", velocity=speed, load=torque)
        m.port(port, m.output(quantity, torque + axle.effort), speed)
        m.supply(ca.dot(torque, speed))
