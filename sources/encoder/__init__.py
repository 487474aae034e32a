"""Sensor of a shaft's angle and speed."""

from __future__ import annotations

from ..component import Component
from ..quantity import Quantity

PHI = Quantity("phi", "rad", "angle of the shaft")
W = Quantity("w", "rad/s", "speed of the shaft", start=10.0)
PHI_MEAS = Quantity("phi_meas", "rad", "measured angle")
W_MEAS = Quantity("w_meas", "rad/s", "measured speed")

COMPONENT = Component(
    "encoder",
    "Sensor of a shaft's angle and speed.",
    device="motor_bench",
    source="digital twin paper, encoder block (gain 1); rig sheets for the counts",
    energy=False,
)
