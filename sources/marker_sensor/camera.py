"""Positions of the markers with white noise.

    [x_m; y_m]_k = R(phi_frame) ([x; y] + R(phi) [x_b; y_b]_k) + [x_frame; y_frame] + sigma n_k

The noise n_k (independent standard normal numbers) is drawn anew every T; in between the positions
follow the body, so a reader at the sample instants gets the positions of that instant. The numbers
depend on `seed` only.

Not modelled: perspective, height of the markers, blur, lost markers.

Source: rig sheet crawler; crawler paper (resolution 0.02 mm).
"""

from __future__ import annotations

from .. import marker_sensor as qs
from ..component import Fidelity
from ..laws.noise import RANDOM, Random, seed_quantity
from ..model import Model
from ..quantity import Quantity
from . import MARKERS, markers

FIDELITY = Fidelity(level=1)
T = Quantity("T", "s", "sample period", 0.02, minimum=1e-6, variability="fixed")
SIGMA = Quantity("sigma", "m", "standard deviation of each coordinate", 1e-4, minimum=0.0)
DRAWN = Quantity("drawn", "1", "noise of the present sample", size=2 * MARKERS)


def equations(m: Model) -> None:
    """Collect the equations."""
    x, y = markers(m)
    p = m.parameters(SIGMA, seed_quantity("marker_sensor"), T)
    z = m.discretes(RANDOM, DRAWN)
    random = Random(z.random, p.seed)
    clock = m.clock("sample", p.T)
    m.update(clock, z.drawn, random.normals(2 * MARKERS))
    m.update(clock, z.random, random.state)
    m.output(qs.X_M, x + p.sigma * z.drawn[:MARKERS])
    m.output(qs.Y_M, y + p.sigma * z.drawn[MARKERS:])
