"""Rigid links on a mount at rest, advanced in ticks of a fixed period as physics engines do.

    every T:  qd += T q''(q, qd, tau),   then q runs on at the new qd until the next tick

with q'' as in `rigid` (semi-implicit Euler). One evaluation per tick makes it the cheapest dynamic
fidelity, and it reproduces rigs that are themselves simulated this way. Against an exact solution
its speeds lag by T/2 and its torques act T/2 early.

For the account of energy the speed runs linearly from one tick's value to the next, and the power
that the scheme invents enters `P_in`. `speed` and `held_speed` start alike.

Not modelled: as `rigid`.

Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2006, ch. VI.3.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from .. import ur5_arm as qs
from ..component import Fidelity, Solver
from ..model import Model
from ..quantity import Quantity
from ..serial_arm.links import (
    at_rest,
    joint_efforts,
    links,
    output_motion,
    output_wrench,
    read_mount,
)

FIDELITY = Fidelity(level=2, solver=Solver("rk4", 1e-3))
T = Quantity("T", "s", "period of the ticks", start=5e-4, minimum=1e-6, variability="fixed")
HELD_SPEED = Quantity("held_speed", "rad/s", "joint speeds from one tick to the next", size=6)
HELD_ACCELERATION = Quantity(
    "held_acceleration", "rad/s2", "joint accelerations at the last tick", size=6
)


def equations(m: Model) -> None:
    """Collect the equations."""
    mount = at_rest(read_mount(m))
    u = m.inputs(qs.TAU, qs.J_ADDED)
    p = m.parameters(T)
    x = m.states(qs.ANGLE, qs.SPEED)
    z = m.discretes(HELD_SPEED, HELD_ACCELERATION)
    q, qd, qdd = x.angle, z.held_speed, z.held_acceleration
    tick = m.clock("mechanics", p.T)
    effort = joint_efforts(m, qd, q, u.tau)
    arm = links(m, mount, q, qd)
    dynamics = arm.accelerate(u.tau + effort, u.J_added)
    m.update(tick, qd, qd + p.T * dynamics.acceleration)
    m.update(tick, qdd, dynamics.acceleration)
    m.derivative(q, qd)
    m.derivative(x.speed, qdd)
    output_motion(m, mount, q, qd, arm.posture, u.tau)
    locked = arm.posture.mass_properties().matrix()
    output_wrench(m, mount, locked, dynamics.bias, dynamics.bias)
    kinetic, potential = replace(arm, qd=x.speed).energy()
    stored = kinetic + potential + ca.dot(u.J_added, x.speed**2) / 2
    rate = ca.jtimes(stored, ca.vertcat(q, x.speed), ca.vertcat(qd, qdd))
    m.stored_energy(stored)
    m.supply(rate - ca.dot(u.tau + effort, qd) - ca.dot(arm.load, arm.tool_twist))
