"""Body that moves in the plane on two drive wheels and four casters under quasi-static loads.

Newton-Euler equations about O in body axes, with a = (v_x' - w v_y, v_y' + w v_x):

    m a_x - s_y w' - s_x w^2 = sum f_x + arm + effects
    m a_y + s_x w' - s_y w^2 = sum f_y + arm + effects
    J w' + s_x a_y - s_y a_x = sum (p x f + m_z) + arm + effects

solved together with the arm's inertia and what the swinging casters take off the mass
(`mount.py`, `../caster/fork.py`). The loads carry the weight and the arm's bias and are linear in
the plane; drive wheels have a preload F_0 and the stiffness k relative to a caster:

    N_drive = F_0 + k (A + C y),   N_caster = A + B x + C y
    A = (P - 2 F_0)/(4 + 2 k),   B = M_y/(4 x_c^2),   C = -M_x/(4 y_c^2 + 2 k (track/2)^2)

Not modelled: load transfer by acceleration, tilt, bounce, the trail between a caster's pivot, where
its load acts here, and its wheel (`six_dof`); a wheel whose load would be
negative carries none, the others do not take over.

Source: digital twin paper, MiR250 model, reduced to the plane; Newton-Euler equations.
"""

from __future__ import annotations

from ..component import Fidelity, Solver
from ..declarations import ModelError
from ..model import Model
from .mount import read_mount
from .planar_body import Carried, PlanarBody
from .wheels import Drive, add_wheels, read_caster_mass, read_places, write_wheels

FIDELITY = Fidelity(
    level=1,
    solver=Solver("rosw3_adaptive", 1e-3, 1e-5),
    slots={"wheel_contact": "stick_slip", "caster": "swivel"},
)


def equations(m: Model) -> None:
    """Collect the equations."""
    if m.slots["wheel_contact"] == "spatial":
        raise ModelError(
            "mobile_base/planar gives each wheel its load, but wheel_contact=spatial finds it from "
            "the wheel's height, which a planar base does not move; take stick_slip, or six_dof"
        )
    mount, places, caster_mass = read_mount(m), read_places(m), read_caster_mass(m)
    mass = 4 * caster_mass
    carried = Carried(mass, 0, 0, mass * (places.x**2 + places.y**2))
    body = PlanarBody(m, mount, places, carried)
    drives = (Drive(body.loads[0], places.radius), Drive(body.loads[1], places.radius))
    wheels = add_wheels(m, places, body.pose, body.twist, drives, body.loads[2:])
    m.eliminate_last(*body.pose, *body.twist)
    write_wheels(m, wheels, body.loads)
    body.close(wheels.force_x, wheels.force_y, wheels.moment, wheels.relief)
