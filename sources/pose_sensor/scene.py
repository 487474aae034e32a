"""The measured pose as a frame."""

from __future__ import annotations

from ..scene import move, node, turn

SCENE = [
    node("pose", [move("x_meas", "y_meas", "z_meas"), turn("z", "phi_meas")], [{"frame": 0.15}],
         trail=True)
]  # fmt: skip
