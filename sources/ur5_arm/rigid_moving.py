"""Rigid links on a moving mount that feels them.

    M(q) q'' + C q' + g + J_added q'' + (inertial torques of the mount's motion) = tau
    wrench = arm_inertia [a_0; alpha_0] + arm_bias

`arm_inertia` (6x6) and `arm_bias` are the articulated inertia and bias of the arm with its joints
free under the present torques: neither depends on an acceleration, so that mount and arm can be
solved together without iteration. `arm_bias` includes gravity.

Only the mount's angular velocity, its accelerations and its attitude enter the joints' motion; its
velocity and position enter the stored energy.

Not modelled: elasticity of joints and links, gyroscopic moments of the rotors.

Source: Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 7 and 9.
"""

from __future__ import annotations

from ..component import Fidelity, Solver
from ..serial_arm.rigid_moving import equations

__all__ = ["FIDELITY", "equations"]

FIDELITY = Fidelity(level=4, solver=Solver("rk4", 1e-3))
