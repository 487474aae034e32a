"""A folder for an arm of one's own: closed loop to run, inverse dynamics to identify."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import InputError, UnknownNameError, listing
from ..files import write_text
from ..installation.builder import naming_errors, sources
from ..spec import devices
from ..system.provider import Provider
from . import examples, templates
from .create import new_folder

NOISE = {"rad": 2e-6, "m": 2e-6, "rad/s": 1e-4, "m/s": 1e-4}
"""Of positions and speeds in example logs: encoders behind gears, speeds filtered by the drive."""
TORQUE_NOISE = 2e-3
"""Of torques in example logs, as a share of the largest."""
FINER = 2
"""As of `examples`; the servos' inputs are extrapolated, which leaves less to gain."""
LEAST = {"kg": 1.0, "kg.m": 0.5, "kg.m2": 0.3}
"""Half a range of a base parameter, at least."""


def write(
    name: str,
    folder: Path,
    device: str,
    given: Mapping[str, Any],
    provider: Provider,
    *,
    logs: bool,
) -> list[Path]:
    """Write system, scenario, identification, mapping and example logs; returns the files.

    Raises:
        UnknownNameError: no such device of one's own.
        InputError: see `create.new_folder`.
    """
    template = templates.read("arm", given)
    path = devices.find("serial_arm", device)
    if path is None:
        own = devices.own("serial_arm")
        raise UnknownNameError(
            f"--device {device!r}: no such arm in {', '.join(map(str, devices.folders()))}; "
            f"{listing(own, device)}; make one with 'cosim arm import robot.urdf'"
        )
    values = tomllib.loads(path.read_text(encoding="utf-8"))
    for key in ("prismatic", "tau_max", "J_rotor", "q_min", "q_max", "mass"):
        if "value" not in values.get(key, {}):
            raise InputError(f"{path}: has no [{key}]; make it again with 'cosim arm import'")
    blocks = _blocks(device, values, template.values["payload"])
    new_folder(name, folder)
    made = []
    for file, text in templates.texts(
        template, name, folder, blocks, (*templates.FILES, "identification.toml")
    ).items():
        write_text(folder / file, text)
        made.append(folder / file)
    if logs:
        made += examples.write_logs(
            folder, _log_columns(values), {}, {"arm.payload.mass": template.values["payload"]},
            provider, variants={"arm": "+payload"}, finer=FINER,
        )  # fmt: skip
    return made


def _units(values: Mapping[str, Any], turning: str, sliding: str) -> list[str]:
    return [sliding if flag else turning for flag in values["prismatic"]["value"]]


def _sigmas(values: Mapping[str, Any]) -> list[float]:
    """Noise of the torques: a share of the limits, of 100 N.m (or N) where there are none."""
    return [
        float(f"{TORQUE_NOISE * (limit if limit < 1e5 else 100.0):.3g}")
        for limit in values["tau_max"]["value"]
    ]


def _log_columns(values: Mapping[str, Any]) -> dict[str, tuple[str, float]]:
    columns: dict[str, tuple[str, float]] = {}
    kinds = (
        ("q", "arm.q", [NOISE[unit] for unit in _units(values, "rad", "m")]),
        ("qd", "arm.qd", [NOISE[unit] for unit in _units(values, "rad/s", "m/s")]),
        ("tau", "drive.tau_motor", _sigmas(values)),
    )
    for column, signal, noises in kinds:
        for k, noise in enumerate(noises):
            columns[f"{column}_{k + 1}"] = (f"{signal}[{k + 1}]", noise)
    return columns


def _blocks(device: str, values: Mapping[str, Any], payload: float) -> dict[str, str]:
    with naming_errors():
        base: list[dict[str, Any]] = sources("packaging.catalog").base_parameters(device)
    count = len(values["prismatic"]["value"])
    numbers = range(1, count + 1)
    positions, speeds = _units(values, "rad", "m"), _units(values, "rad/s", "m/s")
    torques, accelerations = _units(values, "N.m", "N"), _units(values, "rad/s2", "m/s2")
    columns = []
    for k in numbers:
        columns += [
            f'q_{k} = {{ source = "q_{k}", unit = "{positions[k - 1]}" }}',
            f'speed_{k} = {{ source = "qd_{k}", lowpass = 10.0, unit = "{speeds[k - 1]}" }}',
            f'acceleration_{k} = {{ source = "qd_{k}", lowpass = 10.0, derivative = true, '
            f'unit = "{accelerations[k - 1]}" }}',
            f'tau_{k} = {{ source = "tau_{k}", unit = "{torques[k - 1]}" }}',
        ]
    estimated = []
    for item in base:
        half = max(abs(item["value"]), LEAST[item["unit"]])
        estimated.append(
            f'[[parameter]]\nname = "{item["name"]}"\nunit = "{item["unit"]}"\n'
            f"nominal = {item['value']:.10g}\nmin = {item['value'] - half:.10g}\n"
            f'max = {item["value"] + half:.10g}\ntargets = "arm.{item["name"]}"\n'
            f'description = "{item["formula"]}"'
        )
    return {
        "device": device,
        "plots": _plots(values),
        "inputs": "\n".join(
            f'"arm.{signal}[{k}]" = {{ column = "{column}_{k}", interpolation = "linear" }}'
            for signal, column in (("q", "q"), ("qd", "speed"), ("qdd", "acceleration"))
            for k in numbers
        ),
        "rotors": f"arm.J_m = {values['J_rotor']['value']}   # as those of arm_drive",
        "columns": "\n".join(columns),
        "channels": "\n".join(
            f'tau_{k} = {{ signal = "arm.tau[{k}]", sigma = {sigma} }}'
            for k, sigma in zip(numbers, _sigmas(values), strict=True)
        ),
        "estimated": "\n\n".join(estimated),
        "differs": f"a load of {payload:g} kg on the flange, which the mapping does not know of,",
        "limits": _limits(values),
    }


def _plots(values: Mapping[str, Any]) -> str:
    """Positions and torques of joints that turn and of those that slide, and the first's error."""
    slides = values["prismatic"]["value"]
    parts = []
    for flag, (positions, torques) in enumerate(
        (("joints", "torques of the motors"), ("sliding joints", "forces of the motors"))
    ):
        chosen = [k for k, slide in enumerate(slides, 1) if slide == flag]
        for label, signal in ((positions, "arm.q"), (torques, "drive.tau_motor")):
            if chosen:
                listed = ", ".join(f'"{signal}[{k}]"' for k in chosen)
                parts.append(f'[[plots]]\nlabel = "{label}"\nsignals = [{listed}]')
    unit = "mm" if slides[0] else "mrad"
    parts.append(
        '[[plots]]\nlabel = "joint 1 less set"\nsignals = ["arm.q[1]"]\nminus = "path.q_set[1]"\n'
        f'unit = "{unit}"'
    )
    return "\n\n".join(parts)


def _limits(values: Mapping[str, Any]) -> str:
    """Checks that joints stay within their limits, where they have such."""
    ranges = zip(values["q_min"]["value"], values["q_max"]["value"], strict=True)
    lines = []
    for k, (low, high) in enumerate(ranges, 1):
        for of, limit in (("minimum", [low, high]), ("maximum", [low, high])):
            if abs(low) < float("inf") and abs(high) < float("inf"):
                lines.append(
                    f'[[checks]]\nname = "joint {k}, {of}"\nsignal = "arm.q[{k}]"\nof = "{of}"\n'
                    f'limit = {limit}\nsource = "limits of the joint"'
                )
    return "\n\n".join(lines)
