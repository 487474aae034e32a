"""Commands arrive at once.

    v_d = v_set,   w_d = w_set,   xd_d = xd_set,   yd_d = yd_set,   phi_d = phi_set

Not modelled: latency, sampling.

Source: definition.
"""

from __future__ import annotations

from ..component import Fidelity
from ..model import Model
from . import commands, deliver

FIDELITY = Fidelity(level=0)


def equations(m: Model) -> None:
    """Collect the equations."""
    deliver(m, commands(m))
