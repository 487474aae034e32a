"""Perfect sensor.

    w_meas = w,   phi_meas = phi

Not modelled: resolution, sampling.

Source: digital twin paper, encoder block (gain 1).
"""

from __future__ import annotations

from .. import encoder as qs
from ..component import Fidelity
from ..model import Model

FIDELITY = Fidelity(level=0)


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.PHI, qs.W)
    w = u.w + m.balance("speed", "signal", unit="rad/s", value=u.w, sensor=qs.W_MEAS).effort
    phi = u.phi + m.balance("angle", "signal", unit="rad", value=u.phi, sensor=qs.PHI_MEAS).effort
    m.output(qs.W_MEAS, w)
    m.output(qs.PHI_MEAS, phi)
