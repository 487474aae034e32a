"""Runs a system: creates its FMUs, initializes them together, executes the algorithm's plan.

    recording = Master(system, algorithm="jacobi", step=1e-3).run(10.0, inputs={"motor.w_ref": 50})

`execution` has what happens in a run.
"""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..data.recording import Recording
from ..data.signals import Signal, as_signal
from ..errors import GraphError, UnitError, UnknownNameError, ValueRangeError, listing
from ..fmu.exchange import DTYPES
from ..spec.units import conversion, parse
from ..system.system import System
from .algorithms import compile_plan
from .execution import Execution
from .isolation import run_isolated
from .plan import Plan

Vector = NDArray[np.float64]
Driver = Signal | float | Callable[[Vector], ArrayLike]


@dataclass(frozen=True)
class Outline:
    """A run, checked and outline out.

    Attributes:
        count: communication steps.
        observed: full scalar names of what is recorded.
        signals: scalar input -> what drives it.
        plan: of the algorithm.
        times: communication points [s].
        external: values of the driven inputs, one row per communication point.
    """

    count: int
    observed: list[str]
    signals: dict[str, Signal]
    plan: Plan
    times: Vector
    external: Vector


@dataclass(frozen=True)
class Master:
    """A system with an algorithm and a communication step.

    Attributes:
        system: the graph.
        algorithm: name of a module in `algorithms`.
        step: communication step [s].
        tolerance: relative tolerance handed to the FMUs, None for their own.
        executor: `c` (compiled), `python` (the reference), or `auto` (compiled if this machine
            has the library).
        scenario: name that recordings carry.
        options: of the algorithm.
        isolate: run in a process of its own, where a call to an FMU may take this long [s]: what
            crashes or hangs there ends the run with an error and the recording up to then.
    """

    system: System
    algorithm: str = "jacobi"
    step: float = 1e-3
    tolerance: float | None = None
    scenario: str = ""
    executor: str = "auto"
    options: Mapping[str, Any] = field(default_factory=dict)
    isolate: float | None = None

    def run(
        self,
        duration: float,
        *,
        inputs: Mapping[str, Driver] | None = None,
        record: Sequence[str] | None = None,
        every: int = 1,
        start: float = 0.0,
        progress: Callable[[float], None] | None = None,
    ) -> Recording:
        """Run from `start` over `duration`, a whole number of steps.

        Args:
            duration: [s].
            inputs: open input -> signal, number, or function of time (arrays).
            record: signals to record; all outputs if not given.
            every: record every n-th communication point.
            start: time at which the run begins [s].
            progress: told now and then which fraction is done.

        Raises:
            InputError: wrong names, values or units (see the subclasses).
            AlgebraicLoopError: initial values do not settle.
            StepError: an FMU failed; carries the recording up to then.
        """
        outline = self.outline(duration, inputs=inputs, record=record, every=every, start=start)
        if self.isolate is not None:
            if not self.isolate > 0.0:
                raise ValueRangeError(f"time limit {self.isolate} s is not positive")
            return run_isolated(
                self, self.isolate, outline.signals, outline.external, outline.observed,
                outline.times, every, progress,
            )  # fmt: skip
        with ExitStack() as stack:
            run = Execution(
                self, outline.plan, outline.observed, outline.external, outline.times, every,
                outline.signals, stack,
            )  # fmt: skip
            return run.execute(outline.count, progress)

    def outline(
        self,
        duration: float,
        *,
        inputs: Mapping[str, Driver] | None = None,
        record: Sequence[str] | None = None,
        every: int = 1,
        start: float = 0.0,
    ) -> Outline:
        """What `run` does before it creates the FMUs: check everything, tabulate the inputs.

        Raises:
            InputError: wrong names, values or units (see the subclasses).
        """
        count = self._count(duration, every)
        wanted = self.system.signals() if record is None else record
        observed = list(dict.fromkeys(n for name in wanted for n in self._observable(name)))
        signals = self._signals(inputs or {})
        plan = self.compile(list(signals), observed)
        times: Vector = start + self.step * np.arange(count + 1, dtype=np.float64)
        return Outline(count, observed, signals, plan, times, self._external(signals, times))

    def compile(self, external: Sequence[str], observed: Sequence[str]) -> Plan:
        """The plan of the algorithm with its options."""
        return compile_plan(self.algorithm, self.system, external, observed, self.options)

    # -- checks ----------------------------------------------------------------------------------

    def _count(self, duration: float, every: int) -> int:
        if not self.step > 0.0 or not np.isfinite(self.step):
            raise ValueRangeError(f"communication step {self.step} s is not positive")
        if not duration > 0.0 or not np.isfinite(duration):
            raise ValueRangeError(f"duration {duration} s is not positive")
        if every < 1:
            raise ValueRangeError(f"record every {every}-th point: must be 1 or more")
        count = round(duration / self.step)
        if count < 1 or abs(count * self.step - duration) > 1e-6 * self.step:
            fitting = max(count, 1) * self.step
            raise ValueRangeError(
                f"duration {duration:.9g} s is not a whole number of steps of {self.step:.9g} s; "
                f"take a duration of {fitting:.9g} s or another step"
            )
        return count

    def _observable(self, name: str) -> list[str]:
        _, variables = self.system.variables(name)
        if variables[0].type not in DTYPES:
            raise GraphError(f"{name} is of type {variables[0].type} and cannot be recorded")
        return self.system.elements(name)

    def _signals(self, inputs: Mapping[str, Driver]) -> dict[str, Signal]:
        signals: dict[str, Signal] = {}
        for name, driver in inputs.items():
            _, variables = self.system.variables(name)
            if variables[0].causality != "input":
                raise UnknownNameError(
                    f"{name} is not an input but a variable of causality "
                    f"{variables[0].causality!r}; {listing(self.system.open_inputs(), name)}"
                )
            for element in self.system.elements(name):
                source = self.system.driver(element)
                if source is not None:
                    raise GraphError(
                        f"input {element} is already driven by {source}; drop the connection or "
                        "the signal"
                    )
                signals[element] = as_signal(driver)
        return signals

    def _external(self, signals: Mapping[str, Signal], times: Vector) -> Vector:
        table = np.empty((times.size, len(signals)))
        for column, (name, signal) in enumerate(signals.items()):
            values = np.asarray(signal.at(times), dtype=np.float64)
            unit = self.system.unit(name)
            if signal.unit and unit:
                try:
                    gain, offset = conversion(parse(signal.unit), self._declared_unit(name))
                except UnitError as error:
                    raise UnitError(f"input {name} from {signal.text}: unit {error}") from error
                values = values * gain + offset
            bad = np.flatnonzero(~np.isfinite(values))
            if bad.size:
                raise ValueRangeError(
                    f"input {name} from {signal.text} is {values[bad[0]]} at "
                    f"t = {times[bad[0]]:.9g} s; inputs must be finite"
                )
            table[:, column] = values
        return table

    def _declared_unit(self, name: str) -> Any:
        instance, _, variable = name.partition(".")
        found = self.system.members[instance].description.variables
        return found[variable if variable in found else variable.rpartition("[")[0]].unit

    def provenance(self) -> dict[str, Any]:
        """Where results of this master come from."""
        return {
            "system": self.system.name,
            "scenario": self.scenario,
            "algorithm": self.algorithm,
            "options": {key: _plain(value) for key, value in self.options.items()},
            "step_s": self.step,
            "instances": {
                member.name: {
                    "reference": member.reference,
                    "model": member.description.name,
                    "fmi": member.description.fmi,
                    "file": member.fmu.path.name,
                    "sha256": member.fmu.digest,
                    "tool": member.description.tool,
                    "parameters": dict(member.parameters),
                }
                for member in self.system.members.values()
            },
            "connections": [f"{c.source} -> {c.target}" for c in self.system.connections],
            "versions": {name: _version(name) for name in ("cosim", "numpy")},
        }


def _plain(value: Any) -> Any:
    return dict(value) if isinstance(value, Mapping) else value


@lru_cache
def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"
