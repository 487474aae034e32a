"""Makes single runs of a study with instances that are reused."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..data.recording import Recording
from ..errors import CosimError, StepError
from ..master.session import Session
from ..running.runner import RunResult
from ..system.provider import Provider
from .planning import Group, Task


class StudyChangedError(CosimError):
    """An FMU, a data file or the program is not what it was when the study was planned."""


class GroupRunner:
    """What makes the runs of a group, one after the other.

    Args:
        group: which.
        provider: where its FMUs are.
        isolate: run in processes of their own, where a call may take this long [s].

    Raises:
        StudyChangedError: its FMUs or data are not those that were planned.
    """

    def __init__(self, group: Group, provider: Provider | None, isolate: float | None) -> None:
        self.group = group
        self.prepared = group.prepare(provider, isolate)
        parts = group.fingerprint(self.prepared)
        other = [
            name for name in {**group.parts, **parts} if group.parts.get(name) != parts.get(name)
        ]
        if other:
            raise StudyChangedError(
                f"{group.scenario.name}: {', '.join(other[:5])} is not what it was when the study "
                "began (on another machine: what it is there). Start the study again; results that "
                "are there are kept"
            )
        self.channels = group.channels(self.prepared)
        self.lasting = isolate is None and group.reuse
        self._session: Session | None = None
        members = self.prepared.master.system.members.values()
        self._usual = [(member.parameters, dict(member.parameters)) for member in members]

    def run(
        self, parameters: Mapping[str, Any], progress: Callable[[float], None] | None
    ) -> Recording:
        """One run with these values on top of the scenario's."""
        for present, usual in self._usual:
            present.clear()
            present.update(usual)
        for name, value in parameters.items():
            self.prepared.master.system.set(name, value)
        if self._session is None:
            return self.prepared.run(progress)
        return self._session.record(progress)

    def ready(self) -> None:
        """Create the instances, so that it does not count as cost of a run."""
        if self.lasting and self._session is None:
            self._session = self.prepared.session()

    def close(self) -> None:
        """Free the instances."""
        if self._session is not None:
            self._session.close()
            self._session = None


class RunnerPool:
    """Runners of groups for several threads; not more than `limit` at a time have instances.

    Args:
        provider: where FMUs are.
        limit: number of threads.
        isolate: as of `GroupRunner`.
    """

    def __init__(self, provider: Provider | None, limit: int, isolate: float | None = None) -> None:
        self.provider, self.limit, self.isolate = provider, limit, isolate
        self._lock = threading.Lock()
        self._idle: list[GroupRunner] = []
        self._busy = 0

    def take(self, group: Group) -> GroupRunner:
        """A runner of the group that nobody else uses; give it back or drop it."""
        closing = []
        with self._lock:
            self._busy += 1
            for runner in reversed(self._idle):
                if runner.group.digest == group.digest:
                    self._idle.remove(runner)
                    return runner
            while self._idle and len(self._idle) + self._busy > self.limit:
                closing.append(self._idle.pop(0))
        try:
            for runner in closing:
                runner.close()
            return GroupRunner(group, self.provider, self.isolate)
        except BaseException:
            with self._lock:
                self._busy -= 1
            raise

    def give_back(self, runner: GroupRunner, usable: bool) -> None:
        """Keep a runner for the next run, unless its FMUs have failed."""
        with self._lock:
            self._busy -= 1
            if usable:
                self._idle.append(runner)
                return
        runner.close()

    def close(self) -> None:
        """Free all instances that nobody uses."""
        with self._lock:
            idle, self._idle = self._idle, []
        for runner in idle:
            runner.close()


@dataclass(frozen=True)
class TaskResult:
    """A run's result as it is kept, and its recording if signals are kept."""

    result: dict[str, Any]
    recording: Recording | None


