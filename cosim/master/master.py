"""Runs a system: creates its FMUs, initializes them together, executes the algorithm's plan.

    recording = Master(system, algorithm="jacobi", step=1e-3).run(10.0, inputs={"motor.w_ref": 50})

`execution` has what happens in a run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import (
    is_number,
    need_function,
    need_number,
    need_table,
    need_text,
    need_texts,
    need_whole,
    wrong,
)
from ..data.recording import Recording
from ..data.signals import Constant, Signal, objects
from ..errors import GraphError, UnitError, ValueRangeError
from ..fmu.values import OBJECTS, TYPES, check_values
from ..reading.limits import DATA
from ..spec.units import change
from ..system.inputs import Driver, spread
from ..system.system import System
from .algorithms import compile_plan, names
from .execution import Execution
from .isolation import can_fork, run_isolated
from .outline import Outline
from .plan import Plan

Vector = NDArray[np.float64]
UNEVEN = 0.01
"""Part of a step by which its length may be off because times of day are rounded: 0.2 us beside
steps of 24 us at 2e9 s, the seconds since 1970. Results err by about as much."""


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
        guard: the same without a time limit, in a fork of this process where the system has that:
            quick to start, but for programs without other threads that hold locks.
    """

    system: System
    algorithm: str = "jacobi"
    step: float = 1e-3
    tolerance: float | None = None
    scenario: str = ""
    executor: str = "auto"
    options: Mapping[str, Any] = field(default_factory=dict)
    isolate: float | None = None
    guard: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.system, System):
            raise wrong(
                "the system of a Master", self.system, "a System",
                "build one with System, or run a scenario by its name with cosim.run",
            )  # fmt: skip
        way = (
            f"write Master(system, step={self.algorithm})"
            if is_number(self.algorithm)
            else f"take one of {', '.join(names())}"
        )
        need_text("the algorithm of a Master", self.algorithm, way)
        need_number("the communication step of a Master", self.step, "give it in seconds")
        object.__setattr__(self, "step", float(self.step))  # of a fraction, too
        for what, value in (("tolerance", self.tolerance), ("time limit isolate", self.isolate)):
            if value is not None:
                need_number(f"the {what} of a Master", value)
        if self.tolerance is not None and not 0.0 < self.tolerance < math.inf:
            raise ValueRangeError(
                f"the tolerance of a Master, {self.tolerance}, is no positive number; leave it "
                "out for the FMUs' own"
            )
        need_text("the scenario of a Master", self.scenario, "give the name recordings carry")
        need_text("the executor of a Master", self.executor, "take auto, c or python")
        need_table("options of a Master", self.options, 'options={"extrapolation": 1}')

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
        need_function("progress of a run", progress)
        outline = self.outline(duration, inputs=inputs, record=record, every=every, start=start)
        if self.isolate is not None:
            if not self.isolate > 0.0:
                raise ValueRangeError(f"time limit {self.isolate} s is not positive")
            return run_isolated(outline, self.isolate, progress)
        if self.guard and can_fork():
            return run_isolated(outline, math.inf, progress, fork=True)
        with ExitStack() as stack:
            return Execution(outline, stack).execute(progress)

    def outline(
        self,
        duration: float,
        *,
        inputs: Mapping[str, Driver] | None = None,
        record: Sequence[str] | None = None,
        every: int = 1,
        start: float = 0.0,
        like: Outline | None = None,
    ) -> Outline:
        """What `run` does before it creates the FMUs: check everything, tabulate the inputs.

        Raises:
            InputError: wrong names, values or units (see the subclasses).
        """
        need_number("the duration of a run", duration, "give it in seconds")
        need_number("the start of a run", start, "give it in seconds")
        need_whole("every of a run", every)
        need_table("inputs of a run", inputs or {}, 'inputs={"motor.w_ref": 50.0}')
        if record is not None:
            need_texts("record of a run", record, 'record=["load.w"]')
        count = self._count(duration, every, start)
        wanted = self.system.signals() if record is None else record
        observed = tuple(dict.fromkeys(n for name in wanted for n in self._observable(name)))
        signals = spread(self.system, inputs or {})
        times: Vector = start + self.step * np.arange(count + 1, dtype=np.float64)
        times[-1] = start + duration
        tables = like.tables_for(self.system, signals, times) if like is not None else None
        carried = {} if tables else self.carried(signals, times)
        times, external = tables or (times, self._external(signals, times, carried))
        return Outline(
            system=self.system,
            scenario=self.scenario,
            options=self.options,
            step=self.step,
            tolerance=self.tolerance,
            executor=self.executor,
            plan=self.compile(list(signals), observed),
            times=times,
            observed=observed,
            every=every,
            signals=signals,
            external=external,
            objects=carried,
        )

    def compile(self, external: Sequence[str], observed: Sequence[str]) -> Plan:
        """The plan of the algorithm with its options."""
        return compile_plan(self.algorithm, self.system, external, observed, self.options)

    def tabulate(self, signals: Mapping[str, Signal], times: Vector) -> Vector:
        """Values of inputs at further times, in the units of the inputs.

        Raises:
            InputError: values that do not fit.
        """
        return self._external(signals, times, self.carried(signals, times))

    def carried(self, signals: Mapping[str, Signal], times: Vector) -> dict[int, list[Any]]:
        """Values of the driven inputs that travel as objects, by their column.

        Raises:
            InputError: values that do not fit.
        """
        found = {}
        for column, (name, signal) in enumerate(signals.items()):
            declared = self.system.declaration(name)
            if declared.type in OBJECTS:
                given = objects(signal, times) or signal.at(times).tolist()
                where = f"input {name} from {signal.text}"
                scalar = replace(declared, dimensions=())
                found[column] = [check_values(where, [scalar], item)[0] for item in given]
        return found

    # -- checks ----------------------------------------------------------------------------------

    def _count(self, duration: float, every: int, start: float) -> int:
        if not self.step > 0.0 or not np.isfinite(self.step):
            raise ValueRangeError(f"communication step {self.step} s is not positive")
        if not np.isfinite(start):
            raise ValueRangeError(f"start {start} s is not finite")
        if not duration > 0.0 or not np.isfinite(duration):
            raise ValueRangeError(f"duration {duration} s is not positive")
        if every < 1:
            raise ValueRangeError(f"record every {every}-th point: must be 1 or more")
        if duration / self.step > DATA.value() / 8:  # its times alone would be more
            raise ValueRangeError(
                f"duration {duration:g} s in steps of {self.step:g} s: the times alone take more "
                f"than {DATA.value():g} bytes ({DATA.variable}); take a shorter run or longer steps"
            )
        count = round(duration / self.step)
        if count < 1 or abs(count * self.step - duration) > 1e-6 * self.step:
            fitting = max(count, 1) * self.step
            raise ValueRangeError(
                f"duration {duration:.9g} s is not a whole number of steps of {self.step:.9g} s; "
                f"take a duration of {fitting:.9g} s or another step"
            )
        apart = float(np.spacing(max(abs(start), abs(start + duration))))
        if apart > UNEVEN * self.step:
            raise ValueRangeError(
                f"start {start:.9g} s: floating-point numbers are {apart:.3g} s apart there, too "
                f"far for steps of {self.step:.9g} s; let the run begin at 0, or take longer steps"
            )
        return count

    def _observable(self, name: str) -> list[str]:
        _, variables = self.system.variables(name)
        if variables[0].type not in TYPES:
            raise GraphError(f"{name} is of type {variables[0].type} and cannot be recorded")
        return self.system.elements(name)

    def _external(
        self, signals: Mapping[str, Signal], times: Vector, carried: Mapping[int, Sequence[Any]]
    ) -> Vector:
        """Values of the driven inputs; in place of `carried` texts a number for each."""
        table = np.empty((times.size, len(signals)))
        for column, (name, signal) in enumerate(signals.items()):
            if column in carried:
                different = enumerate(dict.fromkeys(carried[column]))
                codes = {i: float(i) if isinstance(i, int) else code for code, i in different}
                table[:, column] = [codes[item] for item in carried[column]]
                continue
            values = self._numbers(name, signal, times)
            declared = self.system.declaration(name)
            if signal.unit and declared.unit is not None:
                try:
                    gain, offset = change(signal.unit, declared.unit, difference=declared.relative)
                except UnitError as error:
                    raise UnitError(f"input {name} from {signal.text}: {error}") from error
                values = values * gain + offset
            if isinstance(signal, Constant):  # bounds are in the input's unit
                where = f"input {name} from {signal.text}"
                check_values(where, [replace(declared, dimensions=())], float(values[0]))
            bad = np.flatnonzero(~np.isfinite(values))
            if bad.size:
                raise ValueRangeError(
                    f"input {name} from {signal.text} is {values[bad[0]]} at "
                    f"t = {times[bad[0]]:.9g} s; inputs must be finite"
                )
            table[:, column] = values
        return table

    def _numbers(self, name: str, signal: Signal, times: Vector) -> Vector:
        """Values of a driven input that travels as a number; names of an enumeration count."""
        declared = self.system.declaration(name)
        exact = objects(signal, times)
        if not exact and not declared.items:
            return np.asarray(signal.at(times), dtype=np.float64)
        given = exact or signal.at(times).tolist()
        scalar, where = replace(declared, dimensions=()), f"input {name} from {signal.text}"
        checked = {item: check_values(where, [scalar], item)[0] for item in dict.fromkeys(given)}
        return np.array([float(checked[item]) for item in given])
