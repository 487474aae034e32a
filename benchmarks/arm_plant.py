"""A UR5 on a table written from its rig sheet alone, to make data sets with undeclared laws.

It shares no code with the components: Newton's and Euler's equations of six links in axes of the
table, ticks of 0.5 ms (speeds first, then angles), many arms and runs at once as arrays. Set angles
are drawn. Effects are written down here once more, and some of them no catalogue has.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.bench import Bench, Logged, beside, drawn_form, parameters, write_set

Vector = NDArray[np.float64]
TICK, SAMPLE, HOLD = 5e-4, 8e-3, 2.0
"""[s] Of mechanics and servo, of the log, and how long the first pose is held before it."""
RIG, SECONDS = "ur5_bench", 25.0
SHEET = Path(__file__).parents[1] / "scenarios/ur5_bench/data/ur5_bench.toml"
ARM: dict[str, Any] = tomllib.loads(SHEET.read_text(encoding="utf-8"))["ur5"]
SENSOR = 2 * np.pi * 2000.0  # bandwidth of the current sensors [rad/s]
SIGMA = {"q": 2e-5, "qd": 2e-3, "current": 0.02}
RATIO, GRAVITY = float(ARM["gear_ratio"]), 9.81
ROTORS = ["J_rotor_13"] * 3 + ["J_rotor_46"] * 3
DECLARED = (
    {f"eta_{k}": (0.68, 0.84) for k in range(1, 7)}
    | {f"b_{k}": (4.0, 14.0) for k in range(1, 4)}
    | {f"b_{k}": (1.0, 4.0) for k in range(4, 7)}
    | {"J_rotor_13": (8.5e-5, 1.2e-4), "J_rotor_46": (2.1e-5, 3.1e-5)}
)
EFFECTS: dict[str, tuple[float, tuple[str, ...]]] = {
    "none": (0.0, ()),
    "coulomb": (3.0, ("coulomb",)),
    "asymmetric_coulomb": (0.5, ("asymmetric_coulomb",)),
    "asymmetric_viscous": (2.0, ("asymmetric_viscous",)),
    "stribeck": (4.0, ("stribeck",)),
    "load_friction": (0.06, ("load_friction",)),
    "quadratic": (6.0, ("quadratic_drag",)),
    "hose": (2.0, ("hose_spring",)),
    "wave_gear": (1.0, ("harmonic_ripple", "cogging")),
    "cogging": (1.0, ("cogging",)),
    "unbalance": (2.0, ("unbalance", "payload")),
    "warm_up": (0.4, ("warm_up",)),
    "heating": (0.15, ("winding_heating",)),
    "brushes": (1.0, ("brush_drop",)),
    "current_gain": (0.03, ("current_gain", "gain")),
    "current_offset": (0.1, ("current_offset", "bias")),
    "encoder_turned": (0.01, ("encoder_offset",)),
    "speed_gain": (0.02, ("gain",)),
    "payload": (1.0, ("payload",)),
    "tilt": (0.02, ("base_tilt",)),
    "cable": (8.0, ("cable_force",)),
    "command_late": (0.02, ("delay",)),
    "soft_gear": (5e-5, ("elastic",)),
    "gear_error": (1e-4, ()),
    "rail": (0.4, ()),
    "wrist_coupling": (0.05, ()),
    "heavy_link": (0.1, ()),
}
"""Name -> size, and the names of the catalogue that are the same law; none: no catalogue has it.

