"""The six wheels of a base as parts: two drive wheels that share parameters, and four casters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from .. import mobile_base as qs
from ..caster import M_F, M_W
from ..caster.fork import MOMENTUM, SPIN, SWIVEL_ANGLE, Swing
from ..laws.planar_frame import rotated
from ..model import SX, Model
from ..quantity import Quantity
from ..variant import device_values, devices, fidelity
from ..wheel_contact import R
from .body import LOADS

CASTER_X = Quantity(
    "caster_x", "m", "caster pivots in front of and behind O", start=0.25, minimum=1e-2, nominal=0.1
)
CASTER_Y = Quantity(
    "caster_y", "m", "caster pivots to the left and right of O", start=0.1875, minimum=1e-2
)
PSI = Quantity("psi", "rad", "swivel angles front left, front right, rear left, rear right", size=4)

CASTERS = (("caster_fl", 1, 1), ("caster_fr", 1, -1), ("caster_rl", -1, 1), ("caster_rr", -1, -1))
"""Names of the casters and the signs of their positions."""


@dataclass(frozen=True)
class Places:
    """Where the wheels are, in body axes.

    Attributes:
        radius: of the drive wheels [m].
        half_track: drive wheels stand at y = +-half_track [m].
        x, y: casters stand at (+-x, +-y) [m].
    """

    radius: SX
    half_track: SX
    x: SX
    y: SX

    @property
    def casters(self) -> list[tuple[SX, SX]]:
        """Pivots in the order of `CASTERS`."""
        return [(sx * self.x, sy * self.y) for _, sx, sy in CASTERS]


@dataclass(frozen=True)
class Foot:
    """Where a caster's wheel stands, and how its place moves in the body as the fork swings.

    Attributes:
        pivot_x, pivot_y: the swivel axis, body axes [m].
        x, y: the wheel from there [m].
        swing: rate of the swivel angle [rad/s].
    """

    pivot_x: SX
    pivot_y: SX
    x: SX = 0
    y: SX = 0
    swing: SX = 0


@dataclass(frozen=True)
class Drive:
    """Vertical motion and load of a drive wheel.

    Attributes:
        load: normal force, where the base computes it [N].
        height, climb: of the wheel centre [m], [m/s].
    """

    load: SX
    height: SX
    climb: SX = 0


@dataclass(frozen=True)
class Wheels:
    """What the wheels do to the body, about the point of the floor below O, body axes.

    Attributes:
        force_x, force_y, moment: sums over all wheels [N], [N.m].
        lift: normal forces of the left and the right drive wheel [N].
        relief: 3x3, force and moment on the body per rate of (u_x, u_y, w_z): what the swinging
            forks take off the mass.
        torques: on the left and the right axle [N.m].
        speeds, angles: of the left and the right drive wheel [rad/s], [rad].
        psi: swivel angles [rad].
    """

    force_x: SX
    force_y: SX
    moment: SX
    lift: tuple[SX, SX]
    relief: SX
    torques: tuple[SX, SX]
    speeds: tuple[SX, SX]
    angles: tuple[SX, SX]
    psi: SX


def part_values(m: Model, component: str) -> dict[str, Any]:
    """The values that this device has in the component's own folder."""
    if m.device not in devices(component):
        return {}
    return {name: entry.value for name, entry in device_values(component, m.device).items()}


def wheel_parameter(m: Model, quantity: Quantity) -> SX:
    """Declare a parameter that the drive wheels share, with the value of their device."""
    return _shared(m, "wheel_contact", "drive_wheel", quantity)


def caster_parameter(m: Model, quantity: Quantity) -> SX:
    """Declare a parameter that the casters share, with the value of their device."""
    return _shared(m, "caster", "caster", quantity)


def _shared(m: Model, component: str, prefix: str, quantity: Quantity) -> SX:
    start = part_values(m, component).get(quantity.name, quantity.start)
    return m.parameter(quantity.with_start(start), shared=prefix)


def read_places(m: Model) -> Places:
    """Declare where the wheels are."""
    radius = wheel_parameter(m, R)
    p = m.parameters(qs.TRACK, CASTER_X, CASTER_Y)
    return Places(radius, p.track / 2, p.caster_x, p.caster_y)


def read_caster_mass(m: Model) -> SX:
    """Declare the mass of one caster."""
    return caster_parameter(m, M_F) + caster_parameter(m, M_W)


def read_feet(m: Model, places: Places, u: tuple[SX, SX, SX]) -> list[Foot]:
    """Declare the states of the casters, on which their loads depend.

    Args:
        m: the model.
        places: where the pivots are.
        u: velocity of the body at the floor below O, body axes, and yaw rate.
    """
    if m.slots["caster"] == "point":  # it has no fork
        return [Foot(x, y) for x, y in places.casters]
    swing = Swing(lambda quantity: caster_parameter(m, quantity))
    feet = []
    for (name, _, _), (p_x, p_y) in zip(CASTERS, places.casters, strict=True):
        _, angle, momentum = (_caster_state(m, name, q) for q in (SPIN, SWIVEL_ANGLE, MOMENTUM))
        h_x, h_y = ca.cos(angle), ca.sin(angle)
        aside = h_x * (u[1] + u[2] * p_x) - h_y * (u[0] - u[2] * p_y)
        rate = swing.rate(momentum, aside) - u[2]
        feet.append(Foot(p_x, p_y, -swing.trail * h_x, -swing.trail * h_y, rate))
    return feet


