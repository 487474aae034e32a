"""Positions of the markers with white noise.

    [x_m; y_m]_k = R(phi_frame) ([x; y] + R(phi) [x_b; y_b]_k) + [x_frame; y_frame] + sigma n_k

The noise n_k (independent standard normal numbers) is drawn anew every T; in between the positions
follow the body, so a reader at the sample instants gets the positions of that instant. The numbers
depend on `seed` only.

Not modelled: perspective, height of the markers, blur, lost markers.

Source: rig sheet crawler; crawler paper (resolution 0.02 mm).
"""

from __future__ import annotations

from ..component import Fidelity
from ..laws.noise import RANDOM, Random, seed_quantity
from ..model import Model
from ..quantity import Quantity
from . import MARKERS, X_M, Y_M, markers

FIDELITY = Fidelity(level=1)
T = Quantity("T", "s", "sample period", 0.02, minimum=1e-6, variability="fixed")
SIGMA = Quantity("sigma", "m", "standard deviation of each coordinate", 1e-4, minimum=0.0)
DRAWN = Quantity("drawn", "1", "noise of the present sample", size=2 * MARKERS)


def equations(m: Model) -> None:
    """Collect the equations."""
    x, y = markers(m)
    sigma = m.parameter(SIGMA)
    state, drawn = m.discrete(RANDOM), m.discrete(DRAWN)
    random = Random(state, m.parameter(seed_quantity("marker_sensor")))
    clock = m.clock("sample", m.parameter(T))
    m.update(clock, drawn, random.normals(2 * MARKERS))
    m.update(clock, state, random.state)
    m.output(X_M, x + sigma * drawn[:MARKERS])
    m.output(Y_M, y + sigma * drawn[MARKERS:])
