"""What the fidelities of the drive share: set motion, model of the base, torques as output."""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from .. import omni_drive as qs
from ..model import SX, Model
from ..omni_base import (
    BETA,
    BETA_RATE,
    PHI_RATE,
    TAU_BETA,
    TAU_PHI,
    THETA,
    THETA_RATE,
    X_RATE,
    Y_RATE,
    X,
    Y,
)
from ..omni_base.inverse_dynamics import motor_torques
from ..omni_base.platform import (
    ALPHA_A,
    F_S,
    F_V,
    I_P,
    I_PHI,
    I_S,
    L_A,
    M_P,
    M_W,
    W_0,
    X_G,
    Y_G,
    D,
    E,
    R,
)
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
    u = m.inputs(X, Y, THETA, X_RATE, Y_RATE, THETA_RATE, BETA, BETA_RATE, PHI_RATE)
    pose = ca.vertcat(u.x, u.y, u.theta)
    rate = ca.vertcat(u.xd, u.yd, u.thetad)
    return Signals(
        motion[0],
        motion[1],
        motion[2],
        pose,
        rate,
        u.beta,
        u.betad,
        u.phid,
    )


def read_base(m: Model) -> BaseModel:
    """Declare what the drive knows of the base, with the values of the base's device."""
    known = device_values("omni_base", m.device) if m.device in devices("omni_base") else {}

    def value(quantity: Quantity) -> SX:
        entry = known.get(quantity.name)
        if entry is None:
            return m.parameter(quantity)
        start = tuple(entry.value) if isinstance(entry.value, list) else entry.value
        return m.parameter(quantity.with_start(start))

    distance, direction = value(L_A), value(ALPHA_A)
    geometry = Geometry(
        distance * ca.cos(direction), distance * ca.sin(direction), value(E), value(R)
    )
    mass, x_g, y_g = value(M_P), value(X_G), value(Y_G)
    masses = Masses(
        mass,
        mass * x_g,
        mass * y_g,
        value(I_P) + mass * (x_g**2 + y_g**2),
        value(M_W),
        value(D),
        value(I_S),
        value(I_PHI),
    )
    return BaseModel(geometry, masses, (value(F_S), value(F_V), value(W_0)))


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
        ("steering", TAU_BETA, qs.STEERING, signals.beta_rate, torques[0]),
        ("rolling", TAU_PHI, qs.ROLLING, signals.phi_rate, torques[1]),
    ):
        axle = m.balance(name, "rotation", velocity=speed, load=torque)
        m.port(port, m.output(quantity, torque + axle.effort), speed)
        m.supply(ca.dot(torque, speed))
