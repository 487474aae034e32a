"""Sampled speed loops of three rolling and three steering axles, first-order currents.

With v_i the set velocity of steering axis A_i, t_i and n_i along and across wheel i, p' = -phi':

    every T:  e = t . v/r_c - p',   v = Kp_d e + I,   i_set = sat(v, i_d_max)
              I += Ki_d e T         unless |v| >= i_d_max
              i_set = sat(Kp_s (n . v/e_c - w_set - beta'), i_s_max)        (steering)
              i_goal = i_set - (i_measured - i)
              i_mean = i_goal + (i - i_goal) (1 - exp(-T/T_i)) T_i/T
    between:  T_i i' = i_goal - i
              tau_phi = -N_d eta_d K_d i_mean,   tau_beta = N_s eta_s K_s i_mean

i_goal is where the current goes: its loop believes its sensor, whose error at the tick counts for
the period. i_mean is the mean of the coming period, known when it begins, so that a master which
steps the drive before the base, period by period, gives it the impulse of that period. The rotors
turn with the axles, so their inertia belongs to the base. The factors eta act in both directions of
power flow, as on the sheet.

Not modelled: voltage limit, elasticity and play of the gears, resolution of the loops' speeds.

Source: rig sheet omni_bench; Åström and Wittenmark, Computer-Controlled Systems, 1997, ch. 8.
"""

from __future__ import annotations

import casadi as ca

from .. import omni_base
from .. import twist_drive as qs
from ..component import Fidelity, Solver
from ..model import SX, Model
from ..quantity import Quantity

# A sixth of the currents' time constant: RK4 leaves 6e-6 of a change of current in a period.
FIDELITY = Fidelity(level=0, solver=Solver("rk4", 2.5e-4))

T = Quantity("T", "s", "period of the loops", start=1e-3, minimum=1e-6, variability="fixed")
L_A = Quantity("l_A", "m", "distance of the steering axes from the reference point", 0.35)
ALPHA_A = Quantity(
    "alpha_A",
    "rad",
    "directions of the steering axes from the reference point",
    start=(1.0471975511965976, 3.141592653589793, 5.235987755982989),
    size=3,
)
R_C = Quantity("r_c", "m", "wheel radius that the loops believe", start=0.1, minimum=0.005)
E_C = Quantity("e_c", "m", "caster offset that the loops believe", start=0.08, minimum=0.005)
KP_D = Quantity("Kp_d", "A.s/rad", "rolling speed loop, proportional gain", 6.0, minimum=0.0)
KI_D = Quantity("Ki_d", "A/rad", "rolling speed loop, integral gain", 30.0, minimum=0.0)
KP_S = Quantity("Kp_s", "A.s/rad", "steering speed loop, proportional gain", 14.0, minimum=0.0)
I_D_MAX = Quantity("i_d_max", "A", "current limit, rolling motors", start=25.0, minimum=1e-6)
I_S_MAX = Quantity("i_s_max", "A", "current limit, steering motors", start=15.0, minimum=1e-6)
T_I = Quantity("T_i", "s", "time constant of the currents", start=1.5e-3, minimum=1e-6)
N_D = Quantity("N_d", "1", "gear ratio of the rolling axles", start=20.0, minimum=1e-3)
N_S = Quantity("N_s", "1", "gear ratio of the steering axles", start=40.0, minimum=1e-3)
K_D = Quantity("K_d", "N.m/A", "torque constant of the rolling motors", start=0.1, minimum=1e-6)
K_S = Quantity("K_s", "N.m/A", "torque constant of the steering motors", start=0.06, minimum=1e-6)
ETA_D = Quantity(
    "eta_d", "1", "efficiency of the rolling gears, factor on the motor torques", 0.8, minimum=0.1
)
ETA_S = Quantity(
    "eta_s", "1", "efficiency of the steering gears, factor on the motor torques", 0.78, minimum=0.1
)
CURRENT_D = Quantity("current_d", "A", "state behind i_d", size=3)
CURRENT_S = Quantity("current_s", "A", "state behind i_s", size=3)
GOAL_D = Quantity("goal_d", "A", "rolling currents that the loops hold", size=3)
GOAL_S = Quantity("goal_s", "A", "steering currents that the loops hold", size=3)
INTEGRAL = Quantity("integral", "A", "integral parts of the rolling speed loops", size=3)
MEAN_D = Quantity("mean_d", "A", "mean rolling currents of the present period", size=3)
MEAN_S = Quantity("mean_s", "A", "mean steering currents of the present period", size=3)


