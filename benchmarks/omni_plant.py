"""An omnidirectional base written from its rig sheet alone, to make data sets with undeclared laws.

It shares no code with the components: momentum of a platform with three forks, steps of 50 us
(velocities first, then positions), many bases and runs at once as arrays. Commands are those of the
project's copy of OB-06. Effects are written down here once more, and some of them no catalogue has.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.bench import Bench, Logged, beside, camera, drawn_form, parameters, write_set

Vector = NDArray[np.float64]
STEP, TICKS, SAMPLE = 5e-5, 20, 0.01  # mechanics; steps per control period; of the log [s]
RIG, SECONDS = "omni_bench", 18.0
HERE = Path(__file__).parents[1] / "scenarios/omni_bench/data"
SHEET, COMMANDS = HERE / "omni_bench.toml", HERE / "OB-06"
AXES = np.array([[0.175, 0.303109], [-0.35, 0.0], [0.175, -0.303109]])
PLATFORM, CENTRE, WHEEL_SET, BEHIND = 220.0, np.array([0.02, -0.01]), 10.0, 0.06
SET_INERTIA, SPIN, GRAVITY = 0.05, 0.03 + 20.0**2 * 2e-4, 9.81
ROTOR = 40.0**2 * 6e-5
FORK = SET_INERTIA + WHEEL_SET * BEHIND**2
CREEP_SPEED, LAG = 0.05, 1.5e-3
DRIVE_COUNT, STEER_COUNT = 2 * np.pi / 81920, 2 * np.pi / 65536
SIGMA = {"x": 5e-4, "y": 5e-4, "phi": 8e-4, "steer_angle": 2e-4, "drive_speed": 5e-3,
         "drive_current": 0.04, "steer_current": 0.04}  # fmt: skip
DECLARED = {
    "r": (0.099, 0.101), "e": (0.0775, 0.0825), "I_p": (15.5, 20.0), "eta_d": (0.72, 0.88),
    "b_d": (0.25, 1.1), "eta_s": (0.7, 0.86), "b_s": (0.35, 1.5), "f_r": (0.006, 0.02),
    "c_x": (8.0, 18.0), "c_y": (6.0, 14.0), "mu": (0.48, 0.75), "Kp_d": (4.5, 8.0),
    "Ki_d": (20.0, 42.0), "Kp_s": (10.0, 19.0),
}  # fmt: skip
EFFECTS: dict[str, tuple[float, tuple[str, ...]]] = {
    "none": (0.0, ()),
    "drive_coulomb": (0.8, ("coulomb",)),
    "steering_coulomb": (1.0, ("coulomb",)),
    "drive_load_friction": (0.05, ("load_friction",)),
    "drive_viscous": (0.4, ("viscous",)),
    "steering_hose": (2.0, ("hose_spring",)),
    "rolling": (8e-3, ("rolling_resistance",)),
    "one_radius": (4e-4, ("radius_offset",)),
    "runout": (1e-3, ("wheel_runout",)),
    "encoder_turned": (5e-3, ("encoder_offset",)),
    "payload": (20.0, ("payload",)),
    "mass_shift": (0.02, ("load_shift",)),
    "slope": (0.01, ("floor_slope",)),
    "cable": (8.0, ("cable_force",)),
    "air": (30.0, ("body_drag",)),
    "turning_torque": (3.0, ("turning_friction",)),
    "command_late": (0.03, ("delay",)),
    "camera_late": (0.04, ("delay",)),
    "camera_skew": (2e-3, ("clock_skew",)),
    "camera_turned": (4e-3, ("encoder_offset", "frame_rotation")),
    "camera_scale": (3e-3, ("scale_error", "gain")),
    "marker_offset": (5e-3, ("marker_offset",)),
    "current_gain": (0.05, ("current_gain", "gain")),
    "current_offset": (0.3, ("current_offset", "bias")),
    "scrub": (0.01, ()),
    "axis_moved": (5e-3, ()),
    "saturation": (0.15, ("torque_constant_saturation",)),
    "soft_creep": (0.3, ()),
}
"""Name -> size, and the names of the catalogue that are the same law, or nearly; none: it has none.

