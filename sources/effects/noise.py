"""White noise on a signal, drawn anew at each sample and held in between.

    y(t) = v(t) + sigma n_k   for   k t_s <= t < (k + 1) t_s,   n_k normal, independent

Deterministic: the same `seed` gives the same numbers on every machine. The elements of a vector
draw different numbers.

Not modelled: coloured noise, outliers.

Source: L'Ecuyer 1988 and Box and Muller 1958 for the numbers.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.history import NEVER
from ..laws.noise import RANDOM, Random, seed_quantity
from ..laws.signal_effect import in_unit, sized
from ..quantity import Quantity

SIGMA = Quantity(
    "sigma",
    "1",
    "standard deviation, 0 = absent",
    start=0.01,
    minimum=0.0,
    strength=True,
    variability="fixed",
)
T_S = Quantity(
    "t_s", "s", "sample period of the noise", start=0.01, minimum=1e-9, variability="fixed"
)
DRAWN = Quantity("drawn", "1", "standard normal number drawn last")

EFFECT = Effect(
    "noise", "White noise on a signal.", ("signal", "point"), SIGMA, source="textbook", random=True
)


def law(e: EffectModel) -> None:
    """Add the noise."""
    p = e.parameters(in_unit(e, SIGMA), T_S, seed_quantity("noise"))
    state, n = e.discrete(RANDOM), e.discrete(sized(e, DRAWN))
    clock = e.clock("sample", ca.if_else(p.sigma > 0, p.t_s, NEVER))
    random = Random(state, p.seed)
    e.update(clock, n, random.normals(e.size))
    e.update(clock, state, random.state)
    e.add(p.sigma * n)