def equations(m: Model) -> None:
    """Collect the equations."""
    u = m.inputs(
        qs.VX_SET, qs.VY_SET, qs.W_SET,
        omni_base.BETA, omni_base.PHI, omni_base.BETA_RATE, omni_base.PHI_RATE,
    )  # fmt: skip
    m.input_rate(u.beta, u.betad)
    m.input_rate(u.phi, u.phid)
    p = m.parameters(
        T, L_A, ALPHA_A, R_C, E_C, KP_D, KI_D, KP_S, I_D_MAX, I_S_MAX, T_I,
        N_D, N_S, K_D, K_S, ETA_D, ETA_S,
    )  # fmt: skip
    x = m.states(CURRENT_D, CURRENT_S)
    z = m.discretes(GOAL_D, GOAL_S, INTEGRAL, MEAN_D, MEAN_S)

    command = ca.vertcat(u.vx_set, u.vy_set, u.w_set)
    command += m.balance("command", "bundle", value=command).effort
    forward, left, turn = ca.vertsplit(command)
    forward += m.balance("forward", "signal", unit="m/s", value=forward).effort
    left += m.balance("sideways", "signal", unit="m/s", value=left).effort
    turn += m.balance("turn", "signal", unit="rad/s", value=turn).effort
    beta = u.beta + each(m, "steering_encoder", "rad", u.beta, sensor=qs.BETA_MEASURED)
    angle = -u.phi + each(m, "rolling_encoder", "rad", -u.phi, sensor=qs.P_MEASURED)

    v_x = forward - turn * p.l_A * ca.sin(p.alpha_A)
    v_y = left + turn * p.l_A * ca.cos(p.alpha_A)
    # what each wheel's own node on the bus is told, row by row
    told = ca.horzcat(v_x, v_y, ca.repmat(turn, 3))
    told += ca.vertcat(
        *(m.balance(f"node_{i + 1}", "bundle", value=told[i, :].T).effort.T for i in range(3))
    )
    v_x, v_y, turns = ca.horzsplit(told)
    along = ca.cos(beta) * v_x + ca.sin(beta) * v_y
    across = ca.cos(beta) * v_y - ca.sin(beta) * v_x
    error = along / p.r_c + u.phid
    wanted = p.Kp_d * error + z.integral
    set_d = ca.fmax(-p.i_d_max, ca.fmin(wanted, p.i_d_max))
    steering = p.Kp_s * (across / p.e_c - turns - u.betad)
    set_s = ca.fmax(-p.i_s_max, ca.fmin(steering, p.i_s_max))
    free = ca.fabs(wanted) < p.i_d_max
    share = -ca.expm1(-p.T / p.T_i) * p.T_i / p.T
    error_d = each(m, "rolling_current", "A", x.current_d, sensor=qs.I_D_MEASURED)
    error_s = each(m, "steering_current", "A", x.current_s, sensor=qs.I_S_MEASURED)
    goal_d, goal_s = set_d - error_d, set_s - error_s

    tick = m.clock("loops", p.T)
    m.update(tick, z.goal_d, goal_d)
    m.update(tick, z.goal_s, goal_s)
    m.update(tick, z.integral, z.integral + free * p.Ki_d * error * p.T)
    m.update(tick, z.mean_d, goal_d + (x.current_d - goal_d) * share)
    m.update(tick, z.mean_s, goal_s + (x.current_s - goal_s) * share)
    m.derivative(x.current_d, (z.goal_d - x.current_d) / p.T_i)
    m.derivative(x.current_s, (z.goal_s - x.current_s) / p.T_i)

    rolling = -p.N_d * constant(m, "rolling_torque_constant", p.K_d, z.mean_d) * z.mean_d
    turning = p.N_s * constant(m, "steering_torque_constant", p.K_s, z.mean_s) * z.mean_s
    m.supply(ca.dot(rolling, u.phid) + ca.dot(turning, u.betad))
    m.loss("rolling_gears", (1 - p.eta_d) * ca.dot(rolling, u.phid))
    m.loss("steering_gears", (1 - p.eta_s) * ca.dot(turning, u.betad))
    m.port(qs.STEERING, m.output(omni_base.TAU_BETA, p.eta_s * turning), u.betad)
    m.port(qs.ROLLING, m.output(omni_base.TAU_PHI, p.eta_d * rolling), u.phid)
    m.output(qs.I_D, x.current_d)
    m.output(qs.I_S, x.current_s)
    m.output(qs.I_D_MEASURED, x.current_d + error_d)
    m.output(qs.I_S_MEASURED, x.current_s + error_s)
    m.output(qs.BETA_MEASURED, beta)
    m.output(qs.P_MEASURED, angle)


def constant(m: Model, name: str, value: SX, current: SX) -> SX:
    """Torque constants of three motors with what effects add [N.m/A]."""
    values = ca.repmat(value, 3)
    return values + each(m, name, "N.m/A", values, "coefficient", current=current)


def each(
    m: Model,
    name: str,
    unit: str,
    value: SX,
    kind: str = "signal",
    *,
    sensor: Quantity | None = None,
    **others: SX,
) -> SX:
    """Open a balance for a signal of all three axles and one for each; what effects add."""
    together = m.balance(name, kind, unit=unit, sensor=sensor, value=value, **others)
    single = [
        m.balance(
            f"{name}_{i + 1}", kind, unit=unit, sensor=sensor, value=value[i],
            **{key: signal[i] for key, signal in others.items()},
        ).effort
        for i in range(3)
    ]  # fmt: skip
    return together.effort + ca.vertcat(*single)