drive_*: at wheel 2; steering_*, scrub: at wheel 1. one_radius, runout: wheel 3 [m]. current_*:
drive 3's sensor, in its loop. payload: [kg] at (0.2, -0.15) m. slope, cable: at P, in a direction
of the floor. air: [N/(m/s)^2] at P. turning_torque: against turning, whatever the speed [N.m],
on the platform alone (patches that scrub turn the forks as well). steering_hose: straight at 0.
scrub: the patch of wheel 1 resists turning on the floor by this length times its load. axis_moved:
axis 3 sits this much further forward. saturation: drives lose this share of their torque at 10 A.
soft_creep: c_y is less by this share at twice the mean load.
"""
CONTAINED = {"mass_shift": "payload"}
"""Law -> law that contains it: a payload elsewhere moves the mass centre as both do."""
USUAL: dict[str, float] = {}
SHAPES: dict[str, tuple[float, float]] = {
    "command_late": (0.25, 8.0), "camera_late": (0.25, 8.0), "mass_shift": (-np.pi, np.pi),
    "slope": (-np.pi, np.pi), "cable": (-np.pi, np.pi), "runout": (-np.pi, np.pi),
    "marker_offset": (-np.pi, np.pi),
}  # fmt: skip
WHOLE: tuple[str, ...] = ()


@dataclass(frozen=True)
class Run:
    """One run: commanded twists at 100 Hz, and where it starts."""

    name: str
    purpose: str
    twist: Vector
    steering: Vector
    pose: Vector


def draw(
    random: np.random.Generator, effect: str = "none", factor: float = 1.0, *, wide: bool = False
) -> Bench:
    """A base with parameters within the sheet's bounds; directions are drawn anyway."""
    values = parameters(random, DECLARED)
    shape = drawn_form(random, SHAPES.get(effect, (0.0, 0.0)), wide=wide)
    return Bench(values, effect, factor * EFFECTS[effect][0], shape)


def runs(seed: int) -> list[Run]:
    """Commands and steering angles of OB-06, from other poses."""
    random = np.random.default_rng([seed, 2])
    table = tomllib.loads((COMMANDS / "set.toml").read_text(encoding="utf-8"))
    found = []
    for entry in table["run"]:
        with np.load(COMMANDS / entry["file"]) as data:
            twist = np.column_stack([data[name] for name in ("vx_set", "vy_set", "w_set")])
        pose = random.uniform([-0.1, -0.1, -np.pi], [0.1, 0.1, np.pi])
        found.append(Run(entry["name"], entry["purpose"], twist,
                         np.array(entry["initial_steering_angle"]), pose))  # fmt: skip
    return found


def _across(x: Vector, y: Vector, u: Vector, v: Vector) -> Vector:
    return np.asarray(x * v - y * u)


