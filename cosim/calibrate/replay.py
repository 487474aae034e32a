"""A measured run with all that its scene shows: what the model does beside what was measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..data.comparison import Reference
from ..data.recording import Recording
from ..data.signals import Shifted
from ..master.master import Master
from ..view.scene import needs, scenes
from .parts import COINCIDENT, DRIFT, MeasuredRun, Sampler, Vector
from .problem import Problem
from .simulator import late_inputs


def replay(problem: Problem, theta: Vector, run: MeasuredRun) -> tuple[Recording, list[Reference]]:
    """Simulate a run and keep what scenes need; its measured channels, as their signals.

    Channels over a window (means, differences) are left out of the measured ones; clocks and
    columns are read as the parameters say.

    Args:
        problem: with the run.
        theta: values of its parameters.
        run: which one.

    Raises:
        CosimError: see `errors`.
    """
    system = problem.model.system(problem.values(theta, run))
    errors = problem.log_errors(theta, run)
    late = late_inputs(run, errors)
    looks = scenes(system)
    interval = problem.period or run.interval
    every = max(round(interval / problem.step), 1)
    count = int((run.times[-1] - run.times[0] + run.lead) / (every * problem.step) + COINCIDENT)
    first = float(run.times[0]) - run.lead
    master = Master(
        system, problem.algorithm, problem.step, scenario=f"{problem.name}/{run.name}",
        options=problem.options,
    )  # fmt: skip
    recording = master.run(
        count * every * problem.step,
        inputs={
            name: Shifted(signal, late[name], problem.step) if name in late else signal
            for name, signal in run.inputs.items()
        },
        record=list(dict.fromkeys([*(c.signal for c in problem.channels), *needs(looks)])),
        every=every,
        start=first if abs(first) > COINCIDENT * interval else 0.0,
    )
    sampler = Sampler(run.times, run.times)
    measured = [
        Reference(
            (channel.signal,),
            sampler.drifted(
                channel.shift - errors.get(channel.name, 0.0),
                errors.get(DRIFT + channel.name, 0.0),
            ),
            channel.meant(sampler, run.data[:, column], errors)[:, np.newaxis],
            "",
            f"{run.name}: {channel.name}",
        )
        for column, channel in enumerate(problem.channels)
        if channel.transform == "sample"
        and not any(channel.name in names for names in problem.relative)
    ]
    return replace(recording, provenance={**recording.provenance, "scene": looks}), measured
