"""Open loop: the torques that the set motion needs, from the set motion alone.

    Gamma = W (W^T W)^-1 (M R xi_set'' + h) + f_s tanh(q'/w_0) + f_v q',   W = [K_beta; K_phi]
    beta_set' = K_beta R xi_set'

Six torques for three degrees of freedom: least in the sum of squares. The steering angles run along
in the drive (`beta_set`, starts where the base starts). Nothing that is measured comes back, so any
difference between base and model adds up.

Not modelled: motors, gears, limits of torque.

Source: omnidirectional base paper, inverse dynamics with all joints motorised, Fig 3 (open-loop
simulator).
"""

from __future__ import annotations

from ..component import Fidelity, Solver
from ..model import Model
from ..omni_base import STEERING_ANGLE
from ..omni_base.rigid_body import joint_map, rotation
from .torques import least_torques, output_torques, read_base, read_signals

FIDELITY = Fidelity(level=0, solver=Solver("rk4", 1e-3))


def equations(m: Model) -> None:
    """Collect the equations."""
    signals, base = read_signals(m), read_base(m)
    x = m.states(STEERING_ANGLE)
    theta, rates = signals.pose_set[2], signals.rate_set
    k_beta, _ = joint_map(base.geometry, x.steering_angle)
    m.derivative(x.steering_angle, k_beta @ (rotation(theta) @ rates))
    output_torques(
        m,
        signals,
        x.steering_angle,
        least_torques(base, theta, x.steering_angle, rates, signals.acceleration_set),
    )
