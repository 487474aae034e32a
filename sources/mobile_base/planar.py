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

import casadi as ca

from .. import mobile_base as qs
from ..component import Fidelity, Solver
from ..declarations import ModelError
from ..laws import planar_body
from ..laws.symmetric import solve
from ..model import SX, Balance, Model
from ..quantity import Quantity
from . import body as bs
from .mount import Mount, read_mount, write_planar_motion
from .wheels import Drive, Places, add_wheels, read_caster_mass, read_places, write_wheels

FIDELITY = Fidelity(
    level=1,
    solver=Solver("rosw3_adaptive", 1e-3, 1e-5),
    slots={"wheel_contact": "stick_slip", "caster": "swivel"},
)
PRELOAD = Quantity(
    "preload", "N", "load of a drive wheel that does not depend on the weight", minimum=0.0
)
SHARE = Quantity(
    "share",
    "1",
    "stiffness of a drive wheel's suspension over that of a caster",
    start=1.0,
    minimum=0.0,
)


def equations(m: Model) -> None:
    """Collect the equations."""
    if m.slots["wheel_contact"] == "spatial":
        raise ModelError(
            "mobile_base/planar gives each wheel its load, but wheel_contact=spatial finds it from "
            "the wheel's height, which a planar base does not move; take stick_slip, or six_dof"
        )
    mount, places, caster_mass = read_mount(m), read_places(m), read_caster_mass(m)
    p = m.parameters(
        bs.MASS,
        bs.COM_X,
        bs.COM_Y,
        bs.CABINET_MASS,
        bs.DRIVE_MASS,
        bs.I_ZZ,
        bs.CABINET_I_ZZ,
        bs.DRIVE_INERTIA,
    )
    x = m.states(qs.POSE_X, qs.POSE_Y, qs.POSE_PHI, bs.VEL_X, bs.VEL_Y, bs.YAW_RATE)
    com = ca.vertcat(p.com_x, p.com_y, 0)
    com += m.balance("load", "position", value=com).effort
    w = x.yaw_rate

    # without the casters, which count their own kinetic energy
    own = p.mass + p.cabinet_mass + 2 * p.drive_mass
    s_x, s_y = p.mass * com[0], p.mass * com[1]
    yaw = (
        p.I_zz
        + p.mass * (com[0] ** 2 + com[1] ** 2)
        + p.cabinet_I_zz
        + 2 * (p.drive_inertia + p.drive_mass * places.half_track**2)
    )
    carried = 4 * caster_mass
    cos, sin = ca.cos(x.pose_phi), ca.sin(x.pose_phi)
    body = m.balance(
        "body",
        "body",
        velocity=ca.vertcat(x.vel_x, x.vel_y, 0),
        rate=ca.vertcat(0, 0, w),
        gravity=ca.vertcat(0, 0, -bs.GRAVITY),
        position=ca.vertcat(x.pose_x, x.pose_y, places.radius),
        rotation=ca.vertcat(ca.horzcat(cos, -sin, 0), ca.horzcat(sin, cos, 0), ca.horzcat(0, 0, 1)),
        mass=own + carried + mount.weight / bs.GRAVITY,
        first_moment=ca.vertcat(s_x, s_y, 0) + mount.weight_moment / bs.GRAVITY,
    )
    own += body.mass
    s_x, s_y = s_x + body.first_moment[0], s_y + body.first_moment[1]
    yaw += body.inertia[2, 2]

    loads = _loads(m, mount, places, own + carried, s_x, s_y, body)
    drives = (Drive(loads[0], places.radius), Drive(loads[1], places.radius))
    wheels = add_wheels(
        m, places, (x.pose_x, x.pose_y, x.pose_phi), (x.vel_x, x.vel_y, w), drives, loads[2:]
    )
    m.eliminate_last(x.pose_x, x.pose_y, x.pose_phi, x.vel_x, x.vel_y, w)

    total = own + carried
    inertia = yaw + carried * (places.x**2 + places.y**2)
    rigid = ca.vertcat(
        ca.horzcat(total, 0, -s_y), ca.horzcat(0, total, s_x), ca.horzcat(-s_y, s_x, inertia)
    )
    # velocity components change by v' = a - w x v: their part of what the forks take off
    turning = wheels.relief @ ca.vertcat(w * x.vel_y, -w * x.vel_x, 0)
    # rates of O and body to the mount's: [a_m; alpha] = reach [a; alpha] - w^2 (r, 0)
    reach = ca.SX.eye(3)
    reach[0, 2], reach[1, 2] = -mount.y, mount.x
    arm = mount.inertia[[0, 1, 5], [0, 1, 5]]
    arm_bias = mount.bias[[0, 1, 5]] - w**2 * arm @ ca.vertcat(mount.x, mount.y, 0)
    force = (
        ca.vertcat(
            wheels.force_x + body.effort[0] + s_x * w**2,
            wheels.force_y + body.effort[1] + s_y * w**2,
            wheels.moment + body.effort[5],
        )
        + turning
        - reach.T @ arm_bias
    )
    a = solve(rigid + reach.T @ arm @ reach - wheels.relief, force)
    m.derivative(x.vel_x, a[0] + w * x.vel_y)
    m.derivative(x.vel_y, a[1] - w * x.vel_x)
    m.derivative(w, a[2])
    m.derivative(x.pose_x, cos * x.vel_x - sin * x.vel_y)
    m.derivative(x.pose_y, sin * x.vel_x + cos * x.vel_y)
    m.derivative(x.pose_phi, w)

    write_wheels(m, wheels, loads)
    for quantity, value in (
        (qs.X, x.pose_x),
        (qs.Y, x.pose_y),
        (qs.PHI, x.pose_phi),
        (qs.Z, places.radius),
        (qs.V, x.vel_x),
        (bs.V_Y, x.vel_y),
        (qs.W_Z, w),
    ):
        m.output(quantity, value)
    v_mx, v_my = write_planar_motion(
        m, mount, (x.pose_x, x.pose_y, x.pose_phi), (x.vel_x, x.vel_y, w), (a[0], a[1], a[2])
    )
    m.stored_energy(planar_body.kinetic_energy(own, s_x, s_y, yaw, x.vel_x, x.vel_y, w))
    wrench = arm @ (reach @ a) + arm_bias
    m.supply(-(wrench[0] * v_mx + wrench[1] * v_my + wrench[2] * w))


def _loads(
    m: Model, mount: Mount, places: Places, mass: SX, s_x: SX, s_y: SX, body: Balance
) -> list[SX]:
    """Wheel loads left, right, and of the casters."""
    p = m.parameters(PRELOAD, SHARE)
    f, n = body.effort[:3], body.effort[3:]
    force, moment = mount.bias[:3], mount.bias[3:]
    weight = bs.GRAVITY * mass - f[2] + force[2]
    height = mount.height
    m_x = (
        n[0]
        - places.radius * f[1]
        - bs.GRAVITY * s_y
        - (moment[0] + mount.y * force[2] - height * force[1])
    )
    m_y = (
        n[1]
        + places.radius * f[0]
        + bs.GRAVITY * s_x
        - (moment[1] + height * force[0] - mount.x * force[2])
    )
    level = (weight - 2 * p.preload) / (4 + 2 * p.share)
    pitch = m_y / (4 * places.x**2)
    roll = -m_x / (4 * places.y**2 + 2 * p.share * places.half_track**2)
    drives = [
        p.preload + p.share * (level + roll * y) for y in (places.half_track, -places.half_track)
    ]
    casters = [level + pitch * x + roll * y for x, y in places.casters]
    return [ca.fmax(0, load) for load in (*drives, *casters)]
