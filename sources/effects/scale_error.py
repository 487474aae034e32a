"""Scale error of a camera: all distances in its picture are too long or too short.

    [x; y]_meas = (1 + e) [x; y]

The scale holds about the frame's origin, for the distances between the markers of a body as for its
way. A calibration that took a board for larger or nearer than it was looks like this.

Not modelled: perspective, distortion of the lens, a scale that differs between the axes.

Source: Hartley, Zisserman, Multiple View Geometry in Computer Vision, 2004, ch. 2.4 (similarity).
"""

from __future__ import annotations

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

ERROR = Quantity(
    "error",
    "1",
    "relative error of distances, 0 = absent",
    start=0.003,
    minimum=-0.5,
    strength=True,
)

EFFECT = Effect(
    "scale_error",
    "Scale error of a camera.",
    ("scale",),
    ERROR,
    source="Hartley and Zisserman 2004",
)


def law(e: EffectModel) -> None:
    """Add to the scale."""
    p, scale = e.parameters(e=ERROR), e.signal("value")
    e.add(p.e * scale)
