"""A motor bench written from its rig sheet alone, to make data sets with undeclared effects.

It shares no code with the components that are to explain its data: one loop over the ticks of the
current controller, many benches at once as arrays, effects written down here once more. What it
shares is how the shaft moves between ticks, which the sheet does not say: in four parts, the
current at the start of each drives the shaft, whose new speed moves the angle. That is a lead of
12.5 us against a shaft that moves continuously; it is worth a tenth of the noise over a run, and
parameters would be found with a bias of one or two of their tiny deviations. That would test
ticks, not laws.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from benchmarks.bench import Bench, Logged, parameters, write_set

Vector = NDArray[np.float64]
TICK = 5e-5
PARTS = 4  # of a tick, as the laboratory's logs of this rig are told best
PART = TICK / PARTS
COUNT = 2 * np.pi / 65536  # of the encoder [rad]
K_PLAY, D_TWIST = 2e4, 1.5  # of the spring beside a gap, and of any spring [SI, output]
RATIO, L_A, J_ROTOR, U_MAX, I_MAX, KP_I, KI_I = 10.167, 4e-4, 1.6e-4, 48.0, 30.0, 0.80, 560.0
DECLARED = {
    "R_a": (0.338, 0.362), "K_t": (0.0915, 0.0985), "eta": (0.78, 0.86), "b": (0.02, 0.12),
    "J_load": (0.065, 0.1), "Kp_v": (0.32, 0.5), "Ki_v": (2.8, 5.6), "acc_max": (1200.0, 1900.0),
}  # fmt: skip
EFFECTS: dict[str, tuple[float, tuple[str, ...]]] = {
    "none": (0.0, ()),
    "coulomb": (0.8, ("coulomb",)),
    "stribeck": (0.8, ("stribeck",)),
    "quadratic_drag": (1e-3, ("quadratic_drag",)),
    "unbalance": (0.5, ("unbalance",)),
    "hose_spring": (0.02, ("hose_spring",)),
    "load_friction": (0.06, ("load_friction",)),
    "supply_sag": (0.15, ("battery_sag",)),
    "winding_heating": (2.0, ("winding_heating",)),
    "saturation": (0.2, ("torque_constant_saturation",)),
    "brush_drop": (0.5, ("brush_drop",)),
    "current_offset": (0.25, ("bias", "current_offset")),
    "current_gain": (0.03, ("gain", "current_gain")),
    "command_delay": (8e-3, ("delay",)),
    "elastic_gear": (1e-3, ("elastic",)),
    "backlash": (4e-3, ("backlash",)),
    "cogging": (0.02, ("cogging",)),
    "torque_ripple": (0.05, ("torque_ripple",)),
}
"""Name -> size, and the names of the catalogue that are the same law."""
CONTAINED = {"elastic_gear": "backlash"}
"""Law -> law that contains it: what yields besides play is the stiffness of the play's contact."""
USUAL = {"winding_heating": 60.0, "stribeck": 0.5, "command_delay": 1.0, "cogging": 12.0,
         "torque_ripple": 12.0}  # fmt: skip
"""Name -> shape: time constant [s], Stribeck speed [rad/s, output], factor on the delay, cycles per
turn of the motor."""
SHAPES: dict[str, tuple[float, float]] = {
    "winding_heating": (0.5, 1000.0), "stribeck": (0.02, 10.0), "command_delay": (0.5, 40.0),
    "cogging": (1.0, 200.0), "torque_ripple": (1.0, 200.0),
}  # fmt: skip
"""Name -> range of its shape; whole numbers for cycles per turn."""
WHOLE = ("cogging", "torque_ripple")
SHEET = Path(__file__).parents[1] / "scenarios/motor_bench/data/motor_bench.toml"
SECONDS = 5.0


def draw(
    random: np.random.Generator, effect: str = "none", factor: float = 1.0, *, wide: bool = False
) -> Bench:
    """A bench with parameters within the sheet's bounds.

    Args:
        random: source of numbers.
        effect: of `EFFECTS`.
        factor: on its size.
        wide: its shape is log-uniform over its range, not the usual one.
    """
    values = parameters(random, DECLARED)
    shape = 0.0
    if wide and effect in SHAPES:
        shape = float(np.exp(random.uniform(*np.log(SHAPES[effect]))))
        shape = float(round(shape)) if effect in WHOLE else shape
    return Bench(values, effect, factor * EFFECTS[effect][0], shape=shape)


