"""Simulates a problem: with prepared sessions that are shared, in threads, within limits on work.

Residuals are (measured - model) / sigma, one row per sample and one column per channel, NaN where
nothing was measured (see `reach.apart` for what a late clock moves out of a run). Where noise of
logged inputs adds to them, they are made white (`whitening`), and derivatives with them.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from ..data.segments import relative_pose
from ..data.signals import Shifted, Signal, Table
from ..errors import FmuCallError, StepError, ValueRangeError
from ..master.cores import cores
from ..master.elsewhere import Elsewhere, locked
from ..master.master import Master
from ..master.session import Session
from ..reading.limits import DATA
from .budget import Budget
from .parts import CLOCK, COINCIDENT, MeasuredRun, Sampler, Vector
from .pool import Key, Ran, SessionPool
from .problem import Problem
from .reach import apart, known
from .threads import shared

Item = TypeVar("Item")
Result = TypeVar("Result")
BETWEEN = 16
"""Recorded points per interval where samples fall between them: a line across a jump then misreads
the samples of a sixteenth of the interval."""


class Simulator:
    """Runs a problem.

    Args:
        problem: what is simulated.
        workers: threads, one per core if not given.
        limits: work that runs may take (see `Session.run`), by run; no limit for others.
        pool: sessions shared with other simulators.

    Attributes:
        evaluations: simulated runs so far, without those known from before.
        costs: least work that a run took.
    """

    def __init__(
        self,
        problem: Problem,
        *,
        workers: int | None = None,
        limits: Mapping[str, float] | None = None,
        pool: SessionPool | None = None,
    ) -> None:
        self.problem = problem
        self.workers = workers or cores()
        self.limits: Mapping[str, float] = dict(limits or {})
        self.evaluations = 0
        self.costs: dict[str, float] = {}
        self._pool = pool or SessionPool()
        self._lock = threading.Lock()
        self._samplers: dict[str, Sampler] = {}

    def of(self, problem: Problem) -> Simulator:
        """A simulator of another problem with the same sessions, threads and limits."""
        return Simulator(problem, workers=self.workers, limits=self.limits, pool=self._pool)

    def limited(self, limits: Mapping[str, float]) -> Simulator:
        """The same with these limits instead."""
        return Simulator(self.problem, workers=self.workers, limits=limits, pool=self._pool)

    @property
    def budget(self) -> Budget:
        """How much may be simulated, by all simulators with these sessions."""
        return self._pool.budget

    # -- one run -----------------------------------------------------------------------------------

    def _key(self, run: MeasuredRun) -> Key:
        interval = run.interval
        spans = (float(run.times[0]), float(run.times[-1]), interval, run.lead)
        return Key(self.problem.kind, (run.name, spans, id(run.inputs)))

    def _prepared(self, run: MeasuredRun) -> Session | Elsewhere:
        """A new prepared run; in other processes where an FMU holds Python's lock."""
        if self.workers > 1 and locked(self.problem.plain()):
            master, duration, options = self._planned(run)
            return Elsewhere(
                master.outline(duration, **options), self._pool.elsewhere(self.workers)
            )
        master, duration, options = self._planned(run)
        place = (self._key(run).run, self.problem.step)
        session = Session(master, duration, like=self._pool.outlines.get(place), **options)
        self._pool.outlines.setdefault(place, session.outline)
        return session

    def session(self, run: MeasuredRun) -> Session:
        """A new prepared run of its own, which can be driven by other inputs."""
        master, duration, options = self._planned(run)
        return Session(master, duration, **options)

    def _planned(self, run: MeasuredRun) -> tuple[Master, float, dict[str, Any]]:
        """Master, duration and options of a prepared run."""
        problem = self.problem
        master = Master(
            problem.plain(), problem.algorithm, problem.step, options=problem.chosen_options
        )
        interval = problem.period or run.interval
        every = max(round(interval / problem.step), 1)
        first = float(run.times[0]) - run.lead
        places = (run.times - first) / (every * problem.step)
        if np.max(np.abs(places - np.rint(places))) > COINCIDENT:
            every = max(every // BETWEEN, 1)  # else jumps are read off lines across them
        size = every * problem.step
        last = float(run.times[-1]) + max(channel.shift for channel in problem.channels)
        count = math.ceil((last - first) / size - COINCIDENT)
        if excess := DATA.excess(8 * count * every * (1 + len(run.inputs))):
            raise ValueRangeError(
                f"run {run.name}: its samples are {run.interval:.4g} s apart, so it takes "
                f"{count * every} steps of {problem.step:g} s ({excess}); if its clock is not in "
                "seconds, say so in [columns], time = { source = '...', from = 'ms' }"
            )
        return (
            master,
            count * size,
            {
                "inputs": {n: self._driving(s, first) for n, s in run.inputs.items()},
                "record": list(dict.fromkeys(channel.signal for channel in problem.channels)),
                "every": every,
                "start": first if abs(first) > COINCIDENT * interval else 0.0,
            },
        )

    def _driving(self, signal: Signal, first: float) -> Signal:
        """An input as it drives a run that begins at this time.

        What is held from moments between two steps is given as its mean over each step: read when a
        step begins, it comes late by half of one, at random. A rig with ticks reads it so itself.
        """
        if self.problem.tick is not None or not isinstance(signal, Table):
            return signal
        places = (signal.times - first) / self.problem.step
        even = np.max(np.abs(places - np.rint(places))) <= COINCIDENT
        if even or signal.interpolation != "hold" or not np.isfinite(signal.values).all():
            return signal
        return Shifted(signal, 0.0, self.problem.step)

    def simulate(self, theta: Vector, run: MeasuredRun | str) -> Vector:
        """What the channels would read: one row per sample, NaN where clocks have moved it out.

        Raises:
            StepError: an FMU failed, or the run exceeded its limit.
            StoppedError: no more may be simulated, see `Budget`.
            ValueRangeError: a value outside the bounds that its FMU declares.
        """
        problem = self.problem
        run = problem.run(run) if isinstance(run, str) else run
        errors = problem.log_errors(theta, run)
        ran = self._ran(problem.values(theta, run), run, late_inputs(run, errors))
        with self._lock:
            # not the last one: threads would decide which that is
            self.costs[run.name] = min(ran.cost, self.costs.get(run.name, ran.cost))
        return self._read(run, ran, errors)

    def driven(
        self, theta: Vector, run: MeasuredRun, inputs: Sequence[Mapping[str, Signal]]
    ) -> list[Vector]:
        """What the channels would read with some other inputs each time, those not named as logged.

        Raises:
            StepError, ValueRangeError: as of `simulate`.
        """
        problem, errors = self.problem, self.problem.log_errors(theta, run)
        session, later = self.session(run), late_inputs(run, errors)
        found = []
        try:
            for given in inputs:
                self.budget.spend()
                session.drive(given, later)
                times, rows = session.run(problem.values(theta, run))
                ran = Ran(session.names, times, rows, session.work, run.inputs)
                found.append(self._read(run, ran, errors))
        finally:
            session.close()
        with self._lock:
            self.evaluations += len(found)
        return found

    def _read(self, run: MeasuredRun, ran: Ran, errors: Mapping[str, float]) -> Vector:
        """What the channels read of a simulated run."""
        problem = self.problem
        place = {name: column for column, name in enumerate(ran.names)}
        sampler = self._sampler(run, ran.times)
        read = np.column_stack(
            [c.of(sampler, ran.rows[:, place[c.signal]], errors) for c in problem.channels]
        )
        for names in problem.relative:
            pose = [[c.name for c in problem.channels].index(name) for name in names]
            read[:, pose] = relative_pose(read[:, pose], run.anchor)
        return known(run, problem.channels, errors, read) if errors else read

    def _sampler(self, run: MeasuredRun, recorded: Vector) -> Sampler:
        """What reads signals of a run: the same while it is recorded at the same times."""
        known = self._samplers.get(run.name)
        if known and known.times is run.times and np.array_equal(known.recorded, recorded):
            return known
        made = self._samplers[run.name] = Sampler(run.times, recorded)
        return made

    def _ran(self, values: dict[str, float], run: MeasuredRun, later: Mapping[str, float]) -> Ran:
        key, limit = self._key(run), self.limits.get(run.name, math.inf)
        if later:  # only sessions of this process can be driven by what is late
            key = key._replace(run=(key.run, "late"))
        clocks = {CLOCK + name: value for name, value in later.items()}
        which = frozenset((values | clocks).items())
        if (known := self._pool.ran(key, which, limit)) is not None:
            return known
        self.budget.spend()
        with self._lock:
            session = self._pool.take(key)
            if later:
                session = session if isinstance(session, Session) else self.session(run)
                session.shift(later)
            elif session is None:
                session = self._prepared(run)
        try:
            times, rows = session.run(values, limit=limit)
        except FmuCallError:
            session.close()
            with self._lock:
                self.evaluations += 1
            raise
        ran = Ran(session.names, times, rows, session.work, run.inputs)
        self._pool.give(key, session, run.inputs)
        if (ended := float(times[-1])) < run.times[-1] - run.interval:
            raise StepError(
                f"run {run.name}: an FMU asked to end the simulation at {ended:g} s, and the log "
                f"goes on to {run.times[-1]:g} s; end the run there, or ask why it ends",
                time=ended,
            )
        if self._pool.remember(key, which, ran):
            with self._lock:
                self.evaluations += 1
        return ran

    # -- many --------------------------------------------------------------------------------------

    def spread(self, function: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
        """Apply a function that simulates to items, in threads."""
        self.problem.plain()  # FMUs are built once, before threads ask for them
        return shared(function, items, self.workers)

    def residuals(
        self,
        theta: Vector,
        purpose: str | Iterable[str] | None = "identification",
        *,
        plain: bool = False,
    ) -> list[tuple[str, Vector]]:
        """(run, (measured - model) / sigma) for the runs of a purpose (or named, or all).

        Args:
            theta: values.
            purpose: see there.
            plain: with what noise of the inputs adds, else made white (`whitening`).
        """
        runs = self.problem.chosen(purpose)
        models = self.spread(lambda run: self.simulate(theta, run), runs)
        rows = [apart(run, model, self.problem.sigma) for run, model in zip(runs, models)]  # noqa: B905
        return [
            (run.name, row if plain else run.white(row))
            for run, row in zip(runs, rows, strict=True)
        ]

    def close(self) -> None:
        """Free the idle sessions of this kind of problem; it can still be simulated."""
        self._pool.close(self.problem.kind)


def late_inputs(run: MeasuredRun, errors: Mapping[str, float]) -> dict[str, float]:
    """Inputs of a run whose column in the log is not in time -> by how much they come later [s]."""
    return {name: -errors[name] for name in run.inputs if errors.get(name)}
