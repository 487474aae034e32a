"""The markers where the camera sees them, at a height above the body that is drawn freely."""

from __future__ import annotations

from ..scene import move, node

SCENE = [
    node(f"marker {i}", [move(f"x_m[{i}]", f"y_m[{i}]", 0.14)],
         [{"sphere": 0.01, "colour": "#7a3e9d"}], trail=True)
    for i in range(1, 6)
]  # fmt: skip
