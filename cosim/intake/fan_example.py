"""A fan that somebody wrote with pythonfmu, on a motor of ours, with logs of the bench.

The logs are integrated here, step by step: no FMU is in them. What the real fan, motor or sensors
have beyond the models is said by `Hidden`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import copysign, exp, tanh
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..files import make_folder, write_text

Vector = NDArray[np.float64]
R_A, L_A, K_T, J, FAN = 1.2, 2e-3, 0.05, 3e-4, 4e-6
"""Of the bench [ohm, H, N.m/A, kg.m2, N.m.s2/rad2]."""
PERIOD, FINE = 0.01, 20
"""Interval of the logs [s], and steps of the integration within it."""
NOISE = (0.3, 0.015, 1.5e-3)
"""Of speed, current and torque of the fan [rad/s, A, N.m]."""


@dataclass(frozen=True)
class Hidden:
    """What the bench has and its models have not; nothing by default.

    Attributes:
        fan_viscous, fan_coulomb: drag inside the fan, against the speed [N.m.s/rad], dry [N.m].
        motor_coulomb: dry friction of the motor's shaft [N.m].
        brush_drop: voltage that is lost at the motor's brushes [V].
        torque_gain: error of the torque sensor [1].
        torque_delay: by which the torque sensor is late [s], whole intervals of the log.
        fan_stall: torque that the fan lacks around 120 rad/s, where its flow leaves the blades: a
            law of no catalogue [N.m].
    """

    fan_viscous: float = 0.0
    fan_coulomb: float = 0.0
    motor_coulomb: float = 0.0
    brush_drop: float = 0.0
    torque_gain: float = 0.0
    torque_delay: float = 0.0
    fan_stall: float = 0.0


def voltage(seed: int, duration: float) -> Vector:
    """Steps of half a second and ramps between them [V], both ways of turning."""
    chance = np.random.default_rng(1000 + seed)
    count = round(duration / PERIOD)
    levels = chance.uniform(-12.0, 12.0, count // 50 + 2)
    levels[0] = 0.0
    held = np.repeat(levels, 50)[:count]
    sloped = np.interp(np.arange(count), 50 * np.arange(levels.size), levels)
    return np.where((np.arange(count) // 100) % 2 == 0, held, sloped)


def bench(seed: int, hidden: Hidden = Hidden(), duration: float = 6.0) -> Vector:
    """A run: time, voltage, speed, current and torque of the fan, with noise.

    Args:
        seed: of voltage and noise.
        hidden: what the models lack.
        duration: [s].
    """
    volts = voltage(seed, duration)
    count, h = volts.size, PERIOD / FINE
    rows = np.zeros((count, 5))
    rows[:, 0], rows[:, 1] = PERIOD * np.arange(count), volts

    def fan(w: float) -> float:
        drag = FAN * abs(w) * w + hidden.fan_viscous * w + hidden.fan_coulomb * tanh(w / 0.05)
        stall = exp(-(((abs(w) - 120.0) / 20.0) ** 2)) if hidden.fan_stall else 0.0
        return copysign(hidden.fan_stall * stall, w) - drag

    def rates(i: float, w: float, u: float) -> tuple[float, float]:
        rest = u - hidden.brush_drop * tanh(i / 0.1) - R_A * i - K_T * w
        tau = K_T * i - hidden.motor_coulomb * tanh(w / 0.05)
        return rest / L_A, (tau + fan(w)) / J

    i = w = 0.0
    for k, u in enumerate(volts.tolist()):
        rows[k, 2:] = w, i, fan(w)
        for _ in range(FINE):
            a, b = rates(i, w, u)
            c, d = rates(i + 0.5 * h * a, w + 0.5 * h * b, u)
            e, f = rates(i + 0.5 * h * c, w + 0.5 * h * d, u)
            g, m = rates(i + h * e, w + h * f, u)
            i += h / 6.0 * (a + 2.0 * c + 2.0 * e + g)
            w += h / 6.0 * (b + 2.0 * d + 2.0 * f + m)
    late = round(hidden.torque_delay / PERIOD)
    rows[:, 4] = (1.0 + hidden.torque_gain) * rows[np.maximum(np.arange(count) - late, 0), 4]
    rows[:, 2:] += np.random.default_rng(seed).normal(0.0, NOISE, (count, 3))
    return rows


FAN_SOURCE = '''"""A fan: takes the speed of its shaft, gives the torque on it."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Fan(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.w = 0.0
        self.tau = 0.0
        self.k = 5e-6
        self.register_variable(Real("w", causality=Fmi2Causality.input))
        self.register_variable(Real("tau", causality=Fmi2Causality.output))
        self.register_variable(
            Real("k", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable)
        )

    def do_step(self, current_time, step_size):
        self.tau = -self.k * self.w * abs(self.w)
        return True
