"""Body with six degrees of freedom whose drive wheels are pressed on the floor by springs.

Equations in `spatial_body.py`; each drive wheel slides vertically with its carrier, so that the
casters level the body and the drive wheels keep their load.

Not modelled: as `six_dof`, but for the suspension; friction and stops of the slides.

Source: digital twin paper, MiR250 model; suspension as on the laboratory base.
"""

from __future__ import annotations

from ..component import Fidelity, Solver
from ..model import Model
from .spatial_body import spatial_body

FIDELITY = Fidelity(
    level=3,
    solver=Solver("rosw3_adaptive", 1e-3, 1e-5),
    slots={"wheel_contact": "spatial", "caster": "swivel"},
)


def equations(m: Model) -> None:
    """Collect the equations."""
    spatial_body(m, sprung=True)
