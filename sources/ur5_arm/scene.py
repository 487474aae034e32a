"""Links drawn along the arm's own kinematics (standard DH), with a joint at each axis."""

from __future__ import annotations

from typing import Any

from ..scene import ACCENT, STEEL, cylinder, move, node, turn

RADII = (0.06, 0.055, 0.045, 0.037, 0.037, 0.037)
"""Of the joints, read off drawings of the UR5 [m]."""


def links() -> list[dict[str, Any]]:
    """A node behind each joint, and one at the end of each link."""
    found, last = [], "mount"
    for i, radius in enumerate(RADII, 1):
        end: list[float | str] = [f"a[{i}]", 0, f"d[{i}]"]
        rods = [
            {"rod": [[0, 0, 0], [0, 0, f"d[{i}]"]], "radius": 0.8 * radius, "colour": STEEL},
            {"rod": [[0, 0, f"d[{i}]"], end], "radius": 0.8 * radius, "colour": "#b9c2cb"},
        ]
        joint = cylinder(radius, 2.1 * radius, "z", colour=ACCENT)
        found += [
            node(f"joint {i}", [turn("z", f"q[{i}]")], [joint, *rods], last),
            node(f"link {i}", [move(*end), turn("x", f"alpha[{i}]")], [], f"joint {i}"),
        ]
        last = f"link {i}"
    return found


SCENE = [
    node(
        "mount",
        [
            move("mount_position[1]", "mount_position[2]", "mount_position[3]"),
            {"quaternion": [f"mount_quaternion[{i}]" for i in range(1, 5)]},
        ],
        [cylinder(0.075, 0.03, "z", (0, 0, 0.015), "#3a3f45")],
    ),
    *links(),
    node("tool", [], [cylinder(0.0315, 0.012, colour="#3a3f45"), {"frame": 0.12}], "link 6",
         trail=True),
]  # fmt: skip