def commands(random: np.random.Generator, seconds: float) -> dict[str, tuple[str, Vector]]:
    """Set speeds of the motor shaft at 1 kHz: run -> (purpose, values)."""
    t = np.arange(0.0, seconds, 1e-3)

    def levels(values: list[float], count: int) -> Vector:
        index = np.minimum((t / seconds * count).astype(int), count - 1)
        return np.array([0.0, *values])[index]

    def sines(amplitude: float, lowest: float) -> Vector:
        phases = random.uniform(0.0, 2.0 * np.pi, 6)
        rates = lowest * np.array([1.0, 1.7, 2.9, 5.3, 9.1, 13.0])
        parts = np.sin(2 * np.pi * rates * t[:, None] + phases) / np.arange(1, 7)
        ramp = np.minimum(t / 0.3, 1.0)
        return np.asarray(amplitude * ramp * parts.sum(axis=1))

    slow = 15.0 * np.sin(2 * np.pi * t * 2.0 / seconds)
    return {
        "ST": ("identification", levels([60.0, 60.0, -40.0, 150.0], 5)),
        "MS": ("identification", sines(70.0, 0.4)),
        "RV": ("identification", slow),
        "LV": ("identification", levels([20.0, 90.0, 180.0, 300.0, 330.0], 6)),
        "MX": ("validation", sines(60.0, 0.5) + levels([40.0, -30.0], 3)),
        "LW": ("validation", levels([-30.0, -110.0, -220.0, -310.0], 5)),
    }


def clip(values: Vector, low: Vector | float, high: Vector | float) -> Vector:
    """As of numpy, which looks at its arguments for longer than a few benches take."""
    return cast(Vector, np.minimum(np.maximum(values, low), high))


