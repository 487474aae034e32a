"""Rigid links behind elastic gears, on a mount at rest.

    (J_hub + J_added) theta'' = tau - K (theta - q) - D (theta' - q')
    M(q) q'' + C(q, q') q' + g(q) + J_out q'' = K (theta - q) + D (theta' - q')

theta is the gear's output without its twist, as the motor encoder sees it: the outputs `q`, `qd`
and the port of the joints belong to it, the tool to the links (`q_link`, `qd_link`). The states are
theta and the twist theta - q, so that a pose to start from is the same as in the other fidelities.
Mount as in `rigid`.

Not modelled: hysteresis and stiffening of the gear, elastic links, motion of the mount.

Source: Spong, J. Dyn. Sys. Meas. Control 109, 1987, 310-319.
"""

from __future__ import annotations

from ..component import Fidelity, Solver
from ..serial_arm.elastic import equations

__all__ = ["FIDELITY", "equations"]

# The last link on its gear swings at 1 kHz, sqrt(K/J) = 6e3 1/s; RK4 is stable up to 2.8e4 1/s.
FIDELITY = Fidelity(level=5, solver=Solver("rk4", 1e-4))
