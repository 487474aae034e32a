"""Dry friction that truly sticks: an elasto-plastic bristle with Stribeck's fall in speed.

    f = -f_c (z + t_d (1 - a) v / x_0),   h(v) = 1 + r exp(-(v / v_s)^2)
    z' and a as in `laws/bristle.py`
    E = f_c x_0 z^2 / 2,   P_loss = f_c (a z^2 |v| / h + t_d (1 - a) v^2 / x_0)

Below breakaway the shaft is held by a spring f_c / x_0. Torque acts on a speed that another
component computes: its communication steps should stay below 2 t_d, else the spring excites it.

Not modelled: viscous friction, dependence on load.

Source: Dupont et al., IEEE Trans. Automatic Control 47(5), 2002; Canudas de Wit et al., IEEE Trans.
Automatic Control 40(3), 1995 for h(v).
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.bristle import bristle
from ..laws.signal_effect import sized
from ..quantity import Quantity

TAU_C = Quantity(
    "tau_c", "N.m", "sliding friction torque, 0 = absent", start=0.5, minimum=0.0, strength=True
)
EXCESS = Quantity("r", "1", "breakaway torque over the sliding one, less 1", start=0.3, minimum=0.0)
W_S = Quantity("w_s", "rad/s", "speed over which that excess decays", start=0.1, minimum=1e-6)
# No encoder sees less than the least length, and a solver's steps shrink with it.
LENGTH = Quantity("x_0", "rad", "deflection at the sliding torque", start=5e-4, minimum=1e-6)
DAMPING = Quantity(
    "t_d", "s", "damping of the stuck bristle over its stiffness", start=2e-3, minimum=0.0
)
DEFLECTION = Quantity("z", "1", "deflection of the bristle over x_0")

EFFECT = Effect(
    "bristle",
    "Dry friction of a shaft that sticks.",
    ("rotation",),
    TAU_C,
    source="Dupont 2002",
)


def law(e: EffectModel) -> None:
    """Add the friction torque."""
    velocity, tau_c, length = e.signal("velocity"), e.parameter(TAU_C), e.parameter(LENGTH)
    height = 1 + e.parameter(EXCESS) * ca.exp(-((velocity / e.parameter(W_S)) ** 2))
    z = e.state(sized(e, DEFLECTION))
    rate, slides = bristle(velocity, z, height, length)
    e.derivative(z, rate)
    damping = e.parameter(DAMPING) * (1 - slides) * velocity / length
    e.add(-tau_c * (z + damping))
    e.stored_energy(tau_c * length * z**2 / 2)
    e.loss(tau_c * (slides * z**2 * ca.fabs(velocity) / height + damping * velocity))
