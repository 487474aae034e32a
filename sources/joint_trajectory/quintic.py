"""Move of all joints from one pose to another with smooth acceleration.

    q = q_start + (q_end - q_start) (10 s^3 - 15 s^4 + 6 s^5),   s = (t - t_start)/duration in 0..1

Not modelled: limits of speed or torque; all joints take the same time.

Source: Siciliano et al., Robotics: Modelling, Planning and Control, 2009, ch. 4.
"""

from __future__ import annotations

from ..component import Fidelity
from ..model import Model
from ..quantity import Quantity
from . import Q_HOLD, T_START
from .path import output_path, smooth

FIDELITY = Fidelity(level=0)
Q_START = Quantity("q_start", "rad", "angles before the move", start=Q_HOLD.start, size=6)
Q_END = Quantity(
    "q_end",
    "rad",
    "angles after the move",
    start=(Q_HOLD.starts()[0] + 0.5, *Q_HOLD.starts()[1:]),
    size=6,
)
DURATION = Quantity("duration", "s", "time that the move takes", start=1.0, minimum=1e-3)


def equations(m: Model) -> None:
    """Collect the equations."""
    first, last = m.parameter(Q_START), m.parameter(Q_END)
    s = (m.t - m.parameter(T_START)) / m.parameter(DURATION)
    output_path(m, first + (last - first) * smooth(s))
