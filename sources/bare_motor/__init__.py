"""DC motor without loops: terminal voltage and shaft speed in, torque out."""

from __future__ import annotations

from ..component import Component, Port
from ..dc_motor import TAU, W
from ..quantity import Quantity

U_SET = Quantity(
    "u_set", "V", "voltage that the amplifier is told to apply", start=10.0, nominal=10.0
)

SHAFT = Port("shaft", TAU, W, "gives_effort", -1, "shaft end; the rotor's inertia is outside")

COMPONENT = Component(
    "bare_motor",
    "DC motor on an amplifier that applies the commanded voltage.",
    ports=(SHAFT,),
    device="bench_12v",
    source="Leonhard, Control of Electrical Drives, 2001, ch. 5",
)