def simulate(benches: list[Bench], chosen: list[Run], seconds: float) -> dict[str, Vector]:
    """All channels at 100 Hz, without noise and counts: name -> (times, runs x benches).

    A run that ends earlier stays at its last command.
    """
    count = len(benches)
    n = count * len(chosen)

    def of(name: str) -> Vector:
        return np.tile([b.of(name) for b in benches], len(chosen))

    def form(name: str) -> Vector:
        return np.tile([b.form(name, USUAL) for b in benches], len(chosen))

    def late(name: str) -> Vector:
        factor = form(name)
        return of(name) * np.where(factor > 0.0, factor, 1.0)

    def wheel(which: int, values: Vector) -> Vector:
        found = np.zeros((3, n))
        found[which] = values
        return found

    p = {k: np.tile([b.parameters[k] for b in benches], len(chosen)) for k in DECLARED}
    samples = round(seconds / SAMPLE)
    longest = np.arange(samples + 1)
    twist = np.stack([r.twist[np.minimum(longest, len(r.twist) - 1)] for r in chosen])
    which = np.repeat(np.arange(len(chosen)), count)
    held_back = late("command_late")

    # masses: the platform with what stands on it
    extra = of("payload")
    shift, towards = of("mass_shift"), form("mass_shift")
    own = CENTRE[:, None] + shift * np.array([np.cos(towards), np.sin(towards)])
    place = np.array([0.2, -0.15])[:, None]
    body = PLATFORM + extra
    centre = (PLATFORM * own + extra * place) / body
    about = p["I_p"] + PLATFORM * np.sum((own - centre) ** 2, axis=0)
    about = about + extra * np.sum((place - centre) ** 2, axis=0)
    total = body + 3 * WHEEL_SET
    axes = np.repeat(AXES[:, :, None], n, axis=2)  # 3 x 2 x n
    axes[2, 0] += of("axis_moved")
    a_x, a_y = axes[:, 0], axes[:, 1]

    radius = p["r"] + np.zeros((3, n)) + wheel(2, of("one_radius"))
    runout, phase = of("runout"), form("runout")
    friction = wheel(1, of("drive_coulomb"))
    loaded = wheel(1, of("drive_load_friction"))
    viscous = p["b_d"] + wheel(1, of("drive_viscous"))
    resistance = p["f_r"] + wheel(1, of("rolling"))
    stuck, hose = wheel(0, of("steering_coulomb")), wheel(0, of("steering_hose"))
    scrub, fade, soft = wheel(0, of("scrub")), of("saturation"), of("soft_creep")
    turned = wheel(0, of("encoder_turned"))
    gain, offset = wheel(2, of("current_gain")), wheel(2, of("current_offset"))
    slope, heading = of("slope") * total * GRAVITY, form("slope")
    hill = slope * np.cos(heading), slope * np.sin(heading)
    pull, direction = of("cable"), form("cable")
    rope = pull * np.cos(direction), pull * np.sin(direction)
    air, turning = of("air"), of("turning_torque")
    has = {k: bool(np.any(v)) for k, v in {
        "runout": runout, "soft": soft, "scrub": scrub, "hose": hose, "fade": fade,
    }.items()}  # fmt: skip

    x, y, phi = np.repeat([r.pose for r in chosen], count, axis=0).T.copy()
    b = np.repeat([r.steering for r in chosen], count, axis=0).T.copy()
    v_x, v_y, w = np.zeros(n), np.zeros(n), np.zeros(n)  # of P, in body axes
    b_rate, wheel_angle, p_rate = np.zeros((3, n)), np.zeros((3, n)), np.zeros((3, n))
    i_d, i_s, set_d, set_s = (np.zeros((3, n)) for _ in range(4))
    memory = np.zeros((3, n))
    keep = np.exp(-STEP / LAG)
    kept: list[Vector] = []
    for step in range(samples * 200 + 1):
        t, u = np.cos(b), np.sin(b)
        if step % 200 == 0:
            kept.append(
                np.vstack([[x, y, phi], b + turned, wheel_angle, i_d * (1 + gain) + offset, i_s])
            )
        if step % TICKS == 0:
            when = np.clip(step * STEP - held_back, 0.0, None) / SAMPLE
            low = np.minimum(when.astype(int), samples - 1)
            share = (when - low)[:, None]
            want = twist[which, low] * (1 - share) + twist[which, low + 1] * share
            at_x, at_y = (
                want[:, 0] - want[:, 2] * AXES[:, 1:],
                want[:, 1] + want[:, 2] * AXES[:, :1],
            )
            seen_t, seen_u = (np.cos(b + turned), np.sin(b + turned)) if turned.any() else (t, u)
            along, across = seen_t * at_x + seen_u * at_y, seen_t * at_y - seen_u * at_x
            error = along / 0.100 - p_rate
            asked = p["Kp_d"] * error + memory
            memory = memory + np.where(np.abs(asked) < 25.0, p["Ki_d"] * error * 1e-3, 0.0)
            set_d = np.clip(asked, -25.0, 25.0)
            set_s = np.clip(p["Kp_s"] * (across / 0.080 - want[:, 2] - b_rate), -15.0, 15.0)
        # currents; a sensor in the loop makes the true one follow what it shows
        i_d = set_d * (1 - keep) + i_d * keep if not gain.any() and not offset.any() else (
            (set_d - offset) / (1 + gain) * (1 - keep) + i_d * keep)  # fmt: skip
        i_s = set_s * (1 - keep) + i_s * keep
        # loads: the weight's point in the triangle of the contacts
        c_x, c_y = a_x - p["e"] * t, a_y - p["e"] * u
        g_x = (body * centre[0] + WHEEL_SET * np.sum(a_x - BEHIND * t, axis=0)) / total
        g_y = (body * centre[1] + WHEEL_SET * np.sum(a_y - BEHIND * u, axis=0)) / total
        d_x, d_y = c_x - g_x, c_y - g_y
        part = np.stack(
            [_across(d_x[j], d_y[j], d_x[k], d_y[k]) for j, k in ((1, 2), (2, 0), (0, 1))]
        )
        load = total * GRAVITY * part / part.sum(axis=0)
        # contacts
        vel_x, vel_y = v_x - w * a_y, v_y + w * a_x
        r = radius
        if has["runout"]:
            r = radius + np.stack([0 * runout, 0 * runout, runout * np.cos(wheel_angle[2] + phase)])
        roll = r * p_rate
        s_t = t * vel_x + u * vel_y - roll
        s_n = t * vel_y - u * vel_x - p["e"] * (w + b_rate)
        speed = np.sqrt(roll * roll + CREEP_SPEED**2)
        stiff = p["c_y"]
        if has["soft"]:
            stiff = stiff * (1 - soft * (load / (total * GRAVITY / 3) - 1))
        f_t, f_n = p["c_x"] * load * s_t / speed, stiff * load * s_n / speed
        size = np.sqrt(f_t * f_t + f_n * f_n)
        bound = p["mu"] * load
        ratio = np.maximum(size / bound, 1e-9)
        g = np.tanh(ratio) / ratio
        f_t, f_n = -g * f_t, -g * f_n
        f_x, f_y = f_t * t - f_n * u, f_t * u + f_n * t
        # wheels
        drive = 20 * p["eta_d"] * 0.10 * i_d
        if has["fade"]:
            drive = drive * (1 - fade * i_d**2 / 100.0)
        lost = (friction + loaded * np.abs(drive)) * np.tanh(p_rate / 0.02)
        p_acc = (drive - viscous * p_rate - lost - resistance * load * r * np.tanh(p_rate / 0.1)
                 - r * f_t) / SPIN  # fmt: skip
        # forks: what turns them, without the accelerations
        motor = 40 * p["eta_s"] * 0.06 * i_s - p["b_s"] * b_rate
        motor = motor - stuck * np.tanh(b_rate / 0.02)
        if has["hose"]:
            motor = motor - hose * b
        cos, sin = np.cos(phi), np.sin(phi)
        hill_x, hill_y = hill[0] * cos + hill[1] * sin, -hill[0] * sin + hill[1] * cos
        motor = motor - WHEEL_SET * BEHIND / total * (t * hill_y - u * hill_x)
        ground = -p["e"] * f_n
        if has["scrub"]:
            ground = ground - scrub * load * np.tanh((w + b_rate) / 0.05)
        # n.a(A) = n.a_P + acc n.(k x A) - w^2 n.A, of which only the last is known
        n_a = t * a_y - u * a_x  # n.A
        n_k = t * a_x + u * a_y  # n.(k x A)
        arm = WHEEL_SET * BEHIND
        known = (motor + ground - arm * w**2 * n_a) / (FORK + ROTOR)
        to_x, to_y = -u * arm / (FORK + ROTOR), t * arm / (FORK + ROTOR)
        to_acc = (arm * n_k - FORK) / (FORK + ROTOR)
        # momentum of all; a fork's mass centre: A - BEHIND t, turning with w + b'
        spun = (w + b_rate) ** 2
        out_x = (hill[0] + rope[0]) * cos + (hill[1] + rope[1]) * sin
        out_y = -(hill[0] + rope[0]) * sin + (hill[1] + rope[1]) * cos
        pace = np.sqrt(v_x**2 + v_y**2)
        out_x, out_y = out_x - air * pace * v_x, out_y - air * pace * v_y
        rest_x = WHEEL_SET * (-(w**2) * a_x + BEHIND * (known * u + spun * t))
        rest_y = WHEEL_SET * (-(w**2) * a_y - BEHIND * (known * t - spun * u))
        right_x = f_x.sum(axis=0) + out_x - rest_x.sum(axis=0) + body * w**2 * centre[0]
        right_y = f_y.sum(axis=0) + out_y - rest_y.sum(axis=0) + body * w**2 * centre[1]
        # yaw about P: forks' moments of momentum, and the torque between platform and fork inside
        s_x, s_y = a_x - BEHIND * t, a_y - BEHIND * u
        turn = _across(c_x, c_y, f_x, f_y).sum(axis=0) - turning * np.tanh(w / 0.02)
        if has["scrub"]:
            turn = turn - (scrub * load * np.tanh((w + b_rate) / 0.05)).sum(axis=0)
        turn = turn + _across(g_x, g_y, hill_x, hill_y)
        right_w = (
            turn - _across(s_x, s_y, rest_x, rest_y).sum(axis=0) - SET_INERTIA * known.sum(axis=0)
        )
        # of a_P and the yaw acceleration: b'' = known + to_x a_x + to_y a_y + to_acc acc
        m_xx = total + (WHEEL_SET * BEHIND * u * to_x).sum(axis=0)
        m_xy = (WHEEL_SET * BEHIND * u * to_y).sum(axis=0)
        m_xw = -body * centre[1] + (WHEEL_SET * (-a_y + BEHIND * u * (1 + to_acc))).sum(axis=0)
        m_yx = -(WHEEL_SET * BEHIND * t * to_x).sum(axis=0)
        m_yy = total - (WHEEL_SET * BEHIND * t * to_y).sum(axis=0)
        m_yw = body * centre[0] + (WHEEL_SET * (a_x - BEHIND * t * (1 + to_acc))).sum(axis=0)
        turned_x, turned_y = BEHIND * u, -BEHIND * t  # of a fork's centre per unit of b''
        lever = _across(s_x, s_y, turned_x, turned_y) * WHEEL_SET + SET_INERTIA
        m_wx = -body * centre[1] + (-WHEEL_SET * s_y + lever * to_x).sum(axis=0)
        m_wy = body * centre[0] + (WHEEL_SET * s_x + lever * to_y).sum(axis=0)
        own_yaw = about + body * (centre[0] ** 2 + centre[1] ** 2)
        m_ww = own_yaw + (WHEEL_SET * _across(s_x, s_y, -a_y, a_x) + lever * (1 + to_acc)).sum(
            axis=0
        )
        det = (m_xx * (m_yy * m_ww - m_yw * m_wy) - m_xy * (m_yx * m_ww - m_yw * m_wx)
               + m_xw * (m_yx * m_wy - m_yy * m_wx))  # fmt: skip
        p_x = (right_x * (m_yy * m_ww - m_yw * m_wy) - m_xy * (right_y * m_ww - m_yw * right_w)
               + m_xw * (right_y * m_wy - m_yy * right_w)) / det  # fmt: skip
        p_y = (m_xx * (right_y * m_ww - m_yw * right_w) - right_x * (m_yx * m_ww - m_yw * m_wx)
               + m_xw * (m_yx * right_w - right_y * m_wx)) / det  # fmt: skip
        acc = (m_xx * (m_yy * right_w - right_y * m_wy) - m_xy * (m_yx * right_w - right_y * m_wx)
               + right_x * (m_yx * m_wy - m_yy * m_wx)) / det  # fmt: skip
        b_acc = known + to_x * p_x + to_y * p_y + to_acc * acc
        # velocities first; those of P are in axes that turn
        v_x, v_y = v_x + STEP * (p_x + w * v_y), v_y + STEP * (p_y - w * v_x)
        w, b_rate, p_rate = w + STEP * acc, b_rate + STEP * b_acc, p_rate + STEP * p_acc
        x, y = x + STEP * (v_x * cos - v_y * sin), y + STEP * (v_x * sin + v_y * cos)
        phi, b, wheel_angle = phi + STEP * w, b + STEP * b_rate, wheel_angle + STEP * p_rate
    table = np.array(kept)
    seen = camera(table[:, :3], of("camera_skew"), late("camera_late"), SAMPLE)
    off, where = of("marker_offset"), form("marker_offset")
    scale = 1 + of("camera_scale")
    found = {
        "x": scale * (seen[:, 0] + off * np.cos(seen[:, 2] + where)),
        "y": scale * (seen[:, 1] + off * np.sin(seen[:, 2] + where)),
        "phi": seen[:, 2] + of("camera_turned"),
    }
    kinds = "steer_angle", "wheel_angle", "drive_current", "steer_current"
    names = [f"{kind}_{k}" for kind in kinds for k in (1, 2, 3)]
    return found | {name: table[:, 3 + k] for k, name in enumerate(names)}


