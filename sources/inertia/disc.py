"""Balanced disc with viscous friction.

    phi' = w,   (J + J_added) w' = tau - b w

Not modelled: unbalance (`pendulum`), elasticity of the shaft.

Source: Newton's law for rotation.
"""

from __future__ import annotations

from ..component import Fidelity, Solver
from ..model import Model
from .load import rotation

FIDELITY = Fidelity(level=0, solver=Solver("rodas3", 1e-3))


def equations(m: Model) -> None:
    """Collect the equations."""
    rotation(m)
