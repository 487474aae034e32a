"""The angle over which a periodic effect repeats."""

from __future__ import annotations

from ..effect_model import EffectModel
from ..model import SX
from ..quantity import Quantity
from .signal_effect import sized

THETA = Quantity("theta", "rad", "angle of the shaft, integrated from its speed")
ANGLE = Quantity("angle", "rad", "angle of the shaft over which the effect repeats")


def shaft_angle(e: EffectModel, speed: str) -> SX:
    """The balance's own angle, or the integral of its signal `speed` where it offers none."""
    if e.offers("angle"):
        return e.signal("angle")
    theta = e.state(sized(e, THETA))
    e.derivative(theta, e.signal(speed))
    return theta


def shown_angle(e: EffectModel, speed: str) -> SX:
    """The same, also as an output: a search sees in it how often per turn something repeats."""
    return e.output(sized(e, ANGLE), shaft_angle(e, speed))
