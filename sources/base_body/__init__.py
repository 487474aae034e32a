"""Body of a differential-drive base: forces of its six wheels in, motion of their mounts out."""

from __future__ import annotations

from dataclasses import dataclass

from ..component import Component, Port
from ..mobile_base import W_Z
from ..quantity import Quantity

HEIGHT = Quantity(
    "height", "m", "height of O, the drive wheels' radius", start=0.1, minimum=1e-3, nominal=0.1
)


@dataclass(frozen=True)
class Mount:
    """Where a drive wheel or a caster is mounted: its quantities and ports.

    Attributes:
        name: prefix of the names.
        caster: whether a caster is mounted there.
        f_x, f_y, m_z: inputs, what the wheel does to the body.
        mass, relief: inputs, what a caster leaves to the body.
        v_x, v_y, x_w, y_w, f_n: outputs, what the wheel reads.
        ports: along x, along y, about the vertical.
    """

    name: str
    caster: bool
    f_x: Quantity
    f_y: Quantity
    m_z: Quantity
    mass: Quantity
    relief: Quantity
    v_x: Quantity
    v_y: Quantity
    x_w: Quantity
    y_w: Quantity
    f_n: Quantity
    ports: tuple[Port, Port, Port]


def _mount(name: str, text: str, caster: bool) -> Mount:
    def of(short: str, unit: str, meaning: str, size: int = 0) -> Quantity:
        return Quantity(f"{name}_{short}", unit, f"{text}: {meaning}", size=size)

    f_x = of("f_x", "N", "force on the body, body x axis")
    f_y = of("f_y", "N", "force on the body, body y axis")
    m_z = of("m_z", "N.m", "moment on the body about the vertical, positive left")
    v_x = of("v_x", "m/s", "velocity, body x axis (forward)")
    v_y = of("v_y", "m/s", "velocity, body y axis (left)")
    return Mount(
        name,
        caster,
        f_x,
        f_y,
        m_z,
        of("mass", "kg", "mass that the body carries there for the caster"),
        of("relief", "kg", "xx, xy, yy of the mass that the swinging fork takes off", size=3),
        v_x,
        v_y,
        of("x_w", "m", "world position"),
        of("y_w", "m", "world position"),
        of("f_n", "N", "load"),
        (
            Port(f"{name}_x", f_x, v_x, "gives_motion", +1, f"{text}, forward"),
            Port(f"{name}_y", f_y, v_y, "gives_motion", +1, f"{text}, sideways"),
            Port(f"{name}_yaw", m_z, W_Z, "gives_motion", +1, f"{text}, about the vertical"),
        ),
    )


MOUNTS = (
    _mount("left", "left drive wheel", False),
    _mount("right", "right drive wheel", False),
    _mount("caster_fl", "front left caster", True),
    _mount("caster_fr", "front right caster", True),
    _mount("caster_rl", "rear left caster", True),
    _mount("caster_rr", "rear right caster", True),
)
"""In the order of the loads of `mobile_base`."""

COMPONENT = Component(
    "base_body",
    "Body of a differential-drive base; its wheels and casters are FMUs of their own.",
    ports=tuple(port for mount in MOUNTS for port in mount.ports),
    device="mir250",
    devices_of="mobile_base",
    like="mobile_base",
    source="digital twin paper, MiR250 model",
)
