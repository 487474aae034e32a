"""Platform on three motorised off-centre steerable wheels."""

from __future__ import annotations

from ..component import Component, Port
from ..quantity import Quantity

TAU_BETA = Quantity(
    "tau_beta", "N.m", "torque of the steering motors, positive turns beta up", size=3, nominal=5.0
)
TAU_PHI = Quantity(
    "tau_phi", "N.m", "torque of the rolling motors, positive turns phi up", size=3, nominal=5.0
)

X = Quantity("x", "m", "world position of the platform's reference point")
Y = Quantity("y", "m", "world position of the platform's reference point")
THETA = Quantity("theta", "rad", "heading of the platform, unwrapped, positive turns left")
X_RATE = Quantity("xd", "m/s", "world velocity of the reference point along x")
Y_RATE = Quantity("yd", "m/s", "world velocity of the reference point along y")
THETA_RATE = Quantity("thetad", "rad/s", "yaw rate, positive turns left")
BETA = Quantity("beta", "rad", "steering angles of the wheels relative to the platform", size=3)
PHI = Quantity(
    "phi", "rad", "spin angles of the wheels, falling when they roll along their heading", size=3
)
BETA_RATE = Quantity("betad", "rad/s", "steering rates", size=3)
PHI_RATE = Quantity("phid", "rad/s", "spin rates", size=3)

POSE_X = Quantity("pose_x", "m", "state behind x", nominal=1.0)
POSE_Y = Quantity("pose_y", "m", "state behind y", nominal=1.0)
POSE_THETA = Quantity("pose_theta", "rad", "state behind theta")
VEL_X = Quantity("vel_x", "m/s", "state behind xd")
VEL_Y = Quantity("vel_y", "m/s", "state behind yd")
YAW_RATE = Quantity("yaw_rate", "rad/s", "state behind thetad")
STEERING_ANGLE = Quantity("steering_angle", "rad", "state behind beta", size=3)
ROLLING_ANGLE = Quantity("rolling_angle", "rad", "state behind phi", size=3)

STEERING = Port("steering", TAU_BETA, BETA_RATE, "gives_motion", +1, "steering axles")
ROLLING = Port("rolling", TAU_PHI, PHI_RATE, "gives_motion", +1, "wheel axles")

COMPONENT = Component(
    "omni_base",
    "Omnidirectional platform on three off-centre steerable wheels, all six axles motorised.",
    ports=(STEERING, ROLLING),
    device="paper",
    source="omnidirectional base paper, Performance study of an omnidirectional mobile robot, 2011",
)