Joint 1: asymmetric_viscous, quadratic [N.m s2/rad2], brushes [V], rail (its viscous friction
changes by this share with the sine of its angle). Joint 2: coulomb [N.m], stribeck, load_friction,
warm_up, heating (share of R that 5 A add in the long run), soft_gear [rad/(N.m)], gear_error (of
the link behind the motor [rad], twice per turn of the motor). Joint 3: asymmetric_coulomb (share of
4 N.m), wave_gear, current_offset. Joint 4: hose, encoder_turned. Joint 5: cogging, unbalance [N.m].
In no loop: current_gain, speed_gain of joint 2, current_offset. payload: [kg] on the flange. cable:
[N] from the flange to a point of the room. wrist_coupling: joint 6 is turned by joint 5 through
this share of its torque. heavy_link: the forearm has this much more mass.
"""
USUAL = {"stribeck": 0.1, "warm_up": 120.0, "heating": 60.0, "cogging": 60.0, "hose": 0.5}
SHAPES: dict[str, tuple[float, float]] = {
    "stribeck": (0.02, 0.4), "warm_up": (40.0, 600.0), "heating": (5.0, 500.0),
    "cogging": (6.0, 200.0), "wave_gear": (-np.pi, np.pi), "hose": (-1.0, 1.0),
    "unbalance": (-np.pi, np.pi), "tilt": (-np.pi, np.pi), "cable": (-np.pi, np.pi),
    "gear_error": (-np.pi, np.pi),
}  # fmt: skip
"""Name -> range of its shape: speed, time constant, cycles per turn, angle [rad]."""
WHOLE: tuple[str, ...] = ()
RUNS = (
    ("EX1", "identification", 20.0), ("EX2", "identification", 20.0),
    ("PP1", "identification", 20.0), ("SL1", "identification", 25.0),
    ("EX3", "validation", 20.0), ("PP2", "validation", 20.0), ("SL2", "validation", 25.0),
)  # fmt: skip
ON = (22.5, 71.7, 112.0, 156.4, 205.8, 246.0, 296.8)
"""[s] After power on at which the runs begin."""
MIDDLE = np.array([0.2, -1.3, 1.5, -0.9, -1.2, 0.3])


@dataclass(frozen=True)
class Run:
    """One run: set angles at the log's samples."""

    name: str
    purpose: str
    angles: Vector
    begun: float


def draw(
    random: np.random.Generator, effect: str = "none", factor: float = 1.0, *, wide: bool = False
) -> Bench:
    """An arm with parameters within the sheet's bounds; angles of a law are drawn anyway."""
    values = parameters(random, DECLARED)
    shape = drawn_form(random, SHAPES.get(effect, (0.0, 0.0)), wide=wide)
    return Bench(values, effect, factor * EFFECTS[effect][0], shape)


def _moves(random: np.random.Generator, times: Vector, shortest: float, longest: float) -> Vector:
    """From target to target with smooth starts and ends, and a rest at each."""
    angles = np.tile(MIDDLE + random.uniform(-0.3, 0.3, 6), (times.size, 1))
    here, at = angles[0].copy(), 1.0
    while at < times[-1]:
        span, rest = random.uniform(shortest, longest), random.uniform(0.3, 0.8)
        target = MIDDLE + random.uniform(-0.7, 0.7, 6)
        x = np.clip((times - at) / span, 0.0, 1.0)[:, None]
        angles = np.where(times[:, None] >= at, here + (target - here) * x**3 * (
            10 - 15 * x + 6 * x * x), angles)  # fmt: skip
        here, at = target, at + span + rest
    return angles


def runs(seed: int) -> list[Run]:
    """Excitation of all joints, fast and slow moves."""
    random = np.random.default_rng([seed, 2])
    found = []
    for (name, purpose, seconds), begun in zip(RUNS, ON, strict=True):
        times = np.arange(round(seconds / SAMPLE) + 1) * SAMPLE
        if name.startswith("EX"):
            pace = 2 * np.pi * random.uniform(0.08, 0.9, (6, 5))
            size = random.uniform(0.03, 0.14, (6, 5)) / (0.3 + pace / 4.0)
            waves = size * np.sin(pace * times[:, None, None] + random.uniform(0, 6.28, (6, 5)))
            rise = np.clip((times - 0.5) / 2.0, 0.0, 1.0)[:, None]
            angles = MIDDLE + random.uniform(-0.2, 0.2, 6) + rise**2 * (3 - 2 * rise) * waves.sum(2)
        else:
            angles = _moves(random, times, *((1.2, 2.2) if name.startswith("PP") else (5.0, 8.0)))
        found.append(Run(name, purpose, angles, begun))
    return found


def _cross(a: Vector, b: Vector) -> Vector:
    """Cross product of stacks of vectors, components first."""
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def _turned(frame: Vector, vector: Vector) -> Vector:
    """A fixed vector of a frame (3 x 3 x n) in axes of the table (3 x n)."""
    return np.asarray(np.einsum("ijn,j->in", frame, vector))


@dataclass(frozen=True)
class Links:
    """Where the links are, and what turns them: components first, arms last.

    Attributes:
        axes, origins: of the joints, (6, 3, n).
        centres, inertias: of the links, (6, 3, n) and (6, 3, 3, n).
        frames: of the links; the last one is the flange.
        flange: its place.
    """

    axes: Vector
    origins: Vector
    centres: Vector
    inertias: Vector
    frames: list[Vector]
    flange: Vector


