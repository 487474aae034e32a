"""Hysteresis of a spring: inner friction that depends on the path of its deflection.

    f = -t_h z,   x_h z' = x' (1 - a |z|) where x' z > 0,   x_h z' = x' elsewhere
    E = t_h x_h z^2 / 2,   P_loss = t_h a z^2 |x'|

a as in `laws/bristle.py`. The spring is stiffer by t_h / x_h for small motions and holds up to t_h.

Not modelled: dependence on load.

Source: Dhaouadi, Ghorbel, Gandhi, A new dynamic model of hysteresis in harmonic drives, IEEE Trans.
Industrial Electronics 50(6), 2003; the elasto-plastic law of Dupont et al. 2002 replaces theirs.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.bristle import bristle
from ..laws.signal_effect import sized
from ..quantity import Quantity

TAU_H = Quantity(
    "tau_h", "N.m", "half width of the loop, 0 = absent", start=0.5, minimum=0.0, strength=True
)
X_H = Quantity("x_h", "rad", "deflection over which the loop turns", start=5e-4, minimum=1e-9)
Z = Quantity("z", "1", "state of the inner friction, -1 to 1")

EFFECT = Effect(
    "hysteresis",
    "Inner friction of a spring.",
    ("compliance",),
    TAU_H,
    source="Dhaouadi 2003",
    stiff=True,
)


def law(e: EffectModel) -> None:
    """Add the torque."""
    p, x_dot = e.parameters(t_h=TAU_H, x_h=X_H), e.signal("rate")
    z = e.state(sized(e, Z))
    z_dot, a = bristle(x_dot, z, ca.SX(1), p.x_h)
    e.derivative(z, ca.if_else(p.t_h > 0, z_dot, 0.0))  # it rests while the effect is absent
    e.add(-p.t_h * z)
    e.stored_energy(p.t_h * p.x_h * z**2 / 2)
    e.loss(p.t_h * a * z**2 * ca.fabs(x_dot))
