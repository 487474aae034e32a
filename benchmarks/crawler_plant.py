"""A tracked robot written from its rig sheet alone, to make data sets with undeclared effects.

It shares no code with the components: loads from static equilibrium, dry friction at each road
wheel, steps of 50 us, many robots and runs at once as arrays. Effects are written down here once
more, and some of them no catalogue has.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.bench import Bench, Logged, camera, drawn_form, parameters, write_set

Vector = NDArray[np.float64]
Motion = tuple[Vector, Vector, Vector]
STEP = 5e-5
SAMPLE = 0.02
BLOCK = 4096  # steps whose commands are held at once
COUNT = 2 * np.pi / 25600
MASS, YAW_INERTIA, GRAVITY, LINEAR_BELOW = 15.0, 0.43, 9.81, 1e-3
MARKERS = np.array([[0.0, 0.0], [0.19, 0.13], [0.19, -0.13], [-0.19, 0.13], [-0.19, -0.13]])
HEIGHT = 0.12  # of the mass centre [m]
CAMERA, SPEED_NOISE = 1e-4, 1.5e-3
RAMP = 0.6  # from rest to speed and back [s]
SHEET = Path(__file__).parents[1] / "scenarios/crawler_bench/data/crawler.toml"
RIG = "crawler"
SECONDS = 16.0
DECLARED = {"r": (0.0541, 0.0559), "B": (0.275, 0.285), "a": (0.145, 0.175), "mu": (0.5, 0.8)}
EFFECTS: dict[str, tuple[float, tuple[str, ...]]] = {
    "none": (0.0, ()),
    "friction_asymmetry": (0.05, ("friction_asymmetry",)),
    "friction_anisotropy": (0.15, ("friction_anisotropy",)),
    "mass_shift_x": (6e-3, ("load_shift",)),
    "mass_shift_y": (4e-3, ("load_shift",)),
    "payload": (1.5, ("payload",)),
    "left_radius": (3e-3, ("gain", "radius_offset")),
    "encoders_late": (0.04, ("delay",)),
    "left_encoder_late": (0.04, ("delay",)),
    "camera_late": (0.06, ("delay",)),
    "camera_skew": (2e-3, ("clock_skew",)),
    "camera_scale": (2e-3, ("scale_error",)),
    "marker_offset": (2e-3, ("marker_offset",)),
    "slope": (0.03, ("floor_slope",)),
    "cable": (4.0, ("cable_force",)),
    "turning_torque": (1.0, ("turning_friction",)),
    "patch": (0.3, ("low_friction_patch",)),
    "belt_slip": (0.02, ()),
    "sprocket_runout": (0.01, ("wheel_runout",)),
    "one_marker_moved": (2e-3, ()),
    "speed_friction": (0.3, ()),
    "load_transfer": (0.15, ()),
}
"""Name -> size, and the names of the catalogue that are the same law; none: no catalogue has it.

friction_asymmetry: the right track has mu (1 + d), the left mu (1 - d). friction_anisotropy: less
across. payload: [kg] at (0.1, 0.06) m. slope, cable: [rad], [N] at x = -0.19 m, in a direction of
the floor. turning_torque: against turning, whatever the speed [N.m]. patch: friction is lower by
this share within 0.5 m around (0.3, 0.2). belt_slip: a track is slower by this share of its speed
times what it pulls over mu N. speed_friction: mu falls by this share per m/s of sliding.
load_transfer: height of the mass centre [m] over which accelerations move the load.
"""
CONTAINED = {"mass_shift_x": "payload", "mass_shift_y": "payload"}
"""Law -> law that contains it: a payload elsewhere moves the mass centre as both do."""
USUAL: dict[str, float] = {}
WHOLE: tuple[str, ...] = ()
SHAPES: dict[str, tuple[float, float]] = {
    "encoders_late": (0.25, 4.0), "left_encoder_late": (0.25, 4.0), "camera_late": (0.25, 8.0),
    "slope": (-np.pi, np.pi), "cable": (-np.pi, np.pi), "sprocket_runout": (-np.pi, np.pi),
}  # fmt: skip
"""Name -> range of its shape: factor on a lateness, direction or phase [rad]."""
RUNS = (
    ("SET1_1", (19.5, 0.0)), ("SET1_2", (0.0, 19.5)), ("SET2_1", (31.5, 12.2)),
    ("SET2_2", (12.2, 31.5)), ("SET3_1", (30.9, 5.05)), ("SET3_2", (5.05, 30.9)),
    ("TL_1", (-15.0, 15.0)), ("TR_1", (15.0, -15.0)), ("STR", (30.0, 29.0)),
    ("SET4_1", (38.6, 4.98)), ("SET5_1", (45.9, 5.5)), ("SET5_2", (5.5, 45.9)),
    ("TL_2", (-20.0, 20.0)), ("SLA", (25.0, 25.0)),
)  # fmt: skip
FITTED = ("SET1", "SET2", "SET3", "TL_1", "TR_1", "STR")


def draw(
    random: np.random.Generator, effect: str = "none", factor: float = 1.0, *, wide: bool = False
) -> Bench:
    """A robot with parameters within the sheet's bounds; directions are drawn anyway."""
    values = parameters(random, DECLARED)
    shape = drawn_form(random, SHAPES.get(effect, (0.0, 0.0)), wide=wide)
    return Bench(values, effect, factor * EFFECTS[effect][0], shape)


