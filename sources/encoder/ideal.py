"""Perfect sensor.

    w_meas = w,   phi_meas = phi

Not modelled: resolution, sampling.

Source: digital twin paper, encoder block (gain 1).
"""

from __future__ import annotations

from ..component import Fidelity
from ..model import Model
from . import PHI, PHI_MEAS, W_MEAS, W

FIDELITY = Fidelity(level=0)


def equations(m: Model) -> None:
    """Collect the equations."""
    phi, w = m.input(PHI), m.input(W)
    w += m.balance("speed", "signal", unit="rad/s", value=w).effort
    phi += m.balance("angle", "signal", unit="rad", value=phi).effort
    m.output(W_MEAS, w)
    m.output(PHI_MEAS, phi)
