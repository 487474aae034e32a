"""Rigid links behind gears that yield, on a mount at rest, advanced in ticks of a fixed period.

    every T:  theta' += T theta'',  q' += T q'',   then theta and q run on until the next tick
    J_added theta'' = tau - f,   M(q) q'' + C(q, q') q' + g(q) = f,   c f = x + t_d x'

theta is the gear's output without its twist x = theta - q, as the motor encoder sees it: the
outputs `q`, `qd` and the port of the joints belong to it. c is a gear's compliance; without
compliance it is `ticked`, exactly. The spring acts with the twist at a tick's start and the damper
with the rate at its end (semi-implicit Euler), which needs no solver that is stable for stiff
springs: where a spring is too stiff for the ticks, c < T^2 / J_least, the damping time grows by up
to T.

For the account of energy speeds run linearly from one tick's value to the next, and the power that
the scheme invents enters `P_in`. `speed` and `held_speed` start alike.

Not modelled: hysteresis, stiffening and play of the gears.

Source: Spong, J. Dyn. Sys. Meas. Control 109, 1987, 310-319; Hairer, Lubich, Wanner, Geometric
Numerical Integration, 2006, ch. VI.3.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca

from cosim.spec.hints import SearchHints

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
from .ticked import HELD_ACCELERATION, HELD_SPEED, T

COMPLIANCES = tuple(3e-5 * 1.5**k for k in range(12))
"""Compliances of gears, 3e-5 to 2.6e-3 rad/(N.m), close enough together that the oscillation of a
damped joint at one of them resembles that in between."""
C = Quantity(
    "c",
    "rad/(N.m)",
    "torsional compliance of the gears, 0 = rigid",
    minimum=0.0,
    nominal=1e-4,
    size=6,
    strength=True,
    hints=SearchHints(tries=COMPLIANCES),
)
T_D = Quantity(
    "t_d",
    "s",
    "damping of the gears' twist over their stiffness",
    start=1e-3,
    minimum=1e-5,
    maximum=0.1,
    nominal=1e-4,
    size=6,
)
TWIST = Quantity(
    "twist", "rad", "state: twist of the gears, motor's side less link", nominal=1e-3, size=6
)
TWIST_RATE = Quantity("twist_rate", "rad/s", "state: rate of the twist", nominal=0.1, size=6)
HELD_RATE = Quantity("held_rate", "rad/s", "rates of the twist from one tick to the next", size=6)
HELD_TWISTING = Quantity(
    "held_twisting", "rad/s2", "accelerations of the twist at the last tick", size=6
)
FIDELITY = Fidelity(
    level=3,
    solver=Solver("rk4", 1e-3),
    limits={"ticked": {}, "ticked_elastic": {}},
    soft=(C, T_D),
    called="elastic",
    places=tuple(f"joint_{i + 1}" for i in range(6)),
)
J_LEAST = (0.08, 0.3, 0.07, 7e-3, 3e-3, 1.3e-4)
"""Least inertia [kg.m2] that a joint has to move, all others free, in any pose of the UR5."""
NO_SPRING = 0.01
"""Share of the compliance that the ticks can follow below which a spring's energy fades out: it has
none without compliance, where nothing twists."""


def equations(m: Model) -> None:
    """Collect the equations."""
    mount = at_rest(read_mount(m))
    u = m.inputs(qs.TAU, qs.J_ADDED)
    p = m.parameters(C, T)
    x = m.states(qs.ANGLE, qs.SPEED, TWIST, TWIST_RATE)
    z = m.discretes(HELD_SPEED, HELD_ACCELERATION, HELD_RATE, HELD_TWISTING)
    theta, thetad, thetadd = x.angle, z.held_speed, z.held_acceleration
    twistd, twistdd = z.held_rate, z.held_twisting
    tick = m.clock("mechanics", p.T)
    driving = u.tau + joint_efforts(m, thetad, theta, u.tau)
    q, qd = theta - x.twist, thetad - twistd
    arm = links(m, mount, q, qd)

    limit = p.T**2 / ca.SX(J_LEAST)
    t_d = m.parameter(T_D)
    damping = t_d + p.T / (1 + (p.c / limit) ** 2)
    # the hub eliminated: the links feel it through the spring as an inertia and a torque
    stiff = damping * p.T / (p.c * u.J_added + damping * p.T)
    carried = stiff * u.J_added
    passed = stiff * driving + carried * (x.twist / damping + twistd) / p.T
    dynamics = arm.accelerate(passed, carried)
    torque = passed - carried * dynamics.acceleration
    twisting = ((p.c * torque - x.twist) / damping - twistd) / p.T
    turning = dynamics.acceleration + twisting
    m.update(tick, thetad, thetad + p.T * turning)
    m.update(tick, thetadd, turning)
    m.update(tick, twistd, twistd + p.T * twisting)
    m.update(tick, twistdd, twisting)
    m.derivative(theta, thetad)
    m.derivative(x.speed, thetadd)
    m.derivative(x.twist, twistd)
    m.derivative(x.twist_rate, twistdd)
    output_motion(m, mount, theta, thetad, arm.posture, u.tau)
    locked = arm.posture.mass_properties().matrix()
    output_wrench(m, mount, locked, dynamics.bias, dynamics.bias)
    kinetic, potential = replace(arm, qd=x.speed - x.twist_rate).energy()
    stiffness = p.c / (p.c**2 + (NO_SPRING * limit) ** 2)
    springs = ca.dot(stiffness, x.twist**2) / 2
    stored = kinetic + potential + ca.dot(u.J_added, x.speed**2) / 2 + springs
    states = ca.vertcat(theta, x.speed, x.twist, x.twist_rate)
    rates = ca.jtimes(stored, states, ca.vertcat(thetad, thetadd, twistd, twistdd))
    heat = ca.dot(t_d * stiffness, x.twist_rate**2)
    m.stored_energy(stored)
    m.loss("gears", heat)
    m.supply(rates + heat - ca.dot(driving, thetad) - ca.dot(arm.load, arm.tool_twist))
