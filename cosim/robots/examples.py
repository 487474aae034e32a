"""Example logs of a system from a template: its scenario simulated with other values, and noise."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..files import make_folder, read_toml, write_text
from ..running.runner import run
from ..system.provider import Provider
from .templates import TIMES

SEED = 1
FINER = 10
"""A real machine exchanges at once: steps of the exchange that make one of the scenario's."""


def write_logs(
    folder: Path,
    columns: Mapping[str, tuple[str, float]],
    inputs: Mapping[str, Mapping[str, list[float]]],
    parameters: Mapping[str, Any],
    provider: Provider | None = None,
    variants: Mapping[str, str] | None = None,
    finer: int = FINER,
) -> list[Path]:
    """Simulate the runs of `folder` and write what a logger would have seen to `folder/logs`.

    Args:
        folder: with scenario.toml.
        columns: column of the log -> signal and noise (one sigma).
        inputs: run -> column -> values at `templates.TIMES`.
        parameters: variable -> value that differs from the scenario's.
        provider: where FMUs come from.
        variants: instance -> short form of what it is in reality.
        finer: steps of the exchange that make one of the scenario's.

    Returns:
        the files, one per run.
    """
    file = folder / "scenario.toml"
    step = read_toml(file)["step"] / finer
    result = run(str(file), parameters=parameters, variants=variants, step=step, provider=provider)
    random = np.random.default_rng(SEED)
    written = []
    make_folder(folder / "logs")
    for name, item in result.runs.items():
        recording = item.recording
        time = recording.time
        table: dict[str, Any] = {"time": time}
        for column, values in inputs.get(name, {}).items():
            index = np.searchsorted(TIMES, time + 1e-9, side="right") - 1
            table[column] = np.asarray(values)[index]
        for column, (signal, noise) in columns.items():
            table[column] = recording[signal] + noise * random.standard_normal(time.size)
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(table)
        writer.writerows(
            [f"{value:.9g}" for value in row] for row in zip(*table.values(), strict=True)
        )
        path = folder / "logs" / f"{name}.csv"
        write_text(path, text.getvalue())
        written.append(path)
    return written
