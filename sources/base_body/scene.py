"""Body of the MiR250 with its loads as arrows; its wheels, which are other FMUs, as plain discs.

As `../mobile_base/scene.py`; the discs do not turn, since the body does not know their angles.
"""

from __future__ import annotations

from typing import Any

from ..mobile_base.scene import body_shapes
from ..scene import TYRE, cylinder, move, node, turn
from . import MOUNTS

PLACES = {
    "left": ("0", "0.5*track"),
    "right": ("0", "-0.5*track"),
    "caster_fl": ("caster_x", "caster_y"),
    "caster_fr": ("caster_x", "-caster_y"),
    "caster_rl": ("-caster_x", "caster_y"),
    "caster_rr": ("-caster_x", "-caster_y"),
}


def wheel(name: str, caster: bool) -> dict[str, Any]:
    """A mount: its disc, and its load from the floor up."""
    radius = "0.0625" if caster else "height"
    load = {"arrow": [0, 0, f"1.5e-3*{name}_f_n"], "at": [0, 0, f"-({radius})"]}
    shapes = [cylinder(radius, 0.04, "y", colour=TYRE), load | {"colour": "#d9480f"}]
    return node(name, [move(*PLACES[name], f"{radius}-height")], shapes, "body")


SCENE = [
    node("body", [move("x", "y", "z"), turn("z", "phi")], body_shapes("height"), trail=True),
    *(wheel(mount.name, mount.caster) for mount in MOUNTS),
]
