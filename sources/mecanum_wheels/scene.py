"""Body on four wheels."""

from __future__ import annotations

from ..scene import ACCENT, BODY, box, move, node, turn, wheel

SCENE = [
    node("body", [move("x", "y"), turn("z", "phi")], [
        box("2*(length+r)", "2*width-r", "1.2*r", (0, 0, "1.4*r"), BODY),
        box("0.2*length", "0.5*width", "0.1*r", ("length", 0, "2.05*r"), ACCENT),
    ], trail=True),
    *(node(f"wheel {number}", [move(f"{x}*length", f"{y}*width", "r")], wheel("r", "0.8*r"), "body")
      for number, (x, y) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1)), 1)),
]  # fmt: skip
