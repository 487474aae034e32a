"""Body with six degrees of freedom, cabinet and six wheels on spring-damper contacts.

Equations in `spatial_body.py`: Newton-Euler about the arm's mount, solved together with the arm's
inertia; loads follow from the heights of the wheels, friction from `wheel_contact` and `caster`.

Not modelled: suspension of the drive wheels (`sprung`), flexible cabinet, camber; friction acts in
the body's horizontal plane instead of the floor's (they differ by the tilt, some mrad); roll and
pitch inertia of the wheels about their own centres; pitch beyond 90 degrees.

Source: digital twin paper, MiR250 model in Simscape Multibody.
"""

from __future__ import annotations

from ..component import Fidelity, Solver
from ..model import Model
from .spatial_body import spatial_body

FIDELITY = Fidelity(
    level=2,
    solver=Solver("rosw3_adaptive", 1e-3, 1e-5),
    slots={"wheel_contact": "spatial", "caster": "swivel"},
)


def equations(m: Model) -> None:
    """Collect the equations."""
    spatial_body(m)