def posed(q: Vector) -> Links:
    """The links at joint angles (6 x n)."""
    n = q.shape[1]
    frame, place = np.repeat(np.eye(3)[:, :, None], n, axis=2), np.zeros((3, n))
    axes, origins, centres, inertias, frames = [], [], [], [], []
    for k in range(6):
        axes.append(frame[:, 2])
        origins.append(place)
        c, s = np.cos(q[k]), np.sin(q[k])
        ca, sa = np.cos(ARM["alpha"][k]), np.sin(ARM["alpha"][k])
        x = frame[:, 0] * c + frame[:, 1] * s
        across = frame[:, 1] * c - frame[:, 0] * s
        place = place + ARM["d"][k] * frame[:, 2] + ARM["a"][k] * x
        frame = np.stack([x, across * ca + frame[:, 2] * sa, frame[:, 2] * ca - across * sa], 1)
        frames.append(frame)
        centres.append(place + _turned(frame, np.array(ARM["com_in_link_frame"][k])))
        own = np.array(ARM["inertia_diag_about_com_link_axes"][k])
        inertias.append(np.einsum("ian,a,jan->ijn", frame, own, frame))
    return Links(
        np.array(axes), np.array(origins), np.array(centres), np.array(inertias), frames, place
    )


def equations(
    links: Links, qd: Vector, mass: Vector, more: tuple[Vector, Vector], gravity: Vector
) -> tuple[Vector, Vector]:
    """Mass matrix (n, 6, 6), and torques (6, n) that hold the arm where nothing accelerates.

    Args:
        links: posed.
        qd: joint speeds.
        mass: of the links (6, n).
        more: mass (n) and place in the flange's frame (3, n) of a point on the flange.
        gravity: (3, n).
    """
    axes, origins = links.axes, links.origins
    extra, offset = more
    tip = links.flange + np.einsum("ijn,jn->in", links.frames[-1], offset)
    centres = np.concatenate([links.centres, tip[None]])
    masses = np.concatenate([mass, extra[None]])
    n = qd.shape[1]
    to = np.zeros((7, 6, 3, n))  # speed of a centre per joint speed
    for k in range(6):
        arms = centres[k:] - origins[k]
        a = axes[k]
        to[k:, k, 0] = a[1] * arms[:, 2] - a[2] * arms[:, 1]
        to[k:, k, 1] = a[2] * arms[:, 0] - a[0] * arms[:, 2]
        to[k:, k, 2] = a[0] * arms[:, 1] - a[1] * arms[:, 0]
    w, turn, a_p = np.zeros((3, n)), np.zeros((3, n)), np.zeros((3, n))
    pull, torque = np.zeros((7, 3, n)), np.zeros((6, 3, n))
    for k in range(6):
        spin = axes[k] * qd[k]
        turn = turn + _cross(w, spin)
        w = w + spin
        ends = [links.centres[k], origins[k + 1] if k < 5 else links.flange]
        if k == 5:
            ends.append(tip)
        found = []
        for end in ends:
            arm = end - origins[k]
            found.append(a_p + _cross(turn, arm) + _cross(w, _cross(w, arm)))
        pull[k] = masses[k] * (found[0] - gravity)
        a_p = found[1]
        if k == 5:
            pull[6] = masses[6] * (found[2] - gravity)
        momentum = np.einsum("ijn,jn->in", links.inertias[k], w)
        torque[k] = np.einsum("ijn,jn->in", links.inertias[k], turn) + _cross(w, momentum)
    bias = np.einsum("lkin,lin->kn", to, pull)
    matrix = np.einsum("ln,lkin,lmin->nkm", masses, to, to, optimize=True)
    for k in range(6):  # links k and after turn with joint k
        about = np.einsum("lijn,jn->lin", links.inertias[k:], axes[k])
        torques = torque[k:].sum(axis=0)
        bias[k] += (axes[k] * torques).sum(axis=0)
        for j in range(6):
            if j <= k:
                value = (axes[j] * about.sum(axis=0)).sum(axis=0)
                matrix[:, k, j] += value
                if j < k:
                    matrix[:, j, k] += value
    return matrix, bias


