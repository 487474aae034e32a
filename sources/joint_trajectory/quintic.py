"""Move of all joints from one pose to another with smooth acceleration.

    q = q_start + (q_end - q_start) (10 s^3 - 15 s^4 + 6 s^5),   s = (t - t_start)/duration in 0..1

Not modelled: limits of speed or torque; all joints take the same time.

Source: Siciliano et al., Robotics: Modelling, Planning and Control, 2009, ch. 4.
"""

from __future__ import annotations

from .. import joint_trajectory as qs
from ..component import Fidelity
from ..laws.joints import Joints
from ..model import Model
from ..quantity import Quantity
from .path import output_path, smooth

FIDELITY = Fidelity(level=0)
Q_START = Quantity("q_start", "rad", "angles before the move", start=qs.Q_HOLD.start, size=6)
Q_END = Quantity(
    "q_end",
    "rad",
    "angles after the move",
    start=(qs.Q_HOLD.starts()[0] + 0.5, *qs.Q_HOLD.starts()[1:]),
    size=6,
)
DURATION = Quantity("duration", "s", "time that the move takes", start=1.0, minimum=1e-3)


def equations(m: Model) -> None:
    """Collect the equations."""
    joints = Joints.of_device(m)
    p = m.parameters(joints.sized(Q_START), joints.sized(Q_END), qs.T_START, DURATION)
    s = (m.t - p.t_start) / p.duration
    output_path(m, p.q_start + (p.q_end - p.q_start) * smooth(s))