def counted(angle: Vector, count: float) -> Vector:
    """Speed from counts over the last sample interval."""
    counts = np.floor(angle / count)
    return np.asarray(np.diff(counts, axis=0, prepend=counts[:1]) * count / SAMPLE)


def _channels(values: dict[str, Vector], *, exact: bool) -> dict[str, Vector]:
    """The log's columns without their noise."""
    found = {}
    for name, table in values.items():
        kind, _, number = name.rpartition("_")
        if kind == "wheel_angle":
            speed = np.diff(table, axis=0, prepend=table[:1]) / SAMPLE
            found[f"drive_speed_{number}"] = speed if exact else counted(table, DRIVE_COUNT)
        elif kind == "steer_angle" and not exact:
            found[name] = np.floor(table / STEER_COUNT + 0.5) * STEER_COUNT
        else:
            found[name] = table
    return found


def changes(benches: list[Bench], seed: int, seconds: float) -> list[dict[str, dict[str, Vector]]]:
    """What each base's effects change, without noise: run -> channel -> values."""
    twins = [Bench(bench.parameters) for bench in benches]
    chosen = runs(seed)
    values = _channels(simulate([*benches, *twins], chosen, seconds), exact=True)
    return beside(values, [(run.name, len(run.twist)) for run in chosen], len(benches))