def simulate(benches: list[Bench], chosen: list[Run], seconds: float) -> dict[str, Vector]:
    """All channels at 125 Hz, without noise: name -> (times, runs x benches).

    A run that ends earlier stays at its last set angles.
    """
    count = len(benches)
    n = count * len(chosen)

    def of(name: str) -> Vector:
        return np.tile([b.of(name) for b in benches], len(chosen))

    def form(name: str) -> Vector:
        return np.tile([b.form(name, USUAL) for b in benches], len(chosen))

    def joint(which: int, values: Vector) -> Vector:
        found = np.zeros((6, n))
        found[which - 1] = values
        return found

    def own(names: list[str]) -> Vector:
        return np.array([np.tile([b.parameters[k] for b in benches], len(chosen)) for k in names])

    def fixed(name: str) -> Vector:
        return np.array(ARM[name], dtype=float)[:, None]

    eta, b = own([f"eta_{k}" for k in range(1, 7)]), own([f"b_{k}" for k in range(1, 7)])
    rotor = RATIO**2 * own(ROTORS)
    samples = round(seconds / SAMPLE)
    last = np.arange(samples + 2)
    angles = np.stack([r.angles[np.minimum(last, len(r.angles) - 1)] for r in chosen])
    which = np.repeat(np.arange(len(chosen)), count)
    begun = np.repeat([r.begun for r in chosen], count)

    coulomb = joint(2, of("coulomb"))
    lopsided = joint(3, of("asymmetric_coulomb"))
    leaning = joint(1, of("asymmetric_viscous"))
    sticky, over = joint(2, of("stribeck")), joint(2, form("stribeck")) + 1e-9
    loaded, drag = joint(2, of("load_friction")), joint(1, of("quadratic"))
    hose, free = joint(4, of("hose")), joint(4, MIDDLE[3] + form("hose"))
    wave, phase = joint(3, of("wave_gear")), joint(3, form("wave_gear"))
    teeth, cycles = joint(5, of("cogging")), joint(5, form("cogging"))
    heavy, side = joint(5, of("unbalance")), joint(5, form("unbalance"))
    cold, warming = joint(2, of("warm_up")), joint(2, form("warm_up")) + 1e-9
    rise, slow = joint(2, of("heating")), form("heating")
    brushes = joint(1, of("brushes"))
    gain, offset = joint(2, of("current_gain")), joint(3, of("current_offset"))
    turned, speed_gain = joint(4, of("encoder_turned")), joint(2, of("speed_gain"))
    soft, uneven = joint(2, of("soft_gear")), joint(2, of("gear_error"))
    uneven_at, rail = joint(2, form("gear_error")), joint(1, of("rail"))
    coupled, late = of("wrist_coupling"), of("command_late")
    flexible = soft > 0.0
    stiff = np.where(flexible, 1.0 / np.where(flexible, soft, 1.0), 0.0)
    mass = np.repeat(fixed("mass"), n, axis=1)
    mass[2] *= 1.0 + of("heavy_link")
    more = of("payload"), np.repeat(np.array([[0.02], [-0.03], [0.06]]), n, axis=1)
    lean, towards = of("tilt"), form("tilt")
    gravity = GRAVITY * np.stack(
        [-np.sin(lean) * np.sin(towards), np.sin(lean) * np.cos(towards), -np.cos(lean)]
    )
    rope, direction = of("cable"), form("cable")
    anchor = np.stack([1.5 * np.cos(direction), 1.5 * np.sin(direction), 1.2 + 0 * direction])

    resistance, k_t = np.repeat(fixed("R"), n, axis=1), fixed("K_t")
    share = TICK * resistance / fixed("L")
    fade, see = np.exp(-share), np.exp(-TICK * SENSOR)
    lag = SENSOR / (SENSOR - share / TICK)
    q = np.ascontiguousarray(angles[which, 0].T)
    motor, qd, spin = q.copy(), np.zeros((6, n)), np.zeros((6, n))
    current, shown, memory, heat = (np.zeros((6, n)) for _ in range(4))
    hold = round(HOLD / TICK)
    per = round(SAMPLE / TICK)
    kept = []
    for step in range(-hold, samples * per + 1):
        if step >= 0 and step % per == 0:
            kept.append(np.stack([motor + turned, spin * (1 + speed_gain),
                                  shown * (1 + gain) + offset]))  # fmt: skip
        # set angles between the samples, later where commands are
        when = np.maximum(step * TICK - late, 0.0) / SAMPLE
        low = when.astype(int)
        here, there = angles[which, low].T, angles[which, low + 1].T
        moving = (step * TICK - late) >= 0.0
        wanted = here + (there - here) * (when - low)
        pace = np.where(moving, (there - here) / SAMPLE, 0.0)
        error = wanted - motor - turned
        volts = fixed("Kp") * error + memory + fixed("Kd") * (pace - spin)
        volts = np.clip(volts, -48.0, 48.0)
        memory = memory + fixed("Ki") * error * TICK
        # currents over the tick, their mean, and what the sensor shows
        r = resistance * (1.0 + heat)
        settled = _balanced(volts - k_t * RATIO * spin, r, brushes)
        gap = current - settled
        mean = settled + gap * (1 - fade) / share
        shown = settled + (shown - settled - lag * gap) * see + lag * gap * fade
        current = settled + gap * fade
        heat = heat + TICK / slow * (rise * (1.0 + heat) * current**2 / 25.0 - heat)
        # torques at the joints
        given = RATIO * eta * k_t * mean
        sign = np.tanh(spin / 0.01)
        viscous = b * (1 + cold * np.exp(-(begun + step * TICK) / warming))
        viscous = viscous * (1 + rail * np.sin(motor))
        lost = viscous * spin + coulomb * sign + leaning * (spin - np.abs(spin))
        lost = lost + 4.0 * (lopsided != 0) * (sign + lopsided * np.abs(sign))
        lost = lost + sticky * np.exp(-((spin / over) ** 2)) * sign
        lost = lost + loaded * np.abs(given) * sign + drag * spin * np.abs(spin)
        given = given - lost - hose * (motor - free)
        given = given - wave * np.sin(2 * RATIO * motor + phase)
        given = given - teeth * np.sin(cycles * motor) - heavy * np.sin(motor + side)
        given[5] += coupled * given[4]
        # links
        links = posed(q)
        matrix, bias = equations(links, qd, mass, more, gravity)
        if rope.any():
            away = anchor - links.flange
            force = rope * away / np.sqrt((away**2).sum(axis=0) + 1e-4)
            for k in range(6):
                lever = _cross(links.axes[k], links.flange - links.origins[k])
                bias[k] -= (lever * force).sum(axis=0)
        behind = motor - q - uneven * np.sin(2 * RATIO * motor + uneven_at)
        sprung = stiff * behind + 2e-3 * stiff * (spin - qd)
        matrix[:, range(6), range(6)] += np.where(flexible, 0.0, rotor).T
        pushed = np.where(flexible, sprung, given) - bias
        qdd = np.linalg.solve(matrix, pushed.T[:, :, None])[:, :, 0].T
        qd = qd + TICK * qdd
        spin = np.where(flexible, spin + TICK * (given - sprung) / rotor, qd)
        motor = motor + TICK * spin
        q = np.where(
            flexible, q + TICK * qd, motor - uneven * np.sin(2 * RATIO * motor + uneven_at)
        )
    table = np.array(kept)
    return {
        f"{name}_{k + 1}": table[:, place, k]
        for place, name in enumerate(SIGMA) for k in range(6)
    }  # fmt: skip


