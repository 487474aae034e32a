"""Data sets of the papers' machines: what their plants do, with the noise of what measured it.

A set holds the commands, poses and velocities only, as the papers measured. Its mapping is the
`dataset.toml` of the rig among the scenarios.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import UnknownNameError, listing
from ...files import make_folder, write_text, writing
from . import mobile_manipulator as manipulator
from . import omni_base as omni

Vector = NDArray[np.float64]
PERIOD = 0.02
"""Of all logs [s]."""
ACCELERATION = 0.4
"""Of the base between two speeds [m/s2]: below what its motors allow."""
VOLUME = (-0.5, 4.5, -2.5, 3.2)
"""[m] x and y between which the cameras see the tool."""
SIGNALS = {
    "v_set": ("m/s", 0.0, "commanded forward speed, linear between samples"),
    "w_set": ("rad/s", 0.0, "commanded yaw rate, linear between samples"),
    "x": ("m", 5e-4, "position, motion capture"),
    "y": ("m", 5e-4, "position, motion capture"),
    "phi": ("rad", 1e-3, "heading, motion capture"),
    "theta": ("rad", 1e-3, "heading, motion capture"),
    "v": ("m/s", 5e-3, "forward speed, interface of the base"),
    "w_z": ("rad/s", 5e-3, "yaw rate, interface of the base"),
    "tool_x": ("m", 5e-4, "position of the tool, motion capture"),
    "tool_y": ("m", 5e-4, "position of the tool, motion capture"),
    "tool_z": ("m", 5e-4, "position of the tool, motion capture"),
    "q_set": ("rad", 0.0, "set angle of a joint, linear between samples"),
    "qd": ("rad/s", 2e-3, "speed of a joint, interface of the arm"),
    "tau_beta": ("N.m", 0.0, "torque of a steering motor, linear between samples"),
    "tau_phi": ("N.m", 0.0, "torque of a rolling motor, linear between samples"),
    "beta": ("rad", 1e-3, "steering angle, encoder"),
}
"""Column -> unit, noise, and what it is; columns that are counted have the entry of all."""


@dataclass(frozen=True)
class Kind:
    """What can be made of a machine.

    Attributes:
        rig: of its mapping.
        about: in a line.
        runs: gives name, purpose and columns of each run.
    """

    rig: str
    about: str
    runs: Callable[[], Iterator[tuple[str, str, dict[str, Vector]]]]


# -- mobile manipulator ----------------------------------------------------------------------------

TRUE_MACHINE = manipulator.Machine(
    grip=0.52, sliding=0.40, ki_speed=4.5, kp_speed=1.1, rotor=1.5e-4
)
"""What the logs are made with; the model's first guess is another."""
PATHS = {
    "IN1": (0.3, 0.02, 10.0, "identification"),
    "IN2": (0.8, -0.015, 6.0, "identification"),
    "CN1": (0.4, 0.5, 10.0, "identification"),
    "CN2": (0.5, -0.4, 8.0, "validation"),
    "IY": (0.3, 0.02, 12.0, "validation"),
    "CY": (0.4, 0.5, 12.0, "validation"),
}
"""Speed [m/s], curvature [1/m], time of motion [s] and purpose of the paper's runs."""
SWING, SWING_F, SWING_FROM, SWING_FOR, SWING_RAMP = 0.3, 0.4, 2.0, 10.0, 1.0
"""Of joint 1 in IY and CY [rad], [Hz], [s], [s], [s]."""


def _times(end: float) -> Vector:
    """Times of the samples until some time [s]."""
    return np.asarray(PERIOD * np.arange(round(end / PERIOD) + 1), dtype=np.float64)


def _path(name: str, *, swings: bool) -> manipulator.Command:
    """The command of a run: one second of rest, a trapezoid of speed, one second of rest."""
    speed, curvature, lasting, _ = PATHS[name]
    times = _times(lasting + 3.0)
    rising = ACCELERATION * (times - 1.0)
    falling = ACCELERATION * (1.0 + lasting + speed / ACCELERATION - times)
    v = np.round(np.clip(np.minimum(rising, falling), 0.0, speed), 9)
    pose = manipulator.STRETCHED if swings else manipulator.FOLDED
    joints = np.tile(np.array(pose), (times.size, 1))
    if swings:

        def smooth(s: Vector) -> Vector:
            s = np.clip(s, 0.0, 1.0)
            return np.asarray(s**3 * (10.0 - 15.0 * s + 6.0 * s * s))

        faded = smooth((times - SWING_FROM) / SWING_RAMP)
        faded = faded * smooth((SWING_FROM + SWING_FOR - times) / SWING_RAMP)
        joints[:, 0] += SWING * faded * np.sin(2.0 * np.pi * SWING_F * (times - SWING_FROM))
    return manipulator.Command(times, v, curvature * v, joints)


def _base_runs() -> Iterator[tuple[str, str, dict[str, Vector]]]:
    for name in ("IN1", "IN2", "CN1", "CN2"):
        command = _path(name, swings=False)
        found = manipulator.simulate(TRUE_MACHINE, command)
        seen = {key: found[key] for key in ("x", "y", "phi", "v", "w_z")}
        sent = {"time": command.times, "v_set": command.speed, "w_set": command.rate}
        yield name, PATHS[name][3], sent | seen


