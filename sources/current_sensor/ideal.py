"""Perfect sensor.

    i_meas = i

Not modelled: bandwidth, sampling, resolution (effect `quantization`).

Source: definition.
"""

from __future__ import annotations

from .. import current_sensor as qs
from ..component import Fidelity
from ..model import Model

FIDELITY = Fidelity(level=0)


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.I)
    current = u.i + m.balance("current", "signal", unit="A", value=u.i, sensor=qs.I_MEAS).effort
    m.output(qs.I_MEAS, current)