def _balanced(volts: Vector, resistance: Vector, drop: Vector) -> Vector:
    """Currents at which the voltages balance, r i + drop tanh(i / 0.1 A) = u, by Newton's method.

    From 0 on it cannot pass the solution, since tanh bends towards 0.
    """
    if not drop.any():
        return volts / resistance
    found = np.zeros(volts.shape)
    for _ in range(12):  # the last ones change nothing that a float holds
        bent = np.tanh(found / 0.1)
        missing = volts - resistance * found - drop * bent
        found = found + missing / (resistance + drop * (1.0 - bent**2) / 0.1)
    return found


def changes(benches: list[Bench], seed: int, seconds: float) -> list[dict[str, dict[str, Vector]]]:
    """What each arm's effects change, without noise: run -> channel -> values."""
    twins = [Bench(bench.parameters) for bench in benches]
    chosen = runs(seed)
    values = simulate([*benches, *twins], chosen, seconds)
    return beside(values, [(run.name, len(run.angles)) for run in chosen], len(benches))


def write_sets(
    folder: Path, benches: list[Bench], sheet: Path, seed: int, seconds: float
) -> list[Path]:
    """Write one data set per arm, with the sheet's noise; return their folders."""
    random = np.random.default_rng([seed, 1])
    chosen = runs(seed)
    values = simulate(benches, chosen, seconds)
    numbers = range(1, 7)
    names = [f"{kind}_{k}" for kind in ("q_set", *SIGMA) for k in numbers]
    places = []
    for column, _ in enumerate(benches):
        logged = []
        for k, run in enumerate(chosen):
            rows = min(len(run.angles), round(seconds / SAMPLE) + 1)
            table: dict[str, Any] = {"time": np.arange(rows) * SAMPLE}
            table |= {f"q_set_{j}": run.angles[:rows, j - 1] for j in numbers}
            for name in names[6:]:
                clean = values[name][:rows, k * len(benches) + column]
                sigma = SIGMA[name.rpartition("_")[0]]
                table[name] = clean + sigma * random.standard_normal(rows)
            entries = {"started_s_after_power_on": run.begun}
            logged.append(Logged(run.name, run.purpose, table, entries))
        places.append(write_set(folder / f"{RIG}_{column:03d}", RIG, sheet, 125, logged))
    return places
