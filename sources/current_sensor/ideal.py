"""Perfect sensor.

    i_meas = i

Not modelled: bandwidth, sampling, resolution (effect `quantization`).

Source: definition.
"""

from __future__ import annotations

from ..component import Fidelity
from ..model import Model
from . import I_MEAS, I

FIDELITY = Fidelity(level=0)


def equations(m: Model) -> None:
    """Collect the equations."""
    current = m.input(I)
    current += m.balance("current", "signal", unit="A", value=current).effort
    m.output(I_MEAS, current)
