"""Six motors of an omnidirectional base: set motion in, torques on its six axles out."""

from __future__ import annotations

from ..component import Component, Port
from ..omni_base import BETA_RATE, PHI_RATE, TAU_BETA, TAU_PHI
from ..quantity import Quantity

BETA_SET = Quantity("beta_set", "rad", "steering angles that the torques are meant for", size=3)

STEERING = Port("steering", TAU_BETA, BETA_RATE, "gives_effort", -1, "steering motors")
ROLLING = Port("rolling", TAU_PHI, PHI_RATE, "gives_effort", -1, "rolling motors")

COMPONENT = Component(
    "omni_drive",
    "Six motors of an omnidirectional base that is to follow a set motion.",
    ports=(STEERING, ROLLING),
    device="paper",
    source="omnidirectional base paper, inverse dynamics and open-loop simulator (Fig 3)",
)
