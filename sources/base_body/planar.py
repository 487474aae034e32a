"""Body of `mobile_base/planar`, with two drive wheels and four casters outside.

    m a_x - s_y w' - s_x w^2 = sum f_x + arm + effects
    m a_y + s_x w' - s_y w^2 = sum f_y + arm + effects
    J w' + s_x a_y - s_y a_x = sum (p x f + m_z) + arm + effects

in body axes about O, with the loads of `mobile_base/planar`. The mount at p moves at
(v_x - w p_y, v_y + w p_x). m, s and J hold what the casters leave to the body (`mass`) less what
their swinging forks take off (`relief`), whose kinetic energy the casters count; drive wheels with
their motors are part of the body, but for their spin.

Not modelled: as in `mobile_base/planar`; a height of the wheels that moves, which
`wheel_contact/spatial` would need.

Source: digital twin paper, MiR250 model, reduced to the plane; Newton-Euler equations.
"""

from __future__ import annotations

import casadi as ca

from .. import base_body as qs
from .. import mobile_base as base
from ..component import Fidelity, Solver
from ..laws.planar_frame import rotated
from ..mobile_base.mount import read_mount
from ..mobile_base.planar_body import Carried, PlanarBody
from ..mobile_base.wheels import CASTER_X, CASTER_Y, Places, part_values
from ..model import SX, Model
from ..wheel_contact import R

FIDELITY = Fidelity(level=0, solver=Solver("rk4", 1e-3))


def equations(m: Model) -> None:
    """Collect the equations."""
    arm = read_mount(m)
    start = part_values(m, "wheel_contact").get(R.name, qs.HEIGHT.start)
    p = m.parameters(qs.HEIGHT.with_start(start), base.TRACK, CASTER_X, CASTER_Y)
    places = Places(p.height, p.track / 2, p.caster_x, p.caster_y)
    positions = [(0, places.half_track), (0, -places.half_track), *places.casters]

    carried, relief, force_x, force_y, moment = ca.SX.zeros(4), ca.SX.zeros(3, 3), 0, 0, 0
    taken: list[tuple[SX, SX, SX]] = []
    for mount, (x, y) in zip(qs.MOUNTS, positions, strict=True):
        f_x, f_y, m_z = m.input(mount.f_x), m.input(mount.f_y), m.input(mount.m_z)
        taken.append((f_x, f_y, m_z))
        force_x, force_y = force_x + f_x, force_y + f_y
        moment += m_z + x * f_y - y * f_x
        if mount.caster:
            mass, off = m.input(mount.mass), m.input(mount.relief)
            carried += mass * ca.vertcat(1, x, y, x**2 + y**2)
            reach = ca.vertcat(ca.horzcat(1, 0, -y), ca.horzcat(0, 1, x))
            relief += (
                reach.T @ ca.vertcat(ca.horzcat(off[0], off[1]), ca.horzcat(off[1], off[2])) @ reach
            )

    body = PlanarBody(m, arm, places, Carried(carried[0], carried[1], carried[2], carried[3]))
    v_x, v_y, w = body.twist
    for mount, (x, y), load, efforts in zip(qs.MOUNTS, positions, body.loads, taken, strict=True):
        d_x, d_y = rotated(body.pose[2], x, y)
        flows = (m.output(mount.v_x, v_x - w * y), m.output(mount.v_y, v_y + w * x), w)
        m.output(mount.f_n, load)
        m.output(mount.x_w, body.pose[0] + d_x)
        m.output(mount.y_w, body.pose[1] + d_y)
        for port, effort, flow in zip(mount.ports, efforts, flows, strict=True):
            m.port(port, effort, flow)
    m.supply(-body.close(force_x, force_y, moment, relief))
