"""The frame of a measurement is turned against the frame that the reader assumes.

    [x; y]_meas = [cos a, -sin a; sin a, cos a] [x; y],   yaw_meas = yaw + a

The turn is about the frame's origin. A heading error of a frame calibration looks like this: a
straight run seems to drift sideways.

Not modelled: tilt of the frame out of the floor plane, scale.

Source: digital twin paper, Eq 2-5 (frame calibration between robot map and motion capture).
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.planar_frame import rotated
from ..quantity import Quantity

ANGLE = Quantity(
    "angle",
    "rad",
    "turn of what is measured, counter-clockwise, 0 = absent",
    start=0.01,
    strength=True,
)

EFFECT = Effect(
    "frame_rotation",
    "Heading error of the frame of a measurement.",
    ("pose", "point"),
    ANGLE,
    source="digital twin paper, Eq 2-5",
)


def law(e: EffectModel) -> None:
    """Turn the position, and the heading where there is one."""
    a, value = e.parameter(ANGLE), e.signal("value")
    x, y = rotated(a, value[0], value[1])
    third = a if e.kind == "pose" else ca.SX(0.0)
    e.add(ca.vertcat(x - value[0], y - value[1], *([third] * (e.size - 2))))