def simulate(benches: list[Bench], w_ref: Vector, start_angle: Vector) -> dict[str, Vector]:
    """Speed, current, voltage and angle at 1 kHz, one column per bench, without noise.

    Args:
        benches: one per column; a bench may be there several times, with other commands.
        w_ref: set speeds at 1 kHz, one column per bench.
        start_angle: of each bench's motor shaft [rad].
    """

    def of(name: str) -> Vector:
        return np.array([b.parameters[name] for b in benches])

    def size(name: str) -> Vector:
        return np.array([b.of(name) for b in benches])

    def form(name: str) -> Vector:
        return np.array([b.form(name, USUAL) for b in benches])

    resistance, k_t, eta, b = of("R_a"), of("K_t"), of("eta"), of("b")
    kp, ki, acc = of("Kp_v"), of("Ki_v"), of("acc_max")
    rotor, load = np.full(len(benches), RATIO**2 * J_ROTOR), of("J_load")
    inertia = load + rotor
    gap, compliance = size("backlash"), size("elastic_gear")
    elastic = (gap > 0.0) | (compliance > 0.0)
    stiffness = np.where(
        compliance > 0.0, 1.0 / np.where(compliance > 0.0, compliance, 1.0), K_PLAY
    )
    coulomb, stribeck, drag = size("coulomb"), size("stribeck"), size("quadratic_drag")
    unbalance, hose, load_mu = size("unbalance"), size("hose_spring"), size("load_friction")
    sag, heating, saturation = size("supply_sag"), size("winding_heating"), size("saturation")
    drop, offset, gain = size("brush_drop"), size("current_offset"), size("current_gain")
    cogging, ripple = size("cogging"), size("torque_ripple")
    delay = np.rint(size("command_delay") * form("command_delay") / 1e-3).astype(int)
    t_th, w_s = form("winding_heating"), form("stribeck")
    n_cog, n_ripple = form("cogging"), form("torque_ripple")

    n = len(benches)
    i, heat = np.zeros(n), np.zeros(n)
    w, w_out = np.zeros(n), np.zeros(n)
    angle = start_angle / RATIO
    column = np.arange(n)
    angle_out = angle.copy()
    speed_integral, current_integral = np.zeros(n), np.zeros(n)
    w_set, i_set, u = np.zeros(n), np.zeros(n), np.zeros(n)
    rows: dict[str, list[Vector]] = {k: [] for k in ("speed", "current", "voltage", "angle")}
    last = RATIO * angle

    efficient, gained = RATIO * eta, 1 + gain
    # what no bench has is not computed: it would add zeros
    has = {
        name: bool(np.any(values))
        for name, values in {
            "saturation": saturation, "ripple": ripple, "heating": heating, "sag": sag,
            "drop": drop, "cogging": cogging, "drag": drag, "dry": np.abs(coulomb) + load_mu,
            "stribeck": stribeck, "unbalance": unbalance, "hose": hose, "elastic": elastic,
        }.items()
    }  # fmt: skip

    def torque_constant(i: Vector, angle: Vector) -> Vector:
        constant = k_t
        if has["saturation"]:
            constant = constant * (1 - saturation * i**2 / (i**2 + 20.0**2))
        if has["ripple"]:
            constant = constant * (1 + ripple * np.cos(n_ripple * RATIO * angle))
        return constant

    def warm() -> Vector:
        return resistance * (1 + 0.00393 * heating * heat) if has["heating"] else resistance

    def current_rate(i: Vector, w: Vector, constant: Vector) -> Vector:
        supply = u * (1 - sag * (u * i / 48.0) / 48.0) if has["sag"] else u
        volts = supply - warm() * i - constant * RATIO * w
        if has["drop"]:
            volts = volts - drop * np.tanh(i / 0.2)
        return cast(Vector, volts / L_A)

    def speed_rates(
        i: Vector, w: Vector, angle: Vector, w_out: Vector, angle_out: Vector, constant: Vector
    ) -> tuple[Vector, Vector]:
        torque = efficient * constant * i
        if has["cogging"]:
            torque = torque - RATIO * cogging * np.sin(n_cog * RATIO * angle + 0.7)
        friction = b * w_out
        if has["drag"]:
            friction = friction + drag * w_out * np.abs(w_out)
        if has["dry"] or has["stribeck"]:
            sign = np.tanh(w_out / 2e-3)
            friction = friction + (coulomb + load_mu * np.abs(torque)) * sign
            if has["stribeck"]:
                friction = friction + stribeck * np.exp(-((w_out / w_s) ** 2)) * sign
        springs: Vector | float = 0.0
        if has["unbalance"]:
            springs = unbalance * np.sin(angle_out)
        if has["hose"]:
            springs = springs + hose * angle_out
        together = (torque - friction - springs) / inertia
        if not has["elastic"]:
            return together, together
        twist = angle - angle_out
        pressed = twist - clip(twist, -gap / 2, gap / 2)
        touching = np.abs(twist) >= gap / 2
        through = touching * (stiffness * pressed + D_TWIST * (w - w_out))
        return (
            np.where(elastic, (torque - through) / rotor, together),
            np.where(elastic, (through - friction - springs) / load, together),
        )

    for tick in range(w_ref.shape[0] * 20):
        if tick % 20 == 0:
            rows["speed"].append((RATIO * angle - last) / 1e-3)
            rows["current"].append(i * gained + offset)
            rows["voltage"].append(u.copy())
            rows["angle"].append(RATIO * angle)
            last = RATIO * angle
        if tick % 10 == 0:
            command = w_ref[np.maximum(tick // 20 - delay, 0), column]
            w_set = w_set + clip(command - w_set, -acc * 5e-4, acc * 5e-4)
            error = w_set - RATIO * w
            wanted = kp * error + speed_integral
            free = np.abs(wanted) < I_MAX
            speed_integral = speed_integral + np.where(free, ki * error * 5e-4, 0.0)
            i_set = clip(wanted, -I_MAX, I_MAX)
        error = i_set - (i * gained + offset)
        wanted = KP_I * error + current_integral
        free = np.abs(wanted) < U_MAX
        current_integral = current_integral + np.where(free, KI_I * error * TICK, 0.0)
        u = clip(wanted, -U_MAX, U_MAX)
        for _ in range(PARTS):
            # all rates at the part's start; the current by the midpoint rule, its winding is fast
            constant = torque_constant(i, angle)
            w_rate, out_rate = speed_rates(i, w, angle, w_out, angle_out, constant)
            middle = i + 0.5 * PART * current_rate(i, w, constant)
            i = i + PART * current_rate(middle, w, torque_constant(middle, angle))
            w = w + PART * w_rate
            angle = angle + PART * w
            if has["elastic"]:
                w_out = w_out + PART * out_rate
                angle_out = angle_out + PART * w_out
            else:  # one shaft
                w_out, angle_out = w, angle
            if has["heating"]:
                heat = heat + PART * (warm() * i**2 - heat) / t_th
    return {name: np.array(values) for name, values in rows.items()}


@dataclass(frozen=True)
class Drive:
    """One run: what is commanded, and where the shaft starts."""

    name: str
    purpose: str
    w_ref: Vector
    start: float


def drives(seed: int, seconds: float, names: tuple[str, ...] = ()) -> list[Drive]:
    """The runs of a seed, all if no names are given."""
    random = np.random.default_rng(seed)
    found = commands(random, seconds)
    starts = random.uniform(0.0, 6.0, len(found))
    return [
        Drive(name, purpose, w_ref, float(start))
        for (name, (purpose, w_ref)), start in zip(found.items(), starts, strict=True)
        if not names or name in names
    ]


def driven(benches: list[Bench], runs: list[Drive]) -> list[dict[str, Vector]]:
    """What `simulate` gives for each run, all of them in one loop, which costs as much as one."""
    count = len(benches)
    found = simulate(
        benches * len(runs),
        np.repeat(np.column_stack([run.w_ref for run in runs]), count, axis=1),
        np.repeat([run.start for run in runs], count),
    )
    return [
        {name: values[:, k * count : (k + 1) * count] for name, values in found.items()}
        for k in range(len(runs))
    ]


def changes(benches: list[Bench], seed: int, seconds: float) -> list[dict[str, dict[str, Vector]]]:
    """What each bench's effect changes, without noise: run -> channel -> values."""
    twins = [Bench(bench.parameters) for bench in benches]
    found: list[dict[str, dict[str, Vector]]] = [{} for _ in benches]
    runs = drives(seed, seconds)
    for drive, values in zip(runs, driven([*benches, *twins], runs), strict=True):
        for column, entry in enumerate(found):
            entry[drive.name] = {
                channel: both[:, column] - both[:, column + len(benches)]
                for channel, both in values.items()
            }
    return found


def write_sets(
    folder: Path,
    benches: list[Bench],
    sheet: Path,
    seed: int,
    seconds: float = 5.0,
    names: tuple[str, ...] = (),
) -> list[Path]:
    """Write one data set per bench, with the sheet's noise and rounding; return their folders.

    Args:
        folder: data sets go into folders below it.
        benches: to simulate.
        sheet: the rig sheet.
        seed: of commands and noise.
        seconds: duration of the runs.
        names: of the runs, all if empty.
    """
    random = np.random.default_rng([seed, 1])
    logged: list[list[Logged]] = [[] for _ in benches]
    runs = drives(seed, seconds, names)
    for drive, clean in zip(runs, driven(benches, runs), strict=True):
        w_ref = drive.w_ref
        for column, of_bench in enumerate(logged):
            table: dict[str, Any] = {"time": np.arange(w_ref.size) * 1e-3, "speed_set": w_ref}
            for channel, sigma, quantum in (
                ("speed", 0.15, COUNT / 1e-3), ("current", 0.05, 0.0), ("voltage", 0.05, 0.0),
                ("angle", 0.005, 0.00153),
            ):  # fmt: skip
                values = clean[channel][:, column]
                if channel == "speed":  # differences of counts
                    counts = np.floor(clean["angle"][:, column] / COUNT)
                    values = np.diff(counts, prepend=counts[0]) * quantum
                elif quantum:
                    values = np.rint(values / quantum) * quantum
                table[channel] = values + sigma * random.standard_normal(values.size)
            entries = {"initial_motor_angle": drive.start, "initial_speed": 0.0}
            of_bench.append(Logged(drive.name, drive.purpose, table, entries))
    return [
        write_set(folder / f"bench_{number:03d}", "motor_bench", sheet, 1000, of_bench)
        for number, of_bench in enumerate(logged)
    ]
