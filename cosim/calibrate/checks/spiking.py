"""Single samples that stand out: lost bits, not motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...data.signals import Table
from ..columns import spikes
from .finding import Finding, quantity

if TYPE_CHECKING:
    from ..problem import Problem

Vector = NDArray[np.float64]
NEAR = 3
"""Samples before and after within which a jolt shows in another column."""
SHOWS = 4.0
"""Deviations by which it bends there."""
BEYOND = 100.0
"""Times the largest bend that the command gives a column, by the model, which no jolt that comes of
the same command passes: a play that ends or a force that lets go strikes by tens of it."""
HARM = 0.1
"""Mean square over the noise's, of a column of a run, to which spikes must add to stop anything:
with less, a model that leaves noise still passes for one, whether they are faults or small jolts of
the machine that hide in the noise of the other columns."""


ONE = 1.25
"""Counts that the step of one is at most, with what rounding of a log does."""
COUNTED, WHOLE, SAME = 50, 0.01, 1e-6
"""Changes of a column that tell whether it counts; by how much a step of counts may miss whole ones
(numbers in logs have digits); and the share of the usual step below which one is rounding."""
OUTSIDE = 3.0
"""Times the range of all other values by which a command lies outside of it."""
USUAL = 1.5
"""Sample intervals that a command lasts at most to be a single one."""


def check_commands(problem: Problem) -> Iterator[Finding]:
    """Single samples of inputs that are far outside of what else was commanded.

    They last one sample, between two that agree (`columns.spikes`), and lie outside of the range of
    all other values by `OUTSIDE` times that. A short blow may be meant, so it is a warning.
    """
    for run in problem.runs:
        usual = float(np.median(np.diff(run.times))) if run.times.size > 1 else 0.0
        for target, table in run.inputs.items():
            if not isinstance(table, Table) or table.values.ndim > 1:
                continue
            values, times = table.values, table.times
            found = spikes(values)
            if not found.any():
                continue
            found[:-1] &= np.diff(times) < USUAL * usual
            low, high = (float(f(values[~found])) for f in (np.min, np.max))
            away = np.maximum(values - high, low - values)
            at = np.flatnonzero(found & (away > OUTSIDE * (high - low)) & (high > low))
            if at.size:
                text = (
                    f"drives {target} with {values[at[0]]:.6g} for one sample, at "
                    f"{times[at[0]] - run.lead:.6g} s, and else with {low:.6g} to {high:.6g}"
                    + (f" ({at.size} such samples)" if at.size > 1 else "")
                    + "; if that was not sent, make a gap of it with despike = true (or limit) "
                    "in [columns]"
                )
                column = table.text.rpartition(":")[2]
                yield Finding("warning", "spikes", run.name, column, text)


def check_spikes(problem: Problem, models: Mapping[str, Vector]) -> Iterator[Finding]:
    """Samples that stand out in the data (`columns.spikes`) and in what the model leaves of them.

    Of white Gaussian noise a sample passes for one once in 1e9. A jolt of the machine may last one
    sample, too (the impact at the end of a play), but it shows in another column within `NEAR`
    samples, which a fault of the log does by chance in one of 800 cases per column (7 samples
    beyond 4 deviations); so columns are named of whose spikes most are alone. A jolt moves
    something: columns that stand out at the very same sample and go on as if nothing had been are a
    row that was written or sent wrongly. So bends are those of the columns without their spikes.
    Other columns also bend where a command switches, with or without a jolt. What the model
    foretells of a bend (times one number for a run, since its parameters are not known yet) is none
    of a jolt, where the sample stands out by `BEYOND` times the bend that the model has there.
    """
    bends, rests = {}, {}
    for run in problem.runs:
        for index, channel in enumerate(problem.channels):
            bent = _bent(without_spikes(run.data[:, index], channel.sigma))
            bends[run.name, index] = _size(bent, channel.sigma)
            if run.name in models:
                model = _bent(models[run.name][:, index])
                rests[run.name, index] = np.minimum(
                    bends[run.name, index], _size(_unlike(bent, model), channel.sigma)
                )
    for index, channel in enumerate(problem.channels):
        for run in problem.runs:
            values = run.data[:, index]
            found = spikes(values, channel.sigma)
            if run.name in models:
                found &= spikes(values - models[run.name][:, index], channel.sigma)
            quantum = _quantum(values)
            flickers = found & (np.abs(_bent(values)) < ONE * quantum)
            if flickers.any():
                text = (
                    f"is whole multiples of {quantity(quantum, channel.unit, '.6g')}, which single "
                    "samples show as steps of one: counts of an encoder, say; give "
                    f"quantum = {quantum:.6g} in [channels], in the channel's unit"
                )
                yield Finding("warning", "noise", run.name, channel.name, text)
            at = np.flatnonzero(found & ~flickers)
            alone = [k for k in at if not _shows(
                rests if _beyond(problem, models, run.name, index, int(k)) else bends,
                run.name, index, int(k),
            )]  # fmt: skip
            if not len(alone) > 0.5 * at.size:
                continue
            worst = at[int(np.argmax(np.abs(values[at] - values[at - 1])))]
            beside = 0.5 * (values[at - 1] + values[at + 1])
            harm = float(np.nansum(((values[at] - beside) / channel.sigma) ** 2)) / values.size
            text = (
                f"has {at.size} single samples that stand out, the first at "
                f"{run.logged[at[0]]:.6g} s, the largest "
                f"{quantity(values[worst], channel.unit, '.6g')} at {run.logged[worst]:.6g} s "
                f"between {values[worst - 1]:.6g} and {values[worst + 1]:.6g}: "
                "faults of the log; make gaps of them with "
                "despike = true (or limit) in [columns]"
            )
            severity = "error" if harm > HARM else "warning"
            yield Finding(severity, "spikes", run.name, channel.name, text)


def _quantum(values: Vector) -> float:
    """Of what values are whole multiples apart, 0 where they are not."""
    steps = np.abs(np.diff(values[np.isfinite(values)]))
    steps = steps[steps > 0.0]
    if steps.size < COUNTED:
        return 0.0
    steps = steps[steps > SAME * np.median(steps)]
    counts = steps / np.min(steps)
    return float(np.min(steps)) if np.max(np.abs(counts - np.rint(counts))) < WHOLE else 0.0


def without_spikes(values: Vector, sigma: float) -> Vector:
    """A column whose spikes are gaps."""
    return np.where(spikes(values, sigma), np.nan, values)


def _bent(values: Vector) -> Vector:
    """How far samples are from the middle of their neighbours; 0 where that is not known."""
    bent = np.zeros(values.shape)
    bent[1:-1] = values[1:-1] - 0.5 * (values[:-2] + values[2:])
    bent[~np.isfinite(bent)] = 0.0
    return bent


def _size(bent: Vector, sigma: float) -> Vector:
    """Size of bends over their usual one, or that of the noise where that is larger."""
    size = np.abs(bent)
    return size / max(float(np.median(size)) / 0.6745, sigma * float(np.sqrt(1.5)))


def _unlike(bent: Vector, model: Vector) -> Vector:
    """Bends without the multiple of the model's that leaves least."""
    power = float(model @ model)
    return bent - (float(bent @ model) / power if power > 0.0 else 0.0) * model


def _beyond(problem: Problem, models: Mapping[str, Vector], run: str, index: int, at: int) -> bool:
    """Whether a sample stands out beyond all that the command does to its column about there."""
    if run not in models:
        return False
    bent = float(np.max(np.abs(_bent(models[run][:, index])[_about(at)])))
    return abs(float(_bent(problem.run(run).data[:, index])[at])) > BEYOND * bent


def _about(at: int) -> slice:
    """The samples within which a jolt shows."""
    return slice(max(at - NEAR, 0), at + NEAR + 1)


def _shows(bends: Mapping[tuple[str, int], Vector], run: str, index: int, at: int) -> bool:
    """Whether another column of the run bends at about this sample."""
    return any(
        float(np.max(bend[_about(at)])) > SHOWS
        for (name, other), bend in bends.items()
        if name == run and other != index
    )
