"""Sensor with a first-order low pass whose reading is the mean over the last window.

    i_f' = 2 pi f (i - i_f),   Q' = i_f,   i_meas = (Q(t) - Q(t - T)) / T

The window moves along with time; a reader who samples it every T gets the mean between his samples.
Q of T ago comes from ten samples per window, exact at the samples. Before the start the current is
taken as constant.

Not modelled: resolution (effect `quantization`).

Source: rig sheet mobile_manipulator: bandwidth 2 kHz, mean over the last 10 ms.
"""

from __future__ import annotations

from .. import current_sensor as qs
from ..component import Fidelity
from ..laws.history import History
from ..model import Model
from ..quantity import Quantity
from . import SOLVER, low_pass

FIDELITY = Fidelity(level=2, solver=SOLVER)
SAMPLES = 10  # of the charge per window
WINDOW = Quantity("window", "s", "duration T of the mean", 0.01, minimum=1e-6, variability="fixed")
Q = Quantity("Q", "C", "charge: integral of the filtered current")


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.I)
    current = low_pass(m, u.i)
    p = m.parameters(WINDOW)
    x = m.states(Q)
    m.derivative(x.Q, current)
    past = History(
        m, "charge", x.Q, unit="C", period=p.window / SAMPLES, slots=SAMPLES + 2, slope=current
    )
    mean = (x.Q - past.at(p.window)) / p.window
    mean += m.balance("current", "signal", unit="A", value=mean, sensor=qs.I_MEAS).effort
    m.output(qs.I_MEAS, mean)
