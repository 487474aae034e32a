"""Disc on a shaft beside a housing; its size is drawn freely."""

from __future__ import annotations

from ..scene import ACCENT, BODY, DARK, STEEL, box, cylinder, move, node, turn

SCENE = [
    node("bench", [], [
        box(0.34, 0.2, 0.02, (-0.08, 0, 0.01), BODY),
        box(0.08, 0.12, 0.14, (-0.12, 0, 0.09), STEEL),
        cylinder(0.045, 0.1, "x", (-0.21, 0, 0.12), DARK),
    ]),
    node("disc", [move(0.02, 0, 0.12), turn("x", "phi")], [
        cylinder(0.1, 0.02, "x", colour=STEEL),
        cylinder(0.012, 0.12, "x", (-0.055, 0, 0), DARK),
        box(0.022, 0.02, 0.085, (0, 0, 0.05), ACCENT),
    ]),
]  # fmt: skip