def compute(
    task: Task, pool: RunnerPool, progress: Callable[[float], None] | None = None
) -> TaskResult:
    """Make a run; what goes wrong in it is its result.

    Raises:
        StudyChangedError: see there.
    """
    runner, usable = pool.take(task.group), False
    try:
        outcome = _compute(task, runner, progress)
        usable = outcome.result["status"] == "ok"
        return outcome
    finally:
        pool.give_back(runner, usable)


def _compute(
    task: Task, runner: GroupRunner, progress: Callable[[float], None] | None
) -> TaskResult:
    walls, cpus, notes = [], [], list(task.notes)
    first: RunResult | None = None
    started, error, recording = time.perf_counter(), None, None
    try:
        runner.ready()
        for _ in range(task.group.repeats):
            cpu, started = time.thread_time(), time.perf_counter()
            recording = runner.run(task.point.parameters, progress)
            walls.append(time.perf_counter() - started)
            cpus.append(time.thread_time() - cpu)
            if first is None:
                first = runner.prepared.conclude(recording, walls[0])
            elif not np.array_equal(first.recording.values, recording.values, equal_nan=True):
                notes.append(
                    "a repetition gave other numbers: an FMU does not return to its start on "
                    "reset, or is not deterministic; try reuse = false"
                )
        assert first is not None  # there is at least one repeat
        recording = first.recording
    except CosimError as failure:
        error = failure
        recording = failure.recording if isinstance(failure, StepError) else recording
        walls.append(time.perf_counter() - started)
    isolated = runner.prepared.master.isolate is not None
    result = {
        **_made_with(task, runner.prepared.variants),
        "status": "ok" if error is None else "failed",
        "error": None if error is None else _described(error),
        "wall_s": min(walls),
        # the work of an isolated run is done by another process, whose time nobody reads
        "cpu_s": min(cpus) if cpus and not isolated else None,
        "notes": list(dict.fromkeys(notes)),
        "channels": None,
        **_measured(first if error is None else None, recording),
    }
    kept = None
    if recording is not None and runner.channels:
        kept = replace(
            recording,
            names=runner.channels,
            values=recording.values[:, [recording.names.index(name) for name in runner.channels]],
            units={name: recording.units[name] for name in runner.channels},
        )
    return TaskResult(result, kept)


def lost(task: Task, text: str) -> TaskResult:
    """The outcome of a run whose process has died."""
    result = {
        **_made_with(task, {}),
        "status": "failed",
        "error": {"type": "LostWorker", "text": text, "time_s": None, "messages": []},
        "wall_s": None,
        "cpu_s": None,
        "notes": list(task.notes),
        "channels": None,
        **_measured(None, None),
    }
    return TaskResult(result, None)


def _made_with(task: Task, variants: Mapping[str, str]) -> dict[str, Any]:
    point, scenario = task.point, task.group.scenario
    return {
        "key": task.key,
        "scenario": scenario.name,
        "set": dict(point.variants),
        "parameters": dict(point.parameters),
        "variants": dict(variants),
        "algorithm": scenario.algorithm,
        "options": dict(scenario.options),
        "step_s": scenario.step,
        "simulated_s": scenario.duration,
    }


def _measured(run: RunResult | None, recording: Recording | None) -> dict[str, Any]:
    return {
        "fmu_steps": run.fmu_steps if run else None,
        "energy_residual_J": run.recording.energy_residual if run else None,
        "comparison": {
            name: {"unit": c.unit, "rms": c.rms, "max": c.max, "reference": c.reference}
            for name, c in (run.comparisons.items() if run else ())
        },
        "checks": [check.to_dict() for check in run.checks] if run else [],
        "provenance": dict(recording.provenance) if recording is not None else {},
    }


def _described(error: CosimError) -> dict[str, Any]:
    return {
        "type": type(error).__name__,
        "text": str(error),
        "time_s": error.time if isinstance(error, StepError) else None,
        "messages": list(getattr(error, "messages", ())),
    }
