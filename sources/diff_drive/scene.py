"""Round body on two wheels."""

from __future__ import annotations

from ..scene import ACCENT, BODY, box, cylinder, move, node, turn, wheel

SCENE = [
    node("body", [move("x", "y"), turn("z", "phi")], [
        cylinder("0.6*track", "1.2*r", "z", (0, 0, "1.5*r"), BODY),
        box("0.2*track", "0.08*track", "1.25*r", ("0.5*track", 0, "1.5*r"), ACCENT),
    ], trail=True),
    *(node(f"{name} wheel", [move(0, y, "r")], wheel("r", "0.3*r"), "body")
      for name, y in (("left", "0.5*track"), ("right", "-0.5*track"))),
]  # fmt: skip
