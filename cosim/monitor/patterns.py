"""What each parameter and each effect of the catalogue does to the logs, to first order.

Logs with the same inputs, sample times and start values have the same derivatives, so each
excitation is simulated once, around the parameters of the first logs. Effects are taken at a
strength that shows, but little: a channel of a run by about the noise.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..calibrate.differences import jacobian
from ..calibrate.parts import MeasuredRun
from ..calibrate.problem import Problem
from ..calibrate.simulator import Simulator
from ..data.signals import Table
from ..diagnose.candidates import Candidate
from ..diagnose.probes import Probe, batches
from ..diagnose.secant import RUNAWAY, SECONDS, patience
from ..errors import CosimError

Vector = NDArray[np.float64]
Say = Callable[[str], None]
VISIBLE, TRIALS = 2.0, 3
"""Largest RMS over the noise, in a channel of a run, that a trial of an effect may have before a
weaker one is tried; and trials at most."""
SAME = 1e-6
"""Patterns whose cosine differs from 1 by less are one: that of two simulations of the same."""


@dataclass(frozen=True)
class Direction:
    """Something that may change.

    Attributes:
        name: parameter, or `effect at place`.
        quantity: name of the parameter or of the effect's strength.
        unit: of it.
        scale: typical change of it.
        text: one line about it.
        columns: of the patterns; two for an effect with an unknown phase.
        probe: the effect in its system, None for a declared parameter.
        same: what does the same.
    """

    name: str
    quantity: str
    unit: str
    scale: float
    text: str
    columns: tuple[int, ...]
    probe: Probe | None = None
    same: tuple[str, ...] = ()

    @property
    def declared(self) -> bool:
        """Whether it is a parameter of the declared system."""
        return self.probe is None

    @property
    def place(self) -> str:
        """Of an effect, "" of a parameter."""
        return "" if self.probe is None else self.probe.candidate.place


@dataclass
class Patterns:
    """Directions and what they do, by excitation.

    Attributes:
        problem: with one run per excitation.
        theta: parameters around which derivatives are taken.
        directions: declared parameters first.
        declared: number of columns that belong to these.
        model: by excitation, model values over sigma: (samples, channels).
        values: by excitation, (samples * channels, columns), changes over sigma per scale.
        own: by excitation, the same of parameters that concern one run only.
        keys: run of the series -> excitation.
        evaluations: simulated runs.
    """

    problem: Problem
    theta: Vector
    directions: list[Direction]
    declared: int
    model: dict[str, Vector]
    values: dict[str, Vector]
    own: dict[str, Vector]
    keys: dict[str, str]
    simulator: Simulator
    evaluations: int = 0

    @property
    def width(self) -> int:
        """Number of columns."""
        return sum(len(d.columns) for d in self.directions)

    def secant(self, direction: Direction, amplitude: Vector) -> bool:
        """Replace patterns by what the change of this size does; False if it cannot be run.

        Args:
            direction: which.
            amplitude: one per column, in scales.
        """
        size = float(np.linalg.norm(amplitude))
        if size == 0.0:
            return False
        try:
            if direction.probe is None:
                theta = self.theta.copy()
                place = self.problem.index(direction.name)
                theta[place] = np.clip(
                    theta[place] + amplitude[0] * self.problem.scale[place],
                    self.problem.lower[place], self.problem.upper[place],
                )  # fmt: skip
                size = (theta[place] - self.theta[place]) / self.problem.scale[place]
                if size == 0.0:
                    return False
                changed = self._values(self.simulator, theta)
            elif len(direction.columns) > 1 or amplitude[0] * direction.scale < (
                direction.probe.strength.minimum
            ):
                return False  # less of an effect than the declared system has
            else:
                size = float(amplitude[0])
                changed = self.with_effect(direction.probe, size * direction.scale, 0.0)
        except CosimError:
            return False  # first orders will do
        column = direction.columns[0]
        for name, values in changed.items():
            self.values[name][:, column] = (values - self.model[name]).ravel() / size
        return True

    def _values(self, simulator: Simulator, theta: Vector) -> dict[str, Vector]:
        """Model values over sigma."""
        runs = simulator.problem.runs
        self.evaluations += len(runs)
        rows = simulator.spread(lambda run: simulator.simulate(theta, run), runs)
        sigma = simulator.problem.sigma
        found = {run.name: values / sigma for run, values in zip(runs, rows, strict=True)}
        if not all(np.max(np.abs(v), initial=0.0) < RUNAWAY for v in found.values()):
            raise CosimError(f"{simulator.problem.name}: the simulation runs away")
        return found

    def with_effect(self, probe: Probe, strength: float, second: float) -> dict[str, Vector]:
        """Model values over sigma with an effect."""
        simulator = self.simulator.of(probe.problem).limited(patience(self.simulator))
        theta = probe.problem.nominal
        theta[: self.theta.size] = self.theta
        low, high = probe.strength.minimum, probe.strength.maximum
        for name, value in probe.values(
            float(np.clip(strength, low, high)), second, {}
        ).items():  # fmt: skip
            theta[probe.problem.index(name)] = value
        return self._values(simulator, theta)


def excitation(problem: Problem, run: MeasuredRun) -> str:
    """What two runs have in common whose simulations are the same."""
    content = hashlib.sha256()

    def add(*items: Any) -> None:
        for item in items:
            values = item.tobytes() if isinstance(item, np.ndarray) else repr(item).encode()
            content.update(values + b"\0")

    add(run.times, run.lead, sorted(run.starts.items()))
    for name, signal in sorted(run.inputs.items()):
        if isinstance(signal, Table):
            add(name, signal.times, np.asarray(signal.values), signal.interpolation, signal.extend)
        else:
            add(name, signal.at(run.times))
    add([(p.name.removesuffix(run.name), p.nominal) for p in problem.parameters
         if p.run == run.name])  # fmt: skip
    return content.hexdigest()


def sorted_out(problem: Problem) -> dict[str, str]:
    """Run -> the first run with the same excitation."""
    first: dict[str, str] = {}
    return {
        run.name: first.setdefault(excitation(problem, run), run.name) for run in problem.runs
    }


def representatives(
    problem: Problem, keys: Mapping[str, str], calm: Sequence[str]
) -> tuple[Problem, list[str]]:
    """The problem with one run per excitation, and which of them are fitted.

    Its data are the mean over the calm runs of the excitation: white noise gives the same estimate
    as all of them would.

    Args:
        problem: with all runs.
        keys: run -> excitation.
        calm: names of the runs of the first logs.
    """
    runs = []
    means: dict[str, list[Vector]] = {}
    for name in calm:
        means.setdefault(keys[name], []).append(problem.run(name).data)
    for name in dict.fromkeys(keys.values()):
        run = problem.run(name)
        kept = means.get(name, [run.data])
        known = np.isfinite(kept)
        count = known.sum(axis=0)
        total = np.where(known, kept, 0.0).sum(axis=0)
        data = np.where(count > 0, total / np.maximum(count, 1), np.nan)
        runs.append(replace(run, data=data))
    chosen = problem.only(run.name for run in runs).changed(runs=runs)
    return chosen, list(means)


def patterns(
    simulator: Simulator,
    theta: Vector,
    keys: dict[str, str],
    candidates: Sequence[Candidate],
    say: Say,
) -> Patterns:
    """Simulate what everything does.

    Args:
        simulator: of the problem with one run per excitation.
        theta: parameters of the first logs.
        keys: run -> excitation.
        candidates: effects; those that cannot be simulated are left out.
        say: told how far it is.
    """
    problem = simulator.problem
    whole = problem.changed(
        runs=[replace(run, data=np.zeros_like(run.data)) for run in problem.runs]
    )  # without gaps
    simulator = simulator.of(whole)
    found = Patterns(whole, theta, [], 0, {}, {}, {}, keys, simulator)
    found.model = found._values(simulator, theta)
    common = [i for i, p in enumerate(whole.parameters) if not p.run]
    slopes = jacobian(simulator, theta, None)
    found.evaluations = simulator.evaluations
    columns: dict[str, list[Vector]] = {}
    for item in slopes:
        rows = item.values.reshape(-1, item.columns.size) * whole.scale[item.columns]
        columns[item.run] = [rows[:, list(item.columns).index(i)] for i in common]
        mine = [k for k, i in enumerate(item.columns) if whole.parameters[i].run]
        found.own[item.run] = rows[:, mine]
    for i in common:
        p = whole.parameters[i]
        found.directions.append(
            Direction(p.name, p.name, p.unit, float(whole.scale[i]), p.text, (len(found.directions),))
        )  # fmt: skip
    found.declared = len(common)
    names = list(found.model)
    _effects(found, columns, names, candidates, say)
    found.values = {name: np.column_stack(columns[name]) for name in names}
    return found


def _effects(
    found: Patterns,
    columns: dict[str, list[Vector]],
    names: Sequence[str],
    candidates: Sequence[Candidate],
    say: Say,
) -> None:
    """Add the effects' columns and directions."""
    known: list[tuple[Vector, int]] = []

    def flat(parts: Sequence[Vector]) -> Vector:
        whole = np.concatenate(parts)
        return np.asarray(whole / max(float(np.linalg.norm(whole)), 1e-300))

    for place in range(found.declared):
        known.append((flat([columns[n][place] for n in names]), place))
    groups = batches(candidates, found.problem)
    count = 0
    for batch in groups:
        probes = batch.probes(found.problem)
        for probe in probes:
            parts = _measured(found, probe)
            if parts is None:
                continue
            rows, strength = parts
            unit_ = flat([rows[n][0] for n in names])
            twin = next(
                (k for v, k in known if abs(float(v @ unit_)) > 1.0 - SAME), None
            ) if len(next(iter(rows.values()))) == 1 else None  # fmt: skip
            if twin is not None:
                other = found.directions[twin]
                same = (*other.same, probe.candidate.label)
                found.directions[twin] = replace(other, same=same)
                continue
            first = len(columns[names[0]])
            width = len(rows[names[0]])
            for name in names:
                columns[name] += rows[name]
            quantity = probe.strength.name.removeprefix(probe.candidate.prefix)
            known.append((unit_, len(found.directions)))
            found.directions.append(
                Direction(
                    probe.candidate.label, quantity, probe.strength.unit, strength,
                    probe.candidate.text, tuple(range(first, first + width)), probe,
                )
            )  # fmt: skip
        for problem in {id(p.problem): p.problem for p in probes}.values():
            found.simulator.of(problem).close()
        count += 1
        say(f"effects of the catalogue: {count} of {len(groups)} groups simulated")


