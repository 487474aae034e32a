"""The marker does not sit where the reader assumes.

    [x; y]_meas = [x; y] + d R(yaw) [cos g; sin g],   yaw_meas = yaw

d is the distance between the true and the assumed place, g its direction in the body (0 forward,
pi/2 left).

Not modelled: a marker cluster turned on the body (a constant error of the heading).

Source: rigid-body geometry.
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

DISTANCE = Quantity(
    "distance", "m", "offset of the marker, 0 = absent", start=0.01, minimum=0.0, strength=True
)
DIRECTION = Quantity(
    "direction",
    "rad",
    "direction of the offset in the body, 0 forward, left > 0",
    hints=SearchHints(mix="turn"),
)

EFFECT = Effect(
    "marker_offset",
    "Misplaced marker on a body whose pose is measured.",
    ("pose",),
    DISTANCE,
    source="rigid-body geometry",
)


def law(e: EffectModel) -> None:
    """Shift the measured point."""
    d, g, yaw = e.parameter(DISTANCE), e.parameter(DIRECTION), e.signal("value")[2]
    angle = yaw + g
    e.add(d * ca.vertcat(ca.cos(angle), ca.sin(angle), 0.0))