def _arm_runs() -> Iterator[tuple[str, str, dict[str, Vector]]]:
    for name, (_, _, _, purpose) in PATHS.items():
        command = _path(name, swings=name.endswith("Y"))
        found = manipulator.simulate(TRUE_MACHINE, command, arm=True, pose=command.joints[0])
        low_x, high_x, low_y, high_y = VOLUME
        x, y = found["tool_x"], found["tool_y"]
        outside = (x < low_x) | (x > high_x) | (y < low_y) | (y > high_y)
        for key in ("tool_x", "tool_y", "tool_z"):
            found[key] = np.where(outside, np.nan, found[key])
        sent = {"time": command.times, "v_set": command.speed, "w_set": command.rate}
        sent |= {f"q_set_{i + 1}": command.joints[:, i] for i in range(6)}
        yield name, purpose, sent | found


# -- omnidirectional base --------------------------------------------------------------------------

TRUE_BASE = omni.Machine(f_s=4.3, f_v=1.8, m_p=232.0, I_p=20.0, M_pa=3.0, K=1.4)
"""What the logs are made with; the model's first guess is another."""
MOVES = {
    "straight": ((1.5, 0.0, 0.0), 5.0, "identification"),
    "turn": ((0.0, 0.0, 2.0), 5.0, "identification"),
    "sideways": ((0.6, 1.2, -0.8), 5.0, "identification"),
    "arc": ((1.5, 0.5, 1.0), 5.0, "validation"),
}
"""Move [m, m, rad], its time [s] and purpose."""


def _omni_runs() -> Iterator[tuple[str, str, dict[str, Vector]]]:
    for name, (move, lasting, purpose) in MOVES.items():
        times = _times(lasting + 2.0)
        torques = omni.torques(omni.Machine(M_pa=3.0, K=1.0), times, move, 1.0, lasting)
        found = omni.simulate(TRUE_BASE, times, torques)
        sent = {"time": times}
        for i in range(3):
            sent |= {f"tau_beta_{i + 1}": torques[:, i], f"tau_phi_{i + 1}": torques[:, 3 + i]}
        yield name, purpose, sent | found


KINDS = {
    "mir250": Kind(
        "mir250_poses", "Made by a plant of its own.",
        _base_runs,
    ),
    "mobile_manipulator": Kind(
        "mobile_manipulator_poses",
        "Made by a plant of its own.", _arm_runs,
    ),
    "omni_base": Kind(
        "omni_base_poses", "Made by a plant of its own.",
        _omni_runs,
    ),
}  # fmt: skip
"""Machines by name."""


def write(machine: str, folder: Path, *, seed: int = 0) -> None:
    """Write the logs of a machine: `set.toml`, its sheet and one npz file per run.

    Args:
        machine: one of `KINDS`.
        folder: where; its name is that of the set.
        seed: of the noise.

    Raises:
        UnknownNameError: no such machine.
        InputError: the folder cannot be written.
    """
    if machine not in KINDS:
        raise UnknownNameError(f"there is no machine {machine!r}; {listing(KINDS, machine)}")
    kind = KINDS[machine]
    chance = np.random.default_rng(seed)
    make_folder(folder / "runs")
    listed: list[str] = []
    entries = ""
    for name, purpose, columns in kind.runs():
        listed = list(columns)
        path = folder / "runs" / f"{name}.npz"
        with writing(path):
            np.savez_compressed(path, **_measured(columns, chance))  # type: ignore[arg-type]
        entries += f'\n[[run]]\nname = "{name}"\nfile = "runs/{name}.npz"\npurpose = "{purpose}"\n'
    names = ", ".join(f'"{name}"' for name in listed)
    write_text(
        folder / "set.toml",
        f'rig = "{kind.rig}"\nset = "{folder.resolve().name}"\ndescription = "{kind.about}"\n'
        f'sheet = "signals.toml"\nsample_rate_hz = {1.0 / PERIOD:g}\ncolumns = [{names}]\n'
        + entries,
    )
    write_text(folder / "signals.toml", _sheet(listed))


def entry(column: str) -> tuple[str, float, str]:
    """Unit, noise and meaning of a column.

    Raises:
        KeyError: it is none of the machines'.
    """
    if column == "time":
        return "s", 0.0, "sample time"
    return SIGNALS.get(column) or SIGNALS[column.rpartition("_")[0]]


def _measured(
    columns: Mapping[str, Vector], chance: np.random.Generator
) -> dict[str, NDArray[Any]]:
    """Columns as they are logged: with noise in single precision, commands as they are."""
    logged: dict[str, NDArray[Any]] = {}
    for name, values in columns.items():
        noise = entry(name)[1]
        seen = values + noise * chance.standard_normal(values.size)
        logged[name] = seen.astype(np.float32) if noise else values
    return logged


def _sheet(columns: list[str]) -> str:
    """The sheet: unit and noise of each column."""
    text = 'units = "SI"\n'
    for name in columns:
        unit, noise, about = entry(name)
        text += f'\n[[signal]]\nname = "{name}"\nunit = "{unit}"\nnoise_sigma = {noise!r}\n'
        text += f'description = "{about}"\n'
    return text
