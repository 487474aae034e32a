"""Torque ripple of a strain-wave gear: two cycles per turn of its wave generator (the motor).

    f = -a sin(2 N theta + psi),   E = a (1 - cos(2 N theta + psi)) / (2 N)

theta is the angle of the joint and N the gear's ratio. Conservative, like cogging seen through the
gear.

Not modelled: further harmonics, dependence on load, change of the ratio by the same error.

Source: Taghirad and Bélanger, Modeling and parameter identification of harmonic drive systems,
ASME J. Dyn. Sys. 120(4), 1998.
"""

from __future__ import annotations

import casadi as ca

from cosim.spec.hints import SearchHints

from ..effect import Effect
from ..effect_model import EffectModel
from ..laws.angle import shaft_angle
from ..quantity import Quantity

A = Quantity(
    "a", "N.m", "amplitude on the joint, 0 = absent", start=1.0, nominal=1.0, strength=True
)
N = Quantity("N", "1", "ratio of the gear", start=101.0, minimum=0.1)
PSI = Quantity("psi", "rad", "phase at angle 0", hints=SearchHints(mix="turn"))

EFFECT = Effect(
    "harmonic_ripple",
    "Torque ripple of a strain-wave gear.",
    ("rotation",),
    A,
    source="Taghirad and Bélanger 1998",
)


def law(e: EffectModel) -> None:
    """Add the torque."""
    p, theta = e.parameters(A, N, PSI), shaft_angle(e, "velocity")
    cycles = 2 * p.N
    argument = cycles * theta + p.psi
    e.add(-p.a * ca.sin(argument))
    e.stored_energy(p.a * (1 - ca.cos(argument)) / cycles)
    e.loss(0)