def profile(t: Vector, seconds: float) -> Vector:
    """Share of the speed at times: smooth from rest within the ramp, and back at the end."""
    rise = np.clip((t - 0.5) / RAMP, 0.0, 1.0)
    fall = np.clip((seconds - 0.7 - t) / RAMP, 0.0, 1.0)
    x = np.minimum(rise, fall)
    return np.asarray(x * x * (3.0 - 2.0 * x))


def speeds(t: Vector, seconds: float) -> tuple[Vector, Vector]:
    """Speeds of the left and right sprockets [rad/s], one column per run of `RUNS`."""
    share = profile(t, seconds)[:, None]
    pairs = np.array([pair for _, pair in RUNS]) * 2 * np.pi / 60.0
    swing = np.array([0.35 if name == "SLA" else 0.0 for name, _ in RUNS])
    wave = swing * np.sin(2 * np.pi * 0.25 * t)[:, None]
    return share * (pairs[:, 0] * (1.0 + wave)), share * (pairs[:, 1] * (1.0 - wave))


def loads(weight: Vector, x: Vector, y: Vector, at_x: Vector, half: Vector) -> Vector:
    """Load of each road wheel from equilibrium, (12, n): equal springs under a stiff body."""
    side = np.repeat([1.0, -1.0], 6)[:, None]
    return np.asarray(weight / 12.0 * (1.0 + x * at_x / np.mean(at_x**2, axis=0) + side * y / half))


