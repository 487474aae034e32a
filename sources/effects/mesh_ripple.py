"""Transmission error of a gear: its ratio varies with the angle.

    theta_a = ratio (theta_b + eps sin(n theta_b + psi))
    ratio(theta_b) = ratio (1 + n eps cos(n theta_b + psi))

Speed and torque use the same ratio, so the error neither takes nor gives power.

Not modelled: the rotor's inertia torque that the varying ratio excites in a rigid gear; stiffness
that varies with the angle.

Source: Taghirad and Bélanger, Modeling and parameter identification of harmonic drive systems,
ASME J. Dyn. Sys. 120(4), 1998.
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.angle import ANGLE, shown_angle
from ..quantity import Quantity

EPS = Quantity(
    "eps",
    "rad",
    "amplitude of the transmission error at the output, 0 = absent",
    start=2e-4,
    strength=True,
)
N = Quantity(
    "n",
    "1",
    "cycles per revolution of the output",
    start=30.0,
    minimum=0.1,
    hints=SearchHints(cycles=ANGLE.name),
)
PSI = Quantity("psi", "rad", "phase at angle 0", hints=SearchHints(mix="turn"))

EFFECT = Effect(
    "mesh_ripple",
    "Transmission error of a gear that repeats with the angle of the output.",
    ("coefficient",),
    EPS,
    needs=("turning",),
    source="Taghirad and Bélanger 1998",
    unit="1",
)


def law(e: EffectModel) -> None:
    """Add the variation of the ratio."""
    p, ratio = e.parameters(N, PSI, EPS), e.signal("value")
    theta_b = shown_angle(e, "turning")
    e.add(ratio * p.n * p.eps * ca.cos(p.n * theta_b + p.psi))
