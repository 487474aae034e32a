"""Drives of an omnidirectional base: twist in, torques on its six axles out."""

from __future__ import annotations

from ..component import Component, Port
from ..omni_base import BETA_RATE, PHI_RATE, TAU_BETA, TAU_PHI
from ..quantity import Quantity

VX_SET = Quantity(
    "vx_set", "m/s", "set velocity of the reference point forward, platform axes", start=0.2
)
VY_SET = Quantity("vy_set", "m/s", "set velocity of the reference point to the left")
W_SET = Quantity("w_set", "rad/s", "set yaw rate, positive turns left")
I_D = Quantity("i_d", "A", "currents of the rolling motors, positive drives forward", size=3)
I_S = Quantity("i_s", "A", "currents of the steering motors, positive turns left", size=3)
I_D_MEASURED = Quantity("i_d_measured", "A", "the same as their sensors report it", size=3)
I_S_MEASURED = Quantity("i_s_measured", "A", "the same as their sensors report it", size=3)
BETA_MEASURED = Quantity(
    "beta_measured", "rad", "steering angles as the encoders report them", size=3
)
P_MEASURED = Quantity(
    "p_measured",
    "rad",
    "wheel angles as the encoders report them, rising when the wheels roll along their heading",
    size=3,
)

STEERING = Port("steering", TAU_BETA, BETA_RATE, "gives_effort", -1, "steering motors")
ROLLING = Port("rolling", TAU_PHI, PHI_RATE, "gives_effort", -1, "rolling motors")

COMPONENT = Component(
    "twist_drive",
    "Six motors with speed loops that make an omnidirectional base follow a twist.",
    ports=(STEERING, ROLLING),
    device="omni_bench",
    source="rig sheet omni_bench",
)
