"""Sensor of an armature current."""

from __future__ import annotations

import math
from typing import Any

from ..component import Component, Solver
from ..model import Model
from ..quantity import Quantity

SX = Any

I = Quantity("i", "A", "current, positive drives forward", start=1.0)  # noqa: E741 - the field's symbol
I_MEAS = Quantity("i_meas", "A", "measured current")
BANDWIDTH = Quantity("bandwidth", "Hz", "corner frequency", 2000.0, minimum=1e-3)
I_F = Quantity("i_f", "A", "current after the sensor's low pass")

COMPONENT = Component(
    "current_sensor",
    "Sensor of an armature current.",
    device="mir250",
    source="digital twin paper, current sensor (first order, 2 kHz)",
    energy=False,
)
SOLVER = Solver("rodas3", step=1e-3)


def low_pass(m: Model, current: SX) -> SX:
    """The current behind a first-order low pass."""
    p = m.parameters(BANDWIDTH)
    x = m.states(I_F)
    m.derivative(x.i_f, 2.0 * math.pi * p.bandwidth * (current - x.i_f))
    return x.i_f
