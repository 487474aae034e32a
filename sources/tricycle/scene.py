"""Body on a fixed axle and a steered, driven wheel."""

from __future__ import annotations

from ..scene import ACCENT, BODY, box, move, node, turn, wheel

SCENE = [
    node("body", [move("x", "y"), turn("z", "phi")], [
        box("l", "0.3*l", "r", ("0.5*l", 0, "2*r"), BODY),
        box("0.1*l", "0.1*l", "0.1*r", ("0.8*l", 0, "2.55*r"), ACCENT),
    ], trail=True),
    *(node(f"{name} wheel", [move(0, y, "r")], wheel("r", "0.4*r"), "body")
      for name, y in (("left", "0.25*l"), ("right", "-0.25*l"))),
    node("driven wheel", [move("l", 0, "r"), turn("z", "ratio*steer")],
         wheel("r", "0.4*r"), "body"),
]  # fmt: skip
