"""Joints that know nothing of each other: constant inertias, no gravity, exact kinematics.

    q' = qd,   (J_link + J_added) qd' = tau
    T_06 = product of Rz(q_i) Tz(d_i) Tx(a_i) Rx(alpha_i)

For trying out a controller or a path. The mount's pose moves the tool; nothing acts on the mount.

Not modelled: gravity, coupling of the joints, masses on the mount, payload.

Source: UR5 Denavit-Hartenberg table of Universal Robots.
"""

from __future__ import annotations

from ..component import Fidelity
from ..serial_arm.kinematic import equations

__all__ = ["FIDELITY", "equations"]

FIDELITY = Fidelity(level=0)
