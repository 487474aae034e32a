"""Data sets made by the components' own FMUs: other parameters, an undeclared effect, noise.

A mirror rather than a test of the laws, but it covers the whole catalogue: every effect that fits
the rig, at every place, with a size drawn around a typical one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cosim.calibrate.mapping import read_problem
from cosim.calibrate.problem import Problem
from cosim.calibrate.simulator import Simulator
from cosim.diagnose.candidates import Candidate, candidates, new_parameters

Vector = NDArray[np.float64]
INSIDE = 0.2
"""Share of a parameter's range, on both sides, from which no truth is drawn."""
CYCLES = 200.0
"""Most cycles per turn that are drawn: slots, teeth and poles times two rarely are more."""


@dataclass(frozen=True)
class Made:
    """A data set and its truth.

    Attributes:
        problem: the declared system with the made data.
        effect: label of the undeclared effect, "none" without.
        size: of its strength.
        parameters: true values of the declared parameters.
        change: run -> channel -> what the effect changes, without noise.
    """

    problem: Problem
    effect: str
    size: float
    parameters: dict[str, float]
    change: dict[str, dict[str, Vector]]


def example(folder: Path, seconds: float) -> Problem:
    """The rig of an example data set, with its runs cut after some seconds."""
    problem = read_problem(folder)
    runs = []
    for run in problem.runs:
        kept = run.times <= run.times[0] + seconds
        runs.append(replace(run, times=run.times[kept], data=run.data[kept]))
    return problem.changed(runs=runs)


def individual(problem: Problem, random: np.random.Generator) -> Vector:
    """Parameters of one individual: the declared ones drawn away from their bounds."""
    theta = problem.nominal
    for i, p in enumerate(problem.parameters):
        if p.role == "declared":
            margin = INSIDE * (p.maximum - p.minimum)
            theta[i] = random.uniform(p.minimum + margin, p.maximum - margin)
    return theta


def made(
    problem: Problem, candidate: Candidate | None, factor: float, seed: int, *, wide: bool = False
) -> Made:
    """Simulate one individual of a rig.

    Args:
        problem: the rig with the inputs of its runs.
        candidate: undeclared effect, None for none.
        factor: its size over a typical one.
        seed: of parameters and noise.
        wide: the effect's time constants and whole numbers of cycles are log-uniform over their
            range, not at their usual value.
    """
    random = np.random.default_rng(seed)
    theta = individual(problem, random)
    simulator = Simulator(problem)
    plain = {run.name: simulator.simulate(theta, run) for run in problem.runs}
    values, size = plain, 0.0
    if candidate is not None:
        real = candidate.added_to(problem)
        strengths, _ = new_parameters(problem, real)
        size = float(np.clip(factor * strengths[0].span, strengths[0].minimum,
                             strengths[0].maximum))  # fmt: skip
        point = real.nominal
        point[: theta.size] = theta
        point[real.index(strengths[0].name)] = size
        for p in real.parameters:
            if p.hints.mix == "turn":
                point[real.index(p.name)] = random.uniform(-np.pi, np.pi)
            elif wide and p.hints.decades:
                point[real.index(p.name)] = np.exp(random.uniform(*np.log(p.hints.decades)))
            elif wide and p.hints.cycles:
                most = min(CYCLES, p.maximum)
                point[real.index(p.name)] = round(np.exp(random.uniform(0.0, np.log(most))))
        other = simulator.of(real)
        values = {run.name: other.simulate(point, run) for run in real.runs}
        other.close()
    data = {}
    for run in problem.runs:
        noise = problem.sigma * random.standard_normal(run.data.shape)
        data[run.name] = np.where(np.isfinite(run.data), values[run.name] + noise, np.nan)
    simulator.close()
    channels = [c.name for c in problem.channels]
    change = {n: dict(zip(channels, (values[n] - plain[n]).T, strict=True)) for n in plain}
    names = [p.name for p in problem.parameters]
    truth = {n: float(v) for n, v, p in zip(names, theta, problem.parameters, strict=True)
             if p.role == "declared"}  # fmt: skip
    label = "none" if candidate is None else candidate.label
    return Made(problem.with_data(data), label, size, truth, change)


def catalogue(problem: Problem) -> list[Candidate]:
    """One place of every effect that fits the rig, the first, and every fidelity."""
    found: dict[tuple[str, str], Candidate] = {}
    for item in candidates(problem):
        found.setdefault((item.component, item.effect), item)
    return list(found.values())
