"""A machine that streams: a data set's model, perhaps with an effect, and the noise of its sensors.

The effect is part of the machine from the begin with strength 0, which is exact absence, and gets
its strength at some time. Parameters are those of the reading that watches it, so nothing but the
noise and the effect is in the residual.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cosim.calibrate.parts import Sampler
from cosim.live.messages import Sample
from cosim.live.reading import Reading

Vector = NDArray[np.float64]


class Machine:
    """Makes lines of a stream.

    Args:
        reading: model, channels and columns.
        commands: columns that drive it -> values, one per sample.
        entries: of its run.
        variant: changes of the model, e.g. `{"load": "+coulomb"}`.
        values: set at the begin: of the effect's parameters, its strength 0 among them.
        change: time -> values that are set then.
        late: from when on commands act how much later than the stream says [s].
        seed: of the noise.
        clock: the first sample's time [s].
    """

    def __init__(
        self,
        reading: Reading,
        commands: Mapping[str, Vector],
        entries: Mapping[str, Any] | None = None,
        variant: Mapping[str, str] | None = None,
        values: Mapping[str, float] | None = None,
        change: Mapping[float, Mapping[str, float]] | None = None,
        late: tuple[float, float] = (math.inf, 0.0),
        seed: int = 0,
        clock: float = 0.0,
    ) -> None:
        problem = reading.problem
        if variant:
            problem = problem.changed(model=problem.model.changed(variant))
        self.reading, self.commands, self.clock = reading, commands, clock
        self.entries, self.change, self.late = dict(entries or {}), dict(change or {}), late
        own = Reading(reading.joined, reading.problem)
        own.theta, own.problem = reading.theta, problem
        first = Sample(0.0, {name: float(column[0]) for name, column in commands.items()})
        self.twin = own.twin(reading.starts(self.entries, first))
        self.values = dict(values or {})
        self._random = np.random.default_rng(seed)

    def rows(self, block: int = 2000) -> Iterator[list[dict[str, float]]]:
        """Samples as tables, in blocks."""
        reading, problem, twin = self.reading, self.reading.problem, self.twin
        count = len(next(iter(self.commands.values())))
        times = reading.interval * np.arange(count)
        for driver in reading.drivers:
            twin.set(driver.target, driver.table(times, self._acting(driver.column, times)))
        for name, value in self.values.items():
            twin.set(name, value)
        record = {name: place for place, name in enumerate(twin.recorded)}
        changes = sorted(self.change.items())
        held: tuple[Vector, Vector] = (np.zeros(0), np.zeros((0, len(record))))
        for begin in range(0, count, block):
            end = min(begin + block, count)
            while changes and changes[0][0] <= times[begin]:
                for name, value in changes.pop(0)[1].items():
                    twin.set(name, value)
            steps = round((times[end - 1] + reading.interval - twin.time) / problem.step)
            twin.step(steps * problem.step)
            stamps, rows = twin.drain()
            held = (np.append(held[0], stamps), np.concatenate([held[1], rows]))
            sampler = Sampler(times[begin:end], held[0])
            found = {name: column[begin:end] for name, column in self.commands.items()}
            for channel in problem.channels:
                clean = channel.of(sampler, held[1][:, record[channel.signal]])
                noisy = clean + channel.sigma * self._random.standard_normal(end - begin)
                gain, offset = reading.joined.converted[channel.name]
                found[reading.joined.columns[channel.name]] = (noisy - offset) / gain
            keep = max(c.window for c in problem.channels) + 4.0 * reading.size
            first = int(np.searchsorted(held[0], times[end - 1] - keep))
            held = (held[0][first:], held[1][first:])
            stamped = self.clock + times[begin:end]
            names = [reading.clock, *found]
            table = np.column_stack([stamped, *found.values()]).tolist()
            yield [dict(zip(names, row, strict=True)) for row in table]

    def _acting(self, column: str, times: Vector) -> Vector:
        """A command as it acts."""
        begin, delay = self.late
        back = np.where(times >= begin, round(delay / self.reading.interval), 0)
        return np.asarray(self.commands[column][np.arange(times.size) - back])

    def lines(self, block: int = 2000) -> Iterator[list[bytes]]:
        """The same as lines of a stream, the begin of the run first."""
        yield [json.dumps({"run": self.entries}).encode()]
        for rows in self.rows(block):
            yield [json.dumps(row).encode() for row in rows]
