"""Sensor with a first-order low pass.

    i_meas' = 2 pi f (i - i_meas)

f = 2 kHz gives a time constant of 79.6 us.

Not modelled: sampling, resolution (effect `quantization`).

Source: digital twin paper, current sensor block.
"""

from __future__ import annotations

from .. import current_sensor as qs
from ..component import Fidelity
from ..model import Model
from . import SOLVER, low_pass

FIDELITY = Fidelity(level=1, solver=SOLVER)


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.I)
    current = low_pass(m, u.i)
    current += m.balance("current", "signal", unit="A", value=current, sensor=qs.I_MEAS).effort
    m.output(qs.I_MEAS, current)