def write_sets(
    folder: Path, benches: list[Bench], sheet: Path, seed: int, seconds: float
) -> list[Path]:
    """Write one data set per base, with the sheet's noise and counts; return their folders."""
    random = np.random.default_rng([seed, 1])
    chosen = runs(seed)
    values = _channels(simulate(benches, chosen, seconds), exact=False)
    names = ["x", "y", "phi"]
    names += [f"{kind}_{k}" for kind in list(SIGMA)[3:] for k in (1, 2, 3)]
    places = []
    for column, _ in enumerate(benches):
        logged = []
        for k, run in enumerate(chosen):
            rows = min(len(run.twist), round(seconds / SAMPLE) + 1)
            table: dict[str, Any] = {"time": np.arange(rows) * SAMPLE}
            table |= dict(zip(("vx_set", "vy_set", "w_set"), run.twist[:rows].T, strict=True))
            for name in names:
                clean = values[name][:rows, k * len(benches) + column]
                sigma = SIGMA.get(name) or SIGMA[name.rpartition("_")[0]]
                table[name] = clean + sigma * random.standard_normal(rows)
            near = run.pose + random.standard_normal(3) * [1e-3, 1e-3, 2e-3]
            # what the encoders show before the run
            steering = values_at_start(values, k * len(benches) + column)
            steering = steering + 3e-5 * random.standard_normal(3)
            entries = {
                "initial_pose": [round(float(v), 4) for v in near],
                "initial_steering_angle": [round(float(v), 5) for v in steering],
            }
            logged.append(Logged(run.name, run.purpose, table, entries))
        places.append(write_set(folder / f"{RIG}_{column:03d}", RIG, sheet, 100, logged))
    return places


def values_at_start(values: dict[str, Vector], column: int) -> Vector:
    """Readings of the steering encoders before a run."""
    return np.array([values[f"steer_angle_{k}"][0, column] for k in (1, 2, 3)])