def _measured(
    found: Patterns, probe: Probe
) -> tuple[dict[str, list[Vector]], float] | None:  # fmt: skip
    """What an effect does at a strength that shows little, and that strength; None if nothing."""
    value = float(np.clip(probe.strength.span, probe.strength.minimum, probe.strength.maximum))
    best: tuple[dict[str, list[Vector]], float] | None = None
    for _ in range(TRIALS):
        try:
            changes = [
                {
                    name: (values - found.model[name])
                    for name, values in found.with_effect(probe, value, second).items()
                }
                for second in SECONDS[probe.mix]
            ]
        except CosimError:
            value *= 0.1  # too strong for the system to run
            continue
        if probe.mix == "shift":
            changes[1] = {name: changes[1][name] - changes[0][name] for name in changes[0]}
        size = max(
            float(np.sqrt(np.max(np.mean(v**2, axis=0)))) for part in changes for v in part.values()
        )
        if size == 0.0:
            value = float(min(10.0 * value, probe.strength.maximum))  # a limit that does not bind
            continue
        rows = {name: [part[name].ravel() for part in changes] for name in changes[0]}
        best = rows, value
        if size <= VISIBLE:
            break
        lattice = probe.strength.hints.lattice
        weaker = value / size
        if lattice:
            weaker = max(round(weaker / lattice), 1) * lattice
        if not weaker < value:
            break
        value = weaker
    return best
