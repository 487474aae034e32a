"""Scrub torque of a contact patch that turns about the vertical.

    M = -M_pa q/sqrt(M_pa^2 + q^2),   q = K w_s/sqrt(v^2 + v_0^2),   P_loss = -M w_s

w_s is the rotation of the patch, v its rolling speed: M_pa at standstill, K w_s/v while rolling.

Not modelled: dependence on the load, coupling with the side force.

Source: omnidirectional base paper, pivot friction (Nikravesh, Pacejka), with the spin of the patch
in place of the steering rate alone and a smooth saturation in place of the printed switch.
"""

from __future__ import annotations

import casadi as ca

from ..effect import Effect
from ..effect_model import EffectModel
from ..quantity import Quantity

M_PA = Quantity(
    "M_pa", "N.m", "scrub torque at standstill, 0 = absent", start=1.0, minimum=0.0, strength=True
)
K = Quantity("K", "N.m2", "torque per spin over rolling speed", start=1.0, minimum=0.0)
V_0 = Quantity("v_0", "m/s", "rolling speed that counts as standstill", start=0.005, minimum=1e-6)

EFFECT = Effect(
    "pivot_torque",
    "Scrub torque of a turning contact patch.",
    ("pivot",),
    M_PA,
    source="omnidirectional base paper, pivot friction",
)

SMALL = 1e-18
"""Added to squared torques [N2.m2]: the law has no slope problem when both vanish."""


def law(e: EffectModel) -> None:
    """Add the torque."""
    p, s = e.parameters(M_PA, V_0, K), e.signals(w_s="spin", v="rolling")
    q = p.K * s.w_s / ca.sqrt(s.v**2 + p.v_0**2)
    M = -p.M_pa * q / ca.sqrt(p.M_pa**2 + q**2 + SMALL)
    e.add(M)
    e.loss(-ca.dot(M, s.w_s))
