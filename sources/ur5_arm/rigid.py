"""Rigid links on a mount at rest.

    M(q) q'' + C(q, q') q' + g(q) + J_added q'' = tau

solved by articulated bodies, without forming M. The mount's pose counts (it may hang from a wall or
stand on a slope), its motion does not. The wrench is the one of a mount at rest, `arm_bias`, and
`arm_inertia` is what the arm weighs as if its joints were locked, which is nearly so under stiff
servos. A moving mount that has to feel the arm truly wants `rigid_moving`.

Not modelled: motion of the mount, elasticity of joints and links, gyroscopic moments of the rotors.

Source: Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 7.
"""

from __future__ import annotations

from ..component import Fidelity, Solver
from ..serial_arm.rigid import equations

__all__ = ["FIDELITY", "equations"]

FIDELITY = Fidelity(level=1, solver=Solver("rk4", 1e-3))