def simulate(benches: list[Bench], seconds: float, starts: Vector) -> dict[str, Vector]:
    """Markers and counted speeds at 50 Hz, without noise: name -> (times, runs x benches).

    Args:
        benches: individuals.
        seconds: duration of each run.
        starts: pose of each run at time 0, and where within a count its encoders are,
            (runs, benches, 5).
    """
    count, runs = len(benches), len(RUNS)

    def of(name: str) -> Vector:
        return np.tile([b.of(name) for b in benches], runs)

    def form(name: str) -> Vector:
        return np.tile([b.form(name, USUAL) for b in benches], runs)

    def parameter(name: str) -> Vector:
        return np.tile([b.parameters[name] for b in benches], runs)

    def late(name: str) -> Vector:
        factor = form(name)
        return of(name) * np.where(factor > 0.0, factor, 1.0)

    r, half, a, mu = parameter("r"), parameter("B") / 2, parameter("a"), parameter("mu")
    at_x = np.linspace(-1.0, 1.0, 6)[:, None] * a
    at_x = np.concatenate([at_x, at_x])
    side = np.repeat([1.0, -1.0], 6)[:, None]
    at_y = side * half
    extra = of("payload")
    mass = MASS + extra
    x_g = of("mass_shift_x") + extra * 0.1 / mass
    y_g = of("mass_shift_y") + extra * 0.06 / mass
    inertia = YAW_INERTIA + extra * (0.1**2 + 0.06**2)  # small against the friction's torques
    load = loads(mass * GRAVITY, x_g, y_g, at_x, half)
    grip = mu * (1.0 - side * of("friction_asymmetry"))
    across = 1.0 - of("friction_anisotropy")
    slope, heading = of("slope"), form("slope")
    pull, towards = of("cable"), form("cable")
    push_x = mass * GRAVITY * slope * np.cos(heading), pull * np.cos(towards)
    push_y = mass * GRAVITY * slope * np.sin(heading), pull * np.sin(towards)
    turning, patch, slip = of("turning_torque"), of("patch"), of("belt_slip")
    runout, phase = of("sprocket_runout"), form("sprocket_runout")
    fading, height = of("speed_friction"), of("load_transfer")
    ahead_l = late("encoders_late") + late("left_encoder_late")
    ahead_r = late("encoders_late")
    left_radius = 1.0 + of("left_radius")

    steps = round(seconds / STEP)
    fine = np.arange(steps + 1) * STEP
    left, right = speeds(fine, seconds)

    columns = np.repeat(np.arange(runs), count)

    def driven(values: Vector, ahead: Vector, first: int) -> Vector:
        """Speeds of one side, each column of a run, read ahead by what the encoder is late."""
        rows = np.arange(first, first + BLOCK + 1)[:, None] + np.rint(ahead / STEP).astype(int)
        return np.asarray(values[np.minimum(rows, steps), columns])

    x, y, yaw = starts[..., :3].reshape(runs * count, 3).T
    v_x, v_y, rate = np.zeros(runs * count), np.zeros(runs * count), np.zeros(runs * count)
    angle_l, angle_r = np.zeros(runs * count), np.zeros(runs * count)
    pulled_l = pulled_r = a_x = a_y = np.zeros(runs * count)
    every = round(SAMPLE / STEP)
    kept: list[Vector] = []
    any_runout, any_slip, any_cable = np.any(runout), np.any(slip), np.any(pull)
    any_shift, any_patch = np.any(slope) or np.any(height), np.any(patch)
    any_fading, any_turning = np.any(fading), np.any(turning)
    weight = mass * GRAVITY
    to_x, to_y = push_x[0] + push_x[1], push_y[0] + push_y[1]
    arm_x, arm_y, cable_x, cable_y = at_x - x_g, at_y - y_g, -0.19 - x_g, -y_g
    track = np.empty((12, runs * count))
    cos, sin = np.cos(yaw), np.sin(yaw)
    for step in range(steps + 1):
        place = step % BLOCK
        if place == 0:
            block_l, block_r = driven(left, ahead_l, step), driven(right, ahead_r, step)
        if step % every == 0:
            kept.append(np.array([x, y, yaw]))
        w_l, w_r = block_l[place], block_r[place]
        t_l, t_r = r * left_radius * w_l, r * w_r
        if any_runout:
            t_l = t_l * (1.0 + runout * np.cos(angle_l + phase))
        if any_slip:
            t_l, t_r = t_l * (1.0 - slip * pulled_l), t_r * (1.0 - slip * pulled_r)
        # velocity of the mass centre is the state, in floor axes; contacts in body axes
        f, s = v_x * cos + v_y * sin + rate * y_g, -v_x * sin + v_y * cos - rate * x_g
        track[:6], track[6:] = t_l, t_r
        u = f - rate * at_y - track
        w = s + rate * at_x
        speed = np.sqrt(u * u + w * w)
        n = load
        if any_shift:  # what acts on the mass centre shifts the load
            f_x = HEIGHT * push_x[0] / mass - height * a_x
            f_y = HEIGHT * push_y[0] / mass - height * a_y
            down = (f_x * cos + f_y * sin) / GRAVITY, (-f_x * sin + f_y * cos) / GRAVITY
            n = np.maximum(loads(weight, x_g + down[0], y_g + down[1], at_x, half), 0.0)
        m = grip
        if any_fading:
            m = m * (1.0 - fading * speed)
        if any_patch:
            there_x = x + at_x * cos - at_y * sin - 0.3
            there_y = y + at_x * sin + at_y * cos - 0.2
            m = m * (1.0 - patch * (there_x**2 + there_y**2 < 0.25))
        share = m * n / np.maximum(speed, LINEAR_BELOW)
        g_x, g_y = -share * u, -share * w * across
        pulled = g_x.reshape(2, 6, -1).sum(axis=1)
        if any_slip:
            held = (mu * load).reshape(2, 6, -1).sum(axis=1)
            pulled_l, pulled_r = pulled / held
        sum_x, sum_y = pulled.sum(axis=0), g_y.sum(axis=0)
        torque = np.sum(arm_x * g_y - arm_y * g_x, axis=0)
        if any_turning:
            torque = torque - turning * np.tanh(rate / 0.02)
        if any_cable:
            torque = torque + (cable_x * (-push_x[1] * sin + push_y[1] * cos)
                               - cable_y * (push_x[1] * cos + push_y[1] * sin))  # fmt: skip
        a_x = (sum_x * cos - sum_y * sin + to_x) / mass
        a_y = (sum_x * sin + sum_y * cos + to_y) / mass
        before = v_x, v_y, rate
        v_x, v_y, rate = v_x + STEP * a_x, v_y + STEP * a_y, rate + STEP * torque / inertia
        # The pose of the body's origin from velocities of the mass centre at both ends of the step:
        # its own alone is half a step early or late, and a lag of 25 us is a sixth of that of
        # friction below the sliding speed LINEAR_BELOW, from which mu is known.
        from_x, from_y = _origin(before, cos, sin, x_g, y_g)
        yaw = yaw + 0.5 * STEP * (before[2] + rate)
        cos, sin = np.cos(yaw), np.sin(yaw)
        till_x, till_y = _origin((v_x, v_y, rate), cos, sin, x_g, y_g)
        x, y = x + 0.5 * STEP * (from_x + till_x), y + 0.5 * STEP * (from_y + till_y)
        angle_l = angle_l + 0.5 * STEP * (w_l + block_l[place + 1])
        angle_r = angle_r + 0.5 * STEP * (w_r + block_r[place + 1])
    poses = np.array(kept)  # (times, 3, runs x benches)
    seen = camera(poses, of("camera_skew"), late("camera_late"), SAMPLE)
    found = {}
    scale = 1.0 + of("camera_scale")
    for k, (m_x, m_y) in enumerate(MARKERS):
        m_x = m_x + of("marker_offset") + (k == 2) * of("one_marker_moved")
        cos, sin = np.cos(seen[:, 2]), np.sin(seen[:, 2])
        found[f"m{k + 1}_x"] = scale * (seen[:, 0] + m_x * cos - m_y * sin)
        found[f"m{k + 1}_y"] = scale * (seen[:, 1] + m_x * sin + m_y * cos)
    # what is logged is the command, of which late encoders know an earlier part
    for k, (name, values) in enumerate((("sprocket_speed_l", left), ("sprocket_speed_r", right))):
        advance = 0.5 * STEP * (values[:-1] + values[1:])
        angle = np.vstack([np.zeros(runs), np.cumsum(advance, axis=0)])[::every]
        counts = np.floor(np.repeat(angle, count, axis=1) / COUNT + starts[..., 3 + k].ravel())
        found[name] = np.diff(counts, axis=0, prepend=counts[:1]) * COUNT / SAMPLE
    return found