def _caster_state(m: Model, name: str, quantity: Quantity) -> SX:
    start = part_values(m, "caster").get(quantity.name, quantity.start)
    return m.state(quantity.with_start(start), part=name)


def add_wheels(
    m: Model,
    places: Places,
    pose: tuple[SX, SX, SX],
    u: tuple[SX, SX, SX],
    drives: tuple[Drive, Drive],
    caster_loads: Sequence[SX],
    caster_torques: Sequence[SX] = (0, 0, 0, 0),
) -> Wheels:
    """Build the six wheels in.

    Args:
        m: the model.
        places: where they are.
        pose: x, y and heading of O.
        u: velocity of the body at the floor below O, body axes, and yaw rate.
        drives: left and right drive wheel.
        caster_loads: normal forces in the order of `CASTERS`.
        caster_torques: what they do to the forks where the body leans.
    """
    x, y, phi = pose
    u_x, u_y, w_z = u
    force_x, force_y, moment = ca.SX(0), ca.SX(0), ca.SX(0)
    lift, torques, speeds, angles, psi = [], [], [], [], []

    slot = m.slots["wheel_contact"]
    component, equations = fidelity("wheel_contact", slot)
    values = part_values(m, "wheel_contact")
    for name, side, tau, added, drive in (
        ("left", 1, qs.TAU_L, qs.J_L, drives[0]),
        ("right", -1, qs.TAU_R, qs.J_R, drives[1]),
    ):
        p_y = side * places.half_track
        d_x, d_y = rotated(phi, 0, p_y)
        torques.append(m.input(tau))
        out = m.part(
            name,
            component,
            slot,
            equations,
            inputs={
                "tau": torques[-1],
                "J_added": m.input(added),
                "v_x": u_x - w_z * p_y,
                "v_y": u_y,
                "v_z": drive.climb,
                "w_z": w_z,
                "z": drive.height,
                "f_n": drive.load,
                "x_w": x + d_x,
                "y_w": y + d_y,
            },
            values=values,
            shared="drive_wheel",
        )
        force_x += out["f_x"]
        force_y += out["f_y"]
        moment += out["m_z"] - p_y * out["f_x"]
        lift.append(out["f_z"])
        speeds.append(out["w"])
        angles.append(out["phi"])

    slot = m.slots["caster"]
    component, equations = fidelity("caster", slot)
    values = part_values(m, "caster")
    relief = ca.SX.zeros(3, 3)
    for (name, _, _), (p_x, p_y), load, torque in zip(
        CASTERS, places.casters, caster_loads, caster_torques, strict=True
    ):
        d_x, d_y = rotated(phi, p_x, p_y)
        out = m.part(
            name,
            component,
            slot,
            equations,
            inputs={
                "v_x": u_x - w_z * p_y,
                "v_y": u_y + w_z * p_x,
                "w_z": w_z,
                "f_n": load,
                "tau_f": torque,
                "x_w": x + d_x,
                "y_w": y + d_y,
            },
            values=values,
            shared="caster",
        )
        force_x += out["f_x"]
        force_y += out["f_y"]
        moment += out["m_z"] + p_x * out["f_y"] - p_y * out["f_x"]
        xx, xy, yy = out["relief"][0], out["relief"][1], out["relief"][2]
        xw, yw = p_x * xy - p_y * xx, p_x * yy - p_y * xy
        for (i, j), entry in {
            (0, 0): xx,
            (0, 1): xy,
            (0, 2): xw,
            (1, 1): yy,
            (1, 2): yw,
            (2, 2): p_x * yw - p_y * xw,
        }.items():
            relief[i, j] += entry
        psi.append(out["psi"])
    for i, j in ((0, 1), (0, 2), (1, 2)):
        relief[j, i] = relief[i, j]
    return Wheels(
        force_x,
        force_y,
        moment,
        (lift[0], lift[1]),
        relief,
        (torques[0], torques[1]),
        (speeds[0], speeds[1]),
        (angles[0], angles[1]),
        ca.vertcat(*psi),
    )


def write_wheels(m: Model, wheels: Wheels, loads: Sequence[SX]) -> None:
    """Declare the outputs of the wheels and bind their axles."""
    (w_l, w_r), (phi_l, phi_r) = wheels.speeds, wheels.angles
    for quantity, value in ((qs.W_L, w_l), (qs.W_R, w_r), (qs.PHI_L, phi_l), (qs.PHI_R, phi_r)):
        m.output(quantity, value)
    m.output(PSI, wheels.psi)
    m.output(LOADS, ca.vertcat(*loads))
    m.port(qs.AXLE_L, wheels.torques[0], w_l)
    m.port(qs.AXLE_R, wheels.torques[1], w_r)
