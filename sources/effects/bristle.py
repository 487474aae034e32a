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
R = Quantity("r", "1", "breakaway torque over the sliding one, less 1", start=0.3, minimum=0.0)
W_S = Quantity("w_s", "rad/s", "speed over which that excess decays", start=0.1, minimum=1e-6)
# No encoder sees less than the least length, and a solver's steps shrink with it.
X_0 = Quantity("x_0", "rad", "deflection at the sliding torque", start=5e-4, minimum=1e-6)
T_D = Quantity(
    "t_d", "s", "damping of the stuck bristle over its stiffness", start=2e-3, minimum=0.0
)
Z = Quantity("z", "1", "deflection of the bristle over x_0")

EFFECT = Effect(
    "bristle",
    "Dry friction of a shaft that sticks.",
    ("rotation",),
    TAU_C,
    source="Dupont 2002",
    contains=("coulomb",),
    stiff=True,
)


def law(e: EffectModel) -> None:
    """Add the friction torque."""
    p = e.parameters(f_c=TAU_C, x_0=X_0, r=R, v_s=W_S, t_d=T_D)
    v, z = e.signal("velocity"), e.state(sized(e, Z))
    h = 1 + p.r * ca.exp(-((v / p.v_s) ** 2))
    z_dot, a = bristle(v, z, h, p.x_0)
    e.derivative(z, ca.if_else(p.f_c > 0, z_dot, 0.0))  # it rests while the effect is absent
    damping = p.t_d * (1 - a) * v / p.x_0
    e.add(-p.f_c * (z + damping))
    e.stored_energy(p.f_c * p.x_0 * z**2 / 2)
    e.loss(p.f_c * (a * z**2 * ca.fabs(v) / h + damping * v))
