"""Sampled position loop around a speed loop, on an amplifier that sets the current.

    every T_loop:  w_m = (phi_k - phi_(k-2)) / (2 T_loop)
                   u = sat(K_p K_v (q_ref - phi) - K_v w_m + u_add, u_max)
    between:       tau = K_u u,   u is held

The speed is the mean of the last two differences of the angle. `u_add` is what an experiment adds
behind the loops.

Not modelled: the current loop (time constants well below T_loop), the winding and its losses; the
amplifier supplies the mechanical power. Computing time of the loops is the effect `delay` at
`amplifier`.

Source: Janot, Gautier, Brunot, Data set and reference models of EMPS, Workshop on Nonlinear System
Identification Benchmarks, 2019.
"""

from __future__ import annotations

import casadi as ca

from ..component import Fidelity, Solver
from ..model import Model
from ..quantity import Quantity
from . import PHI, Q_REF, SHAFT, T_LOOP, TAU, U_HELD, U, W

# No states of its own; those of effects (lags) may be stiff.
FIDELITY = Fidelity(level=0, solver=Solver("rodas3", 1e-3))
U_ADD = Quantity("u_add", "V", "set value added behind the loops")
K_P = Quantity("K_p", "1/s", "gain of the position loop", start=100.0, minimum=0.0)
K_V = Quantity("K_v", "V.s/rad", "gain of the speed loop", start=0.1, minimum=0.0)
K_U = Quantity("K_u", "N.m/V", "torque per output of the loops", start=0.01)
U_MAX = Quantity("u_max", "V", "limit of the loops' output", start=10.0, minimum=1e-6)
BEFORE = Quantity("phi_before", "rad", "angle at the last tick")
BEFORE_LAST = Quantity("phi_before_last", "rad", "angle at the tick before the last one")


def equations(m: Model) -> None:
    """Collect the equations."""
    command, angle, speed = m.input(Q_REF), m.input(PHI), m.input(W)
    added = m.input(U_ADD)
    command = command + m.balance("command", "signal", unit="rad", value=command).effort
    sensed = angle + m.balance("angle_sensor", "signal", unit="rad", value=angle).effort
    period = m.parameter(T_LOOP)
    tick = m.clock("loops", period)
    held = m.discrete(U_HELD)
    before, before_last = m.discrete(BEFORE), m.discrete(BEFORE_LAST)
    gain, limit = m.parameter(K_V), m.parameter(U_MAX)

    measured = (sensed - before_last) / (2 * period)
    wanted = gain * (m.parameter(K_P) * (command - sensed) - measured) + added
    m.update(tick, held, ca.fmax(-limit, ca.fmin(wanted, limit)))
    m.update(tick, before_last, before)
    m.update(tick, before, sensed)

    amplifier = m.balance("amplifier", "signal", unit="V", value=held)
    shaft = m.balance("shaft", "rotation", velocity=speed, angle=angle)
    torque = m.parameter(K_U) * (held + amplifier.effort)
    m.output(TAU, torque + shaft.effort)
    m.output(U, held)
    m.port(SHAFT, torque + shaft.effort, speed)
    m.supply(torque * speed)
