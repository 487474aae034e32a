"""Runs a twin beside a stream: its inputs drive the twin, its measurements are compared with it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..calibrate.parts import COINCIDENT, DRIFT, Sampler
from ..data.signals import Shifted
from ..errors import InputError, ScenarioError
from ..master.twin import Twin
from .alarm import Alarms
from .folder import Folder
from .lateness import Lateness
from .messages import Begin, End, Sample, read_message
from .ordering import Counts, Sorter
from .reading import Reading
from .sources import Line, Source

Vector = NDArray[np.float64]
Emit = Callable[[dict[str, Any]], None]
BLOCK = 2000
"""Most samples that the twin goes through at once: more fill no processor better."""
TELL = 5
"""Unreadable lines that are shown; all are counted."""


@dataclass(frozen=True)
class Settings:
    """How a stream is followed.

    Attributes:
        pace: times real time at which a recorded stream is played, 0 for as fast as possible.
        rate: expected false alarms per hour.
        margin: what the model may be off by without a fault, over sigma.
        wait: how long samples may come after later ones [s].
        settle: no alarms for so long after the begin of a run [s].
        report: time between reports [s].
        idle: the stream ends when nothing comes for so long [s], None for never.
        duration: the stream ends after so much of its time [s], None for never.
    """

    pace: float = 1.0
    rate: float = 0.01
    margin: float = 0.0
    wait: float = 0.0
    settle: float = 0.0
    report: float = 1.0
    idle: float | None = None
    duration: float | None = None

    def __post_init__(self) -> None:
        for name in ("pace", "margin", "wait", "settle"):
            if not getattr(self, name) >= 0.0:
                raise InputError(f"{name} of a stream is {getattr(self, name)}, not 0 or more")
        for name in ("rate", "report", "idle", "duration"):
            if getattr(self, name) is not None and not getattr(self, name) > 0.0:
                raise InputError(f"{name} of a stream is {getattr(self, name)}, not greater than 0")


@dataclass
class _Run:
    """A run under way.

    Attributes:
        name: of it.
        twin: at its newest sample.
        begun: time of its first sample by the machine's clock [s].
        last: its newest sample.
        known: per driver the samples that the twin may still need: times in it, values.
        pending: samples that are not compared yet: times in the twin, measured values.
        past: rows that channels still need: times, rows.
        errors: of the stream's columns, see `Problem.log_errors`.
    """

    name: str
    twin: Twin
    begun: float
    last: Sample
    known: list[tuple[Vector, Vector]]
    pending: tuple[Vector, Vector]
    past: tuple[Vector, Vector]
    errors: Mapping[str, float]


@dataclass
class _Part:
    """What a report sums up."""

    since: float | None = None
    rows: list[Vector] = field(default_factory=list)


class Watch:
    """Follows a stream.

    Args:
        reading: the model and what columns are in it.
        settings: how.
        emit: told what happens, a table each.
        folder: where samples are kept; None for nowhere.

    Attributes:
        counts, lateness, alarms, raised: what became of the samples so far.
    """

    def __init__(
        self, reading: Reading, settings: Settings, emit: Emit, folder: Folder | None = None
    ) -> None:
        self.reading, self.settings, self.emit, self.folder = reading, settings, emit, folder
        channels = reading.problem.channels
        self.counts, self.lateness = Counts(), Lateness()
        self.alarms = Alarms(
            [c.name for c in channels], reading.interval, settings.rate, settings.margin
        )
        self.raised: dict[tuple[str, str], int] = {}
        self._sorter = Sorter(reading.interval, settings.wait, self.counts)
        self._shifts = np.array([c.shift for c in channels])
        self._windows = np.array([c.window for c in channels])
        self._entries: Mapping[str, Any] | None = None if reading.needs else {}
        self._run: _Run | None = None
        self._offset: float | None = None
        self._part = _Part()
        self._square = np.zeros(len(channels))
        self._count = np.zeros(len(channels))
        self._first: float | None = None
        self._latest: float | None = None
        self._told = False
        self._named: set[tuple[str, str]] = set()

    # -- the stream --------------------------------------------------------------------------------

    def follow(self, source: Source) -> dict[str, Any]:
        """Follow a source to its end; the summary, which is emitted, too.

        Raises:
            CosimError: the source broke off, or the stream does not fit the model.
        """
        quiet = time.monotonic()
        paced = source.recorded and self.settings.pace > 0.0
        try:
            while True:
                lines = source.lines(0.1, 1 if paced else BLOCK)
                if lines is None:
                    break
                if lines:
                    quiet = time.monotonic()
                elif self._idle(time.monotonic() - quiet):
                    break
                if not self.take(lines, paced):
                    break
        finally:
            source.close()
            try:
                self.finish()
            finally:
                if self.folder and self.folder.begun:
                    self.folder.close()  # whatever has ended it
        return self.summary()

    def _idle(self, seconds: float) -> bool:
        return self.settings.idle is not None and seconds > self.settings.idle

    def take(self, lines: Sequence[Line], paced: bool = False) -> bool:
        """Go through lines; False if they end the stream.

        Args:
            lines: with their arrivals.
            paced: wait until each sample is due.
        """
        ready: list[Sample] = []
        for arrival, line in lines:
            try:
                message = read_message(line, self.reading.clock)
            except ValueError as error:
                self.counts.unreadable += 1
                if self.counts.unreadable <= TELL:
                    text = line[:80].decode("utf-8", "replace")
                    self.emit({"event": "unreadable", "line": text, "why": str(error)})
                continue
            if isinstance(message, End):
                self._go(ready)
                return False
            if isinstance(message, Begin):
                self._go([*ready, *self._sorter.release(everything=True)])
                ready = []
                self._end_run("a new run was told")
                self._sorter.restart()
                self._entries, self._told = message.values, True
                continue
            if self._told and self._latest is not None and message.time < self._latest:
                self._begin_anew(message.time)
            self._told, self._latest = False, message.time
            self._wait_until_due(message, arrival, paced)
            if self._first is None:
                self._first = message.time
            self._sorter.push(message)
            ready += self._sorter.release()  # now: who is late must not depend on the blocks
            limit = self.settings.duration
            if limit is not None and message.time - self._first >= limit:
                self._go(ready)
                return False
        self._go(ready)
        return True

    def _begin_anew(self, now: float) -> None:
        """Let a run's clock begin anew: what counts from earlier times goes on from here."""
        assert self._first is not None and self._latest is not None
        self._first += now - self._latest
        self._offset, self._part.since = None, now

    def _wait_until_due(self, sample: Sample, arrival: float, paced: bool) -> None:
        """Note when samples are due; the quickest one so far sets the clocks' difference."""
        pace = self.settings.pace or 1.0
        now = time.monotonic() if paced else arrival
        begin = now - sample.time / pace
        if paced:
            if self._offset is None:
                self._offset = begin
            delay = self._offset + sample.time / pace - time.monotonic()
            if delay > 0.0:
                time.sleep(delay)
        elif self._offset is None or begin < self._offset:
            self._offset = begin

    def _go(self, samples: Sequence[Sample]) -> None:
        """Go through samples in their order; long gaps between them end a run."""
        first = 0
        for index, sample in enumerate(samples):
            before = samples[index - 1] if index > first else self._run and self._run.last
            if before and sample.time - before.time > self.reading.gap:
                self._advance(samples[first:index])
                self.emit({"event": "gap", "t": before.time, "length_s": sample.time - before.time})
                self._end_run("a gap")
                first = index
        self._advance(samples[first:])
        if self._offset is not None and self.settings.pace > 0.0:
            now = time.monotonic()
            for sample in samples:
                self.lateness.add(now - self._offset - sample.time / self.settings.pace)

    # -- runs --------------------------------------------------------------------------------------

    def _begin_run(self, first: Sample) -> bool:
        """Begin a run with its first sample; False if its start values are not known."""
        entries = self._entries
        if entries is None:
            return False
        self.reading.check(first)
        starts = self.reading.starts(entries, first)
        twin = self.reading.twin(starts)
        name = self.folder.begin(entries, first) if self.folder else str(entries.get("name", ""))
        width = len(twin.recorded)
        self._run = _Run(
            name, twin, first.time, first,
            [(np.zeros(0), np.zeros(0))] * len(self.reading.drivers),
            (np.zeros(0), np.zeros((0, len(self.reading.problem.channels)))),
            (np.zeros(0), np.zeros((0, width))), self.reading.errors(starts),
        )  # fmt: skip
        self._entries = None if self.reading.needs else {}
        self.alarms.restart()
        self._named.clear()
        self.emit({"event": "run", "t": first.time, "run": name, "starts": starts})
        return True

    def _end_run(self, why: str) -> None:
        run = self._run
        if run is None:
            return
        self._run = None
        self._tell(run.last.time)
        run.twin.close()
        if self.folder:
            self.folder.end()
        self.emit({"event": "run_end", "t": run.last.time, "run": run.name, "why": why})

    def _advance(self, samples: Sequence[Sample]) -> None:
        """Let the twin go on to the newest sample, and compare what it has passed."""
        if not samples:
            return
        if self._run is None and not self._begin_run(samples[0]):
            if not self.counts.ignored:
                self.emit(
                    {
                        "event": "waiting",
                        "t": samples[0].time,
                        "why": 'a run needs {"run": {...}} with ' + ", ".join(self.reading.needs),
                    }
                )
            self.counts.ignored += len(samples)
            return
        run = self._run
        assert run is not None
        if self.folder:
            self.folder.add(samples)
        reading = self.reading
        stamps = np.array([sample.time for sample in samples]) - run.begun + reading.lead
        times, until = reading.times(stamps), float(stamps[-1])
        for index, driver in enumerate(reading.drivers):
            values = reading.column(samples, driver.column)
            good = np.isfinite(values)
            before = run.known[index]
            known = (np.append(before[0], times[good]), np.append(before[1], values[good]))
            if not known[0].size:
                raise ScenarioError(
                    f"the first sample has no value of {driver.column!r}, which drives "
                    f"{driver.target}"
                )
            table, step = driver.table(*known), reading.problem.step
            late = run.errors.get(driver.target, 0.0)
            run.twin.set(driver.target, Shifted(table, -late, step) if late else table)
            # beyond these times later samples may say something else
            newest = float(stamps[-1] if driver.interpolation == "hold" else known[0][-1])
            until = min(until, newest - late - step if late else newest)
            first = int(np.searchsorted(known[0], run.twin.time + min(late, 0.0), "right")) - 2
            run.known[index] = (known[0][max(first, 0) :], known[1][max(first, 0) :])
        run.last = samples[-1]
        self._step(run, until)
        kept, measured = run.pending
        run.pending = (
            np.concatenate([kept, stamps]),
            np.concatenate([measured, reading.measured(samples)]),
        )
        self._compare(run)

    def _step(self, run: _Run, to: float) -> None:
        """Go to the last recorded point at or before a time."""
        size, step = self.reading.size, self.reading.problem.step
        target = int(to / size + COINCIDENT) * size
        count = round((target - run.twin.time) / step)
        if count > 0:
            run.twin.step(count * step)
        times, rows = run.twin.drain()
        if rows.size:
            past, earlier = run.past
            run.past = (
                np.concatenate([past, times]),
                np.concatenate([earlier, rows]) if past.size else rows,
            )

    def _compare(self, run: _Run) -> None:
        """Residuals of the pending samples that the twin has passed."""
        stamps, measured = run.pending
        times, rows = run.past
        if not times.size:
            return
        problem, close = self.reading.problem, COINCIDENT * self.reading.interval
        seen = self._seen(run, stamps)
        needed = np.maximum((seen + self._shifts).max(axis=1), stamps)
        count = int(np.searchsorted(needed, times[-1] + close, side="right"))
        if not count:
            return
        sampler = Sampler(stamps[:count], times, self.reading.lead)
        record = {name: i for i, name in enumerate(run.twin.recorded)}
        model = np.column_stack(
            [c.of(sampler, rows[:, record[c.signal]], run.errors) for c in problem.channels]
        )
        residuals = (measured[:count] - model) / problem.sigma
        residuals[seen[:count] < -close] = np.nan  # before the run, as its clocks are
        run.pending = (stamps[count:], measured[count:])
        oldest = float((seen[count - 1] + np.minimum(self._shifts, 0.0) - self._windows).min())
        first = int(np.searchsorted(times, oldest - 4.0 * self.reading.size))
        run.past = (times[first:], rows[first:])
        clock = stamps[:count] - self.reading.lead + run.begun
        settled = stamps[:count] - self.reading.lead >= self.settings.settle
        self._judge(clock[settled], residuals[settled])
        self._part.rows.append(residuals)
        known = np.isfinite(residuals)
        self._square += (np.where(known, residuals, 0.0) ** 2).sum(axis=0)
        self._count += known.sum(axis=0)
        if self._part.since is None:
            self._part.since = min(0.0, float(clock[0]))  # a clock may begin before 0
        if clock[-1] - self._part.since >= self.settings.report:
            self._tell(float(clock[-1]))

    def _seen(self, run: _Run, stamps: Vector) -> Vector:
        """When what channels show at these times was: times in the twin, one column each."""
        columns = []
        for channel in self.reading.problem.channels:
            late, drift = (run.errors.get(key + channel.name, 0.0) for key in ("", DRIFT))
            columns.append(stamps - late - drift * (stamps - self.reading.lead))
        return np.column_stack(columns)

    def _judge(self, times: Vector, residuals: Vector) -> None:
        for alarm in self.alarms.take(times, residuals):
            key = (alarm.channel, alarm.kind)
            self.raised[key] = self.raised.get(key, 0) + 1
            if key not in self._named:
                self._named.add(key)
                self.emit({"event": "alarm", **alarm.to_dict()})

    def _tell(self, now: float) -> None:
        """Report on the samples since the last report."""
        if not self._part.rows:
            return
        rows = np.concatenate(self._part.rows)
        names = [channel.name for channel in self.reading.problem.channels]
        with np.errstate(invalid="ignore", divide="ignore"):
            count = np.isfinite(rows).sum(axis=0)
            mean = np.nansum(rows, axis=0) / count
            rms = np.sqrt(np.nansum(rows**2, axis=0) / count)
        self.emit(
            {
                "t": round(now, 9),
                "samples": len(rows),
                "residual": {
                    name: {"rms": _plain(r), "mean": _plain(m)}
                    for name, r, m in zip(names, rms, mean, strict=True)
                },
            }
        )
        self._part = _Part(now)

    # -- end ---------------------------------------------------------------------------------------

    def finish(self) -> None:
        """Go through what is still held back, and end the run."""
        self._go(self._sorter.release(everything=True))
        self._end_run("the stream ended")

    def summary(self) -> dict[str, Any]:
        """What there was to see; closes the folder."""
        names = [channel.name for channel in self.reading.problem.channels]
        with np.errstate(invalid="ignore"):  # nothing was compared: no figure
            rms = np.sqrt(self._square / self._count)
        found = {
            "event": "end",
            **asdict(self.counts),
            "lateness_s": self.lateness.to_dict() if self.settings.pace > 0.0 else None,
            "residual_rms": dict(zip(names, map(_plain, rms), strict=True)),
            "not_compared": [n for n, k in zip(names, self._count, strict=True) if not k],
            "alarms": {f"{channel} {kind}": n for (channel, kind), n in self.raised.items()},
            "tests": self.alarms.tests,
            "false_alarms_per_hour": self.settings.rate,
            "folder": str(self.folder.close()) if self.folder else None,
        }
        self.emit(found)
        return found


def _plain(value: float) -> float | None:
    return float(f"{value:.4g}") if np.isfinite(value) else None
