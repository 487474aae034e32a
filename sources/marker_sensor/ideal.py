"""Exact positions of the markers.

    [x_m; y_m]_k = R(phi_frame) ([x; y] + R(phi) [x_b; y_b]_k) + [x_frame; y_frame]

Not modelled: noise, perspective, height of the markers.

Source: rigid-body geometry; crawler paper (markers M1 to M5).
"""

from __future__ import annotations

from .. import marker_sensor as qs
from ..component import Fidelity
from ..model import Model
from . import markers

FIDELITY = Fidelity(level=0)


def equations(m: Model) -> None:
    """Collect the equations."""
    x, y = markers(m)
    m.output(qs.X_M, x)
    m.output(qs.Y_M, y)
