"""Body between two tracks, and the virtual wheels at which the tracks seem to roll.

Tracks 0.2 m long, as the length that fits the measured shifts (README); body drawn freely.
"""

from __future__ import annotations

from ..scene import ACCENT, BODY, DARK, STEEL, box, cylinder, move, node, turn

LENGTH, WIDTH = 0.2, 0.04


def track(side: int) -> list[dict[str, object]]:
    """A track at one side (1: left)."""
    y, half = f"{side}*0.5*B", 0.5 * LENGTH
    return [
        box(LENGTH, WIDTH, "2*r", (0, y, "r"), DARK),
        *(cylinder("r", WIDTH, "y", (x, y, "r"), DARK) for x in (-half, half)),
        *(cylinder("0.55*r", 1.06 * WIDTH, "y", (x, y, "r"), STEEL) for x in (-half, 0, half)),
    ]


SCENE = [
    node(
        "body",
        [move("x", "y"), turn("z", "beta")],
        [
            box(0.22, "B-0.05", 0.06, (0, 0, "r+0.03"), BODY),
            box(0.05, 0.06, 0.03, (0.09, 0, "r+0.075"), ACCENT),
            *track(1),
            *track(-1),
        ],
        trail=True,
    ),
    node("virtual right wheel", [move("x_V", "-(0.5*B+e2)", "r")],
         [cylinder("r", 0.004, "y", colour="#d9480f")], "body"),
    node("virtual left wheel", [move("x_V", "0.5*B+e3", "r")],
         [cylinder("r", 0.004, "y", colour="#d9480f")], "body"),
    node("S", [move("x_S", "y_S", 0.12)], [{"sphere": 0.012, "colour": ACCENT}], trail=True),
]  # fmt: skip