def _origin(
    motion: Motion, cos: Vector, sin: Vector, x_g: Vector, y_g: Vector
) -> tuple[Vector, Vector]:
    """Velocity of the body's origin, which moves with its point."""
    v_x, v_y, rate = motion
    return v_x + rate * (x_g * sin + y_g * cos), v_y - rate * (x_g * cos - y_g * sin)


def _starts(seed: int, benches: list[Bench]) -> Vector:
    """Start poses of the runs, and where within a count their encoders are, (runs, benches, 5).

    Drawn for each robot from its parameters: what counts hide moves estimates, of all robots
    together if they share it; a robot and its twin without effects start alike.
    """
    found = []
    for bench in benches:
        own = np.array([bench.parameters[name] for name in DECLARED]).view(np.uint32)
        random = np.random.default_rng([seed, 2, *own.tolist()])
        poses = random.uniform([-0.1, -0.1, -np.pi], [0.1, 0.1, np.pi], (len(RUNS), 3))
        found.append(np.hstack([poses, random.uniform(0.0, 1.0, (len(RUNS), 2))]))
    return np.stack(found, axis=1)


def changes(benches: list[Bench], seed: int, seconds: float) -> list[dict[str, dict[str, Vector]]]:
    """What each robot's effects change, without noise: run -> channel -> values."""
    twins = [Bench(bench.parameters) for bench in benches]
    both = [*benches, *twins]
    values = simulate(both, seconds, _starts(seed, both))
    count = 2 * len(benches)
    return [
        {
            run: {
                name: table[:, k * count + column] - table[:, k * count + column + len(benches)]
                for name, table in values.items() if name.startswith("m")
            }
            for k, (run, _) in enumerate(RUNS)
        }
        for column in range(len(benches))
    ]  # fmt: skip


def write_sets(
    folder: Path, benches: list[Bench], sheet: Path, seed: int, seconds: float
) -> list[Path]:
    """Write one data set per robot, with the sheet's noise; return their folders."""
    random = np.random.default_rng([seed, 1])
    starts = _starts(seed, benches)
    values = simulate(benches, seconds, starts)
    names = ["sprocket_speed_l", "sprocket_speed_r"]
    names += [f"m{k}_{axis}" for k in range(1, 6) for axis in "xy"]
    places = []
    for column, _ in enumerate(benches):
        logged = []
        for k, (run, _) in enumerate(RUNS):
            table = {"time": np.arange(values["m1_x"].shape[0]) * SAMPLE}
            for name in names:
                clean = values[name][:, k * len(benches) + column]
                sigma = CAMERA if name.startswith("m") else SPEED_NOISE
                table[name] = clean + sigma * random.standard_normal(clean.size)
            near = starts[k, column, :3] + random.standard_normal(3) * [1e-3, 1e-3, 3e-3]
            purpose = "identification" if run.startswith(FITTED) else "validation"
            pose = [round(float(v), 4) for v in near]
            logged.append(Logged(run, purpose, table, {"initial_pose": pose}))
        places.append(write_set(folder / f"{RIG}_{column:03d}", RIG, sheet, 50, logged))
    return places
