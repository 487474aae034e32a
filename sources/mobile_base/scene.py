"""MiR250 with cabinet: drive wheels and casters that turn, wheel loads as arrows.

Body 0.80 x 0.58 m, 0.10 to 0.30 m above the floor (after its data sheet); a newton is 1.5 mm.
"""

from __future__ import annotations

from typing import Any

from ..scene import ACCENT, BODY, DARK, STEEL, TYRE, box, cylinder, move, node, turn, wheel

RADIUS = "drive_wheel.r"
DRIVES = (("left", "0.5*track", "phi_l"), ("right", "-0.5*track", "phi_r"))
CASTERS = tuple(
    (f"{end} {side}", f"{x}*caster_x", f"{y}*caster_y")
    for end, x in (("front", 1), ("rear", -1))
    for side, y in (("left", 1), ("right", -1))
)


def load(number: int, height: str) -> dict[str, Any]:
    """The load of a wheel, from the floor up."""
    arrow = [0, 0, f"1.5e-3*loads[{number}]"]
    return {"arrow": arrow, "at": [0, 0, f"-({height})"], "colour": "#d9480f"}


def drive(number: int, name: str, y: str, angle: str) -> list[dict[str, Any]]:
    """A drive wheel."""
    return [
        node(f"{name} axle", [move(0, y)], [load(number, RADIUS)], "body"),
        node(f"{name} wheel", [turn("y", angle)], wheel(RADIUS, 0.045), f"{name} axle"),
    ]


def caster(number: int, name: str, x: str, y: str) -> list[dict[str, Any]]:
    """A caster that swivels; its wheel's angle is no variable, so the wheel is plain."""
    fork = [
        cylinder(0.025, 0.02, "z", (0, 0, "caster.r+0.01"), DARK),
        box("caster.trail+0.04", 0.05, 0.012, ("-0.5*caster.trail", 0, "caster.r"), DARK),
        box(0.03, 0.05, "caster.r", ("-caster.trail", 0, "0.5*caster.r"), STEEL),
    ]
    rolling = [
        cylinder("caster.r", 0.032, "y", colour=TYRE),
        cylinder("0.5*caster.r", 0.034, "y", colour=ACCENT),
        load(2 + number, "caster.r"),
    ]
    pivot = [move(x, y, f"caster.r-{RADIUS}"), turn("z", f"psi[{number}]")]
    return [
        node(f"{name} fork", pivot, fork, "body"),
        node(f"{name} caster", [move("-caster.trail")], rolling, f"{name} fork"),
    ]


def body_shapes(radius: str) -> list[dict[str, Any]]:
    """Body, cabinet and mount about O, which is `radius` above the floor."""
    return [
        box(0.8, 0.58, 0.2, (0, 0, f"0.20-{radius}"), BODY, 0.55),
        box(0.802, 0.582, 0.03, (0, 0, f"0.16-{radius}"), ACCENT),
        box(0.05, 0.3, 0.02, (0.38, 0, f"0.31-{radius}"), ACCENT),
        box(0.46, 0.42, "mount_z-0.30", (0, 0, f"0.5*(mount_z+0.30)-{radius}"), "#c9d2dc", 0.8),
        cylinder(0.09, 0.02, "z", ("mount_x", "mount_y", f"mount_z-{radius}"), DARK),
    ]


SCENE = [
    node(
        "body",
        [move("x", "y", "z"), turn("z", "phi"), turn("y", "pitch"), turn("x", "roll")],
        body_shapes(RADIUS),
        trail=True,
    ),
    *(item for number, one in enumerate(DRIVES, 1) for item in drive(number, *one)),
    *(item for number, one in enumerate(CASTERS, 1) for item in caster(number, *one)),
]