'''
SYSTEM = """description = "A motor drives a fan whose FMU somebody else wrote."
connections = [
    "motor.tau -> rotor.tau_a",
    "fan.tau -> rotor.tau_b",
    "rotor.w -> motor.w",
    "rotor.w -> fan.w",
]

[instances]
motor = "bare_motor/winding"
rotor = "rotor/rigid"
fan = "Fan.fmu"

[parameters]
"motor.K_t" = 0.05
"motor.R_a" = 1.2
"motor.L_a" = 0.002
"rotor.J" = 0.0003
"fan.k" = 5e-6
"""
DATASET = """system = "bench.toml"
step = 0.002
algorithm = "gauss_seidel"
time = "t"

[columns]
t = { unit = "s" }
voltage = { unit = "V" }
speed = { unit = "rad/s" }
current = { unit = "A" }
torque = { unit = "N.m" }

[inputs]
"motor.u_set" = { column = "voltage", interpolation = "hold" }

[channels.speed]
signal = "rotor.w"
sigma = 0.3

[channels.current]
signal = "motor.i"
sigma = 0.015

[channels.torque]
signal = "fan.tau"
sigma = 0.0015

[[parameter]]
name = "k"
unit = "N.m.s2/rad2"
nominal = 5e-6
min = 1e-6
max = 2e-5
targets = "fan.k"

[[parameter]]
name = "J"
unit = "kg.m2"
nominal = 2.5e-4
min = 1e-4
max = 1e-3
targets = "rotor.J"

[[parameter]]
name = "R_a"
unit = "ohm"
nominal = 1.1
min = 0.5
max = 2.5
targets = "motor.R_a"
"""
PURPOSES = ("identification",) * 3 + ("validation",) * 2
"""Of the runs."""


def write(
    folder: Path,
    hidden: Hidden = Hidden(fan_viscous=1e-4),
    *,
    seed: int = 0,
    duration: float = 6.0,
    purposes: Sequence[str] = PURPOSES,
) -> None:
    """Write the example: `fan.py`, `bench.toml`, `dataset.toml` and the logs.

    Args:
        folder: where.
        hidden: what the logs have and the models have not.
        seed: of the first run.
        duration: of each run [s].
        purposes: of the runs.
    """
    make_folder(folder)
    write_text(folder / "fan.py", FAN_SOURCE)
    write_text(folder / "bench.toml", SYSTEM)
    table = DATASET
    for number, purpose in enumerate(purposes):
        name = f"run_{number + 1}"
        lines = ["t,voltage,speed,current,torque"]
        rows = bench(seed + number, hidden, duration)
        lines += [",".join(f"{v:.7g}" for v in row) for row in rows]
        write_text(folder / f"{name}.csv", "\n".join(lines) + "\n")
        table += f'\n[[run]]\nname = "{name}"\nfile = "{name}.csv"\npurpose = "{purpose}"\n'
    write_text(folder / "dataset.toml", table)
