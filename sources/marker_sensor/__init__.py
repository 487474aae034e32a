"""Camera above the floor that sees markers on a moving body."""

from __future__ import annotations

from typing import Any

import casadi as ca

from ..component import Component
from ..laws.planar_frame import rotated
from ..model import Model
from ..quantity import Quantity

SX = Any
MARKERS = 5

X = Quantity("x", "m", "position of the body in the world")
Y = Quantity("y", "m", "position of the body in the world")
PHI = Quantity("phi", "rad", "heading of the body in the world, positive to the left")
X_M = Quantity("x_m", "m", "measured positions of the markers in the camera frame", size=MARKERS)
Y_M = Quantity("y_m", "m", "measured positions of the markers in the camera frame", size=MARKERS)
X_B = Quantity("x_b", "m", "markers ahead of the body's reference point", size=MARKERS)
Y_B = Quantity("y_b", "m", "markers to the left of the body's reference point", size=MARKERS)
PHI_FRAME = Quantity("phi_frame", "rad", "heading of the world's x axis in the camera frame")
X_FRAME = Quantity("x_frame", "m", "position of the world's origin in the camera frame")
Y_FRAME = Quantity("y_frame", "m", "position of the world's origin in the camera frame")

COMPONENT = Component(
    "marker_sensor",
    "Camera above the floor that sees five markers on a moving body.",
    device="crawler",
    source="crawler paper, markers M1 to M5; rig sheet crawler",
    energy=False,
)


def markers(m: Model) -> tuple[SX, SX]:
    """Exact positions of the markers in the camera frame, two columns."""
    u = m.inputs(X, Y, PHI)
    p = m.parameters(PHI_FRAME, X_B, Y_B, X_FRAME, Y_FRAME)
    pose = ca.vertcat(u.x, u.y, u.phi)
    pose += m.balance("pose", "pose", value=pose).effort
    x, y = rotated(pose[2], p.x_b, p.y_b)
    x, y = rotated(p.phi_frame, pose[0] + x, pose[1] + y)
    x, y = x + p.x_frame, y + p.y_frame
    scale = 1 + m.balance("scale", "scale", unit="1", value=ca.SX(1)).effort
    seen = scale * ca.vertcat(x, y)
    seen += m.balance("picture", "picture", value=seen).effort
    return seen[:MARKERS], seen[MARKERS:]
