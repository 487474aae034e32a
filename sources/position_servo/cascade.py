"""Sampled position loop around a speed loop, on an amplifier that sets the current.

    every T_loop:  w_m = (phi_k - phi_(k-2)) / (2 T_loop)
                   u = sat(K_p K_v (q_ref - phi) - K_v w_m + u_add, u_max)
    between:       tau = K_u u,   u is held

The speed is the mean of the last two differences of the angle; before the first tick the shaft
stood. `u_add` is what an experiment adds behind the loops.

Not modelled: the current loop (time constants well below T_loop), the winding and its losses; the
amplifier supplies the mechanical power. Computing time of the loops is the effect `delay` at
`amplifier`.

Source: Janot, Gautier, Brunot, Data set and reference models of EMPS, Workshop on Nonlinear System
Identification Benchmarks, 2019.
"""

from __future__ import annotations

import casadi as ca

from .. import position_servo as qs
from ..component import Fidelity, Solver
from ..model import Model
from ..quantity import Quantity

# No states of its own; those of effects (lags) may be stiff.
FIDELITY = Fidelity(level=0, solver=Solver("rodas3", 1e-3))
U_ADD = Quantity("u_add", "V", "set value added behind the loops")
K_P = Quantity("K_p", "1/s", "gain of the position loop", start=100.0, minimum=0.0)
K_V = Quantity("K_v", "V.s/rad", "gain of the speed loop", start=0.1, minimum=0.0)
K_U = Quantity("K_u", "N.m/V", "torque per output of the loops", start=0.01)
U_MAX = Quantity("u_max", "V", "limit of the loops' output", start=10.0, minimum=1e-6)
BEFORE = Quantity("phi_before", "rad", "angle at the last tick")
BEFORE_LAST = Quantity("phi_before_last", "rad", "angle at the tick before the last one")
STARTED = Quantity("started", "1", "1 once the loops run")


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(qs.Q_REF, qs.PHI, qs.W, U_ADD)
    p = m.parameters(qs.T_LOOP, K_V, U_MAX, K_P, K_U)
    z = m.discretes(qs.U_HELD, BEFORE, BEFORE_LAST, STARTED)
    q_ref = u.q_ref + m.balance("command", "signal", unit="rad", value=u.q_ref).effort
    phi = u.phi + m.balance("angle_sensor", "signal", unit="rad", value=u.phi).effort
    tick = m.clock("loops", p.T_loop)

    before, before_last = (
        ca.if_else(z.started > 0.5, old, phi) for old in (z.phi_before, z.phi_before_last)
    )
    w_m = (phi - before_last) / (2 * p.T_loop)
    wanted = p.K_v * (p.K_p * (q_ref - phi) - w_m) + u.u_add
    m.update(tick, z.u_held, ca.fmax(-p.u_max, ca.fmin(wanted, p.u_max)))
    m.update(tick, z.phi_before_last, before)
    m.update(tick, z.phi_before, phi)
    m.update(tick, z.started, ca.SX(1.0))

    amplifier = m.balance("amplifier", "signal", unit="V", value=z.u_held)
    shaft = m.balance("shaft", "rotation", velocity=u.w, angle=u.phi)
    torque = p.K_u * (z.u_held + amplifier.effort)
    m.output(qs.TAU, torque + shaft.effort)
    m.output(qs.U, z.u_held)
    m.port(qs.SHAFT, torque + shaft.effort, u.w)
    m.supply(torque * u.w)
