"""What each parameter and each effect of the catalogue does to the logs, to first order.

Logs with the same inputs, sample times and start values have the same derivatives, so each
excitation is simulated once, around the parameters of the first logs. Effects are taken at a
strength that shows, but little: a channel of a run by about the noise. What a sensor may be off by
after it was replaced (zero, scale, latency) needs no simulation; it is there for each channel, and
once more for all channels that are read at one instance.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

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
Kind = Literal["parameter", "channel", "effect"]
VISIBLE, TRIALS = 2.0, 6
"""Largest RMS over the noise, in a channel of a run, that a trial of an effect may have before a
weaker one is tried; and trials at most."""
NOTHING = 1e-6
"""The same below which an effect changes nothing: integration rounds to less."""
SENSORS = {
    "offset": "The reading has another zero.",
    "scale": "The reading has another scale.",
    "count scale": "The reading counts another share of the way since the run's start.",
    "latency": "The reading is late; negative: earlier than before.",
}
SAME = 1e-6
"""Patterns whose cosine differs from 1 by less are one: that of two simulations of the same."""


@dataclass(frozen=True)
class Direction:
    """Something that may change.

    Attributes:
        name: parameter, `offset of channel`, or `effect at place`.
        kind: which of these.
        quantity: name of the parameter or of the effect's strength.
        unit: of it.
        scale: typical change of it.
        text: one line about it.
        columns: of the patterns; two for an effect with an unknown phase.
        place: instance and port; "" of a parameter.
        probe: the effect in its system, None for others.
        read: indices of the channels that it concerns, of a channel's.
        same: what does the same.
        own: column of its value by log, where a change of it has another one: of a declared
            parameter, whose small changes from log to log are none.
    """

    name: str
    kind: Kind
    quantity: str
    unit: str
    scale: float
    text: str
    columns: tuple[int, ...]
    place: str = ""
    probe: Probe | None = None
    read: tuple[int, ...] = ()
    same: tuple[str, ...] = ()
    own: int | None = None

    @property
    def value(self) -> int:
        """Column of its value by log."""
        return self.columns[0] if self.own is None else self.own

    @property
    def least(self) -> float | None:
        """Least value of an effect's strength, in scales: less of it than none there is not."""
        if self.probe is None or len(self.columns) > 1:
            return None
        least = self.probe.strength.minimum / self.scale
        return least if np.isfinite(least) else None

    @property
    def declared(self) -> bool:
        """Whether it is a parameter of the declared system."""
        return self.kind == "parameter"

    @property
    def complexity(self) -> tuple[int, int, int]:
        """Smaller for what is simpler: what is declared, then fewer values that may differ."""
        others = 0 if self.probe is None else len(self.probe.others)
        return len(self.columns), int(self.kind != "parameter"), others

    def contains(self, other: Direction) -> bool:
        """Whether its law becomes that of another direction for some values of its parameters."""
        if self.probe is None or other.probe is None or self.place != other.place:
            return False
        return other.probe.candidate.effect in self.probe.candidate.contains


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
        bent: by column, how far its pattern at the full size of a change is from that of a small
            one, over its size.
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
    bent: dict[int, float] = field(default_factory=dict)

    @property
    def width(self) -> int:
        """Number of columns."""
        return int(next(iter(self.values.values())).shape[1])

    def secant(self, index: int, amplitude: Vector) -> bool:
        """Replace patterns by what the change of this size does; False if it cannot be run.

        Args:
            index: of the direction.
            amplitude: one per column, in scales.
        """
        direction = self.directions[index]
        size = float(np.linalg.norm(amplitude))
        if size == 0.0:
            return False
        try:
            if direction.kind == "channel":
                size = float(amplitude[0])
                changed = {
                    run.name: self.model[run.name]
                    + self._read(run, direction.quantity, direction.read, size * direction.scale)
                    for run in self.problem.runs
                }
            elif direction.probe is None:
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
            elif len(direction.columns) > 1 or (
                direction.least is not None and amplitude[0] < direction.least
            ):
                return False  # less of an effect than the declared system has
            else:
                size = float(amplitude[0])
                changed = self.with_effect(direction.probe, size * direction.scale, 0.0)
        except CosimError:
            return False  # first orders will do
        column = direction.columns[0]
        before = {name: values[:, column].copy() for name, values in self.values.items()}
        if direction.declared and direction.own is None:
            new = self.width
            for name, values in self.values.items():
                self.values[name] = np.column_stack([values, np.zeros(len(values))])
            self.directions[index] = replace(direction, columns=(new,), own=column)
            column = new
        moved, whole = 0.0, 0.0
        for name, values in changed.items():
            secant = (values - self.model[name]).ravel() / size
            moved += float(np.sum((secant - before[name]) ** 2))
            whole += float(np.sum(secant**2))
            self.values[name][:, column] = secant
        self.bent.setdefault(column, float(np.sqrt(moved / max(whole, 1e-300))))
        return True

    def _read(
        self, run: MeasuredRun, quantity: str, channels: Sequence[int], amount: float
    ) -> Vector:
        """What a sensor's error adds to model values over sigma."""
        model = self.model[run.name]
        change = np.zeros_like(model)
        for place in channels:
            channel = self.problem.channels[place]
            if quantity == "offset":
                change[:, place] = amount / channel.sigma
            elif quantity == "scale":
                change[:, place] = amount * (model[:, place] - channel.offset / channel.sigma)
            elif quantity == "count scale":
                change[:, place] = amount * (model[:, place] - model[0, place])
            else:
                late = np.interp(run.times - amount, run.times, model[:, place])
                change[:, place] = late - model[:, place]
        return change

    def sensors(self) -> list[tuple[Direction, dict[str, Vector]]]:
        """What sensors may be off by, and what that does; columns are not given yet."""
        channels = self.problem.channels
        at: dict[str, list[int]] = {}
        for number, one in enumerate(channels):
            at.setdefault(one.signal.partition(".")[0], []).append(number)
        size = float(np.median(np.diff(self.problem.runs[0].times)))
        asked: list[tuple[str, str, str, tuple[int, ...]]] = [
            (what, f"{what} of {channels[k].name}", channels[k].signal, (k,))
            for k in range(len(channels))
            for what in SENSORS
        ]
        asked += [
            (what, f"{what} of all channels at {instance}", instance, tuple(places))
            for instance, places in at.items() if len(places) > 1
            for what in SENSORS if what != "offset"
        ]  # fmt: skip
        found = []
        for what, name, place, read in asked:
            channel = channels[read[0]]
            unit, scale = {
                "offset": (channel.unit, channel.sigma), "latency": ("s", size)
            }.get(what, ("1", 1e-3))  # fmt: skip
            text = SENSORS[what]
            rows = {r.name: self._read(r, what, read, scale) for r in self.problem.runs}
            plain = {r.name: self._read(r, "scale", read, scale) for r in self.problem.runs}
            if what == "count scale" and all(
                np.max(np.abs(rows[n] - plain[n])) <= NOTHING for n in rows
            ):
                continue  # runs that begin at 0
            if max(float(np.max(np.abs(v))) for v in rows.values()) > NOTHING:
                entry = Direction(name, "channel", what, unit, scale, text, (), place, read=read)
                found.append((entry, rows))
        return found

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
    return {run.name: first.setdefault(excitation(problem, run), run.name) for run in problem.runs}


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
            Direction(p.name, "parameter", p.name, p.unit, float(whole.scale[i]), p.text,
                      (len(found.directions),))
        )  # fmt: skip
    found.declared = len(common)
    names = list(found.model)
    for direction, change in found.sensors():
        found.directions.append(replace(direction, columns=(len(columns[names[0]]),)))
        for name in names:
            columns[name].append(change[name].ravel())
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

    for place, direction in enumerate(found.directions):
        known.append((flat([columns[n][direction.columns[0]] for n in names]), place))
    groups = batches(candidates, found.problem)
    for count, batch in enumerate(groups, 1):
        probes = batch.probes(found.problem)
        for probe in probes:
            measured = _measured(found, probe)
            if measured is None:
                continue
            rows, strength = measured
            first, width = len(columns[names[0]]), len(rows[names[0]])
            candidate = probe.candidate
            entry = Direction(
                candidate.label, "effect", probe.strength.name.removeprefix(candidate.prefix),
                probe.strength.unit, strength, candidate.text, tuple(range(first, first + width)),
                candidate.place, probe,
            )  # fmt: skip
            if width == 1:
                shape = flat([rows[n][0] for n in names])
                twin = next((k for v, k in known if abs(float(v @ shape)) > 1.0 - SAME), None)
                if twin is not None:
                    _joined(found, columns, twin, entry, rows)
                    continue
                known.append((shape, len(found.directions)))
            for name in names:
                columns[name] += rows[name]
            found.directions.append(entry)
        for problem in {id(p.problem): p.problem for p in probes}.values():
            found.simulator.of(problem).close()
        say(f"effects of the catalogue: {count} of {len(groups)} groups simulated")


def _joined(
    found: Patterns,
    columns: dict[str, list[Vector]],
    twin: int,
    entry: Direction,
    rows: Mapping[str, Sequence[Vector]],
) -> None:
    """Keep the simpler one of two that do the same."""
    other = found.directions[twin]
    if entry.complexity < other.complexity:
        for name, values in rows.items():
            columns[name][other.columns[0]] = values[0]
        same = (*other.same, other.name)
        found.directions[twin] = replace(entry, columns=other.columns, same=same)
    else:
        found.directions[twin] = replace(other, same=(*other.same, entry.name))


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
        if size < NOTHING:
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
