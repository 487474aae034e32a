"""Runs a system: creates its FMUs, initializes them together, executes the algorithm's plan.

    recording = Master(system, algorithm="jacobi", step=1e-3).run(10.0, inputs={"motor.w_ref": 50})

This executor is the reference: every operation of `plan.Op` is a few lines of plain Python.
"""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import kernel
from .algorithms import compile_plan
from .block import DTYPES, Block
from .errors import (
    AlgebraicLoopError,
    FmuCallError,
    GraphError,
    StepError,
    UnitError,
    UnknownNameError,
    ValueRangeError,
    listing,
)
from .instance import Instance
from .plan import Op, Plan
from .recording import Recording
from .signals import Signal, as_signal
from .system import System
from .units import conversion, parse

Vector = NDArray[np.float64]
Driver = Signal | float | Callable[[Vector], ArrayLike]
SWEEPS = 100
"""Exchanges during initialization before a loop is said not to settle."""
SETTLED = 1e-12
"""Relative change at which an algebraic loop counts as settled during initialization."""


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
    """

    system: System
    algorithm: str = "jacobi"
    step: float = 1e-3
    tolerance: float | None = None
    scenario: str = ""
    executor: str = "auto"

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
        count = self._count(duration, every)
        wanted = self.system.signals() if record is None else record
        observed = list(dict.fromkeys(n for name in wanted for n in self._observable(name)))
        signals = self._signals(inputs or {})
        plan = compile_plan(self.algorithm, self.system, list(signals), observed)
        times: Vector = start + self.step * np.arange(count + 1, dtype=np.float64)
        external = self._external(signals, times)
        with ExitStack() as stack:
            run = _Run(self, plan, observed, external, times, every, signals, stack)
            return run.execute(count, progress)

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


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


class _Run:
    """One execution of a plan."""

    def __init__(
        self,
        master: Master,
        plan: Plan,
        observed: Sequence[str],
        external: Vector,
        times: Vector,
        every: int,
        signals: Mapping[str, Signal],
        stack: ExitStack,
    ) -> None:
        self.master, self.plan, self.layout = master, plan, plan.layout
        self.observed, self.external, self.times = observed, external, times
        self.every, self.signals = every, signals
        self.values = np.zeros(len(self.layout.names))
        self.instances: list[Instance] = []
        self.outputs: list[Block] = []
        self.inputs: list[Block] = []
        system = master.system
        for index, member in enumerate(system.members.values()):
            # interpreted FMUs report their exceptions only when they may log
            chatty = member.description.can("needsExecutionTool")
            instance = stack.enter_context(Instance(member.fmu, member.name, logging=chatty))
            instance.set(member.parameters)
            self.instances.append(instance)
            for blocks, spans, names in (
                (self.outputs, self.layout.outputs, self.layout.fetched),
                (self.inputs, self.layout.inputs, self.layout.given),
            ):
                view = self.values[spans[index, 0] : spans[index, 1]]
                variables = [member.description.variables[name] for name in names[index]]
                blocks.append(Block(instance, variables, view))
        self.rows = np.empty(((times.size - 1) // every + 1, len(observed)))
        self.row = 0
        self.bond_energy = np.zeros(len(self.layout.bonds))
        self.previous: list[float] = [0.0] * len(self.layout.bond_output)
        self.index = 0
        self.instants: list[float] = times.tolist()
        self.bound: kernel.Kernel | None = None

    # -- phases ----------------------------------------------------------------------------------

    def execute(self, count: int, progress: Callable[[float], None] | None) -> Recording:
        self.initialize()
        shown = max(count // 100, 1)
        try:
            advance = self.compiled() or self.interpreted()
            while self.index < count:
                advance(min(self.index + shown, count))
                if progress is not None:
                    progress(self.index / count)
            self.finish()
        except FmuCallError as error:
            time = float(self.times[self.index])
            text = f"run stopped at t = {time:.9g} s: {error}"
            raise StepError(
                text, error.messages, time=time, recording=self.recording(text)
            ) from error
        if progress is not None:
            progress(1.0)
        return self.recording("")

    def finish(self) -> None:
        """Operations at the end of the run."""
        for op, a, b in self.plan.final:
            self.do(Op(int(op)), int(a), int(b))

    def restart(self) -> None:
        """Return to the state before initialization, with the system's values set again."""
        self.values[:] = 0.0
        self.bond_energy[:] = 0.0
        self.previous = [0.0] * len(self.layout.bond_output)
        self.index = self.row = 0
        for instance, member in zip(
            self.instances, self.master.system.members.values(), strict=True
        ):
            instance.reset()
            instance.set(member.parameters)
        if self.bound is not None:
            self.bound.restart()

    def interpreted(self) -> Callable[[int], None]:
        """The executor in Python: communication steps up to an index."""
        step = [(Op(int(op)), int(a), int(b)) for op, a, b in self.plan.step]

        def advance(last: int) -> None:
            for self.index in range(self.index, last):  # noqa: B020 - continues where it stood
                for op, a, b in step:
                    self.do(op, a, b)
            self.index = last

        return advance

    def compiled(self) -> Callable[[int], None] | None:
        """The compiled executor, None if it is not wanted or not there."""
        wanted = self.master.executor
        if wanted not in ("auto", "c", "python"):
            raise ValueRangeError(f"executor {wanted!r}: must be auto, c or python")
        if wanted == "python" or (wanted == "auto" and kernel.find() is None):
            return None
        try:
            bound = kernel.Kernel(
                self.plan, self.instances, self.outputs, self.inputs, self.values, self.times,
                self.master.step, self.external, self.rows, self.bond_energy, self.every,
            )  # fmt: skip
        except FileNotFoundError as error:
            raise ValueRangeError(
                f"executor 'c': this machine has no {error}; 'cosim fmus build' compiles it"
            ) from None
        self.bound = bound

        def advance(last: int) -> None:
            status = bound.advance(last)
            self.index, self.row = int(bound.run.index), int(bound.run.row)
            if status:
                self.fail(bound, status)

        return advance

    def fail(self, bound: kernel.Kernel, status: int) -> None:
        """Raise what the executor in Python would have raised."""
        op, instance, part = bound.failed()
        if instance is None:
            self.record()
            return
        if op is Op.STEP:
            instance.time = self.instants[self.index]
            raise instance.failed_step(self.master.step, status)
        if op is Op.GET or self.index:  # it has stepped: where it is by its own count
            last = self.index if op is Op.GET else self.index - 1
            instance.time = self.instants[last] + self.master.step
        if status == kernel.UNFIT:
            raise self.inputs[self.instances.index(instance)].unfit(part)
        raise instance.failed_access(op is Op.GET, part, status)

    def initialize(self) -> None:
        """Initialize all instances together: exchange connected values until nothing changes."""
        start, stop = float(self.times[0]), float(self.times[-1])
        for instance, block in zip(self.instances, self.inputs, strict=True):
            instance.enter_initialization(start, stop, self.master.tolerance)
            block.get()  # inputs that nothing sets keep the FMU's start values
        sweep = [(Op(int(op)), int(a), int(b)) for op, a, b in self.plan.initial]
        before = np.full_like(self.values, np.nan)
        for _ in range(SWEEPS):
            for op, a, b in sweep:
                self.do(op, a, b)
            if np.array_equal(before, self.values):
                break
            change = np.abs(self.values - before)
            before = self.values.copy()
        else:
            size = np.maximum(np.abs(self.values), 1.0)
            if not np.all(change <= SETTLED * size):
                raise AlgebraicLoopError(self._unsettled(change))
        for instance in self.instances:
            instance.exit_initialization()
        for block in self.outputs:
            block.get()

    def _unsettled(self, change: Vector) -> str:
        system = self.master.system
        worst = int(np.nanargmax(change)) if np.any(np.isfinite(change)) else 0
        loops = system.algebraic_loops()
        text = (
            f"{system.name}: initial values do not settle in {SWEEPS} exchanges at "
            f"t = {self.times[0]:.9g} s; {self.layout.names[worst]} still changes by "
            f"{change[worst]:.3g}"
        )
        for loop in loops:
            text += "\nalgebraic loop:\n" + system.explain_loop(loop)
        return text + (
            "\nTake a component with a state in the loop (an elastic gearbox, a compliant contact)"
            if loops
            else "\nNo algebraic loop is declared; an FMU's declared dependencies may be wrong"
        )

    # -- operations --------------------------------------------------------------------------------

    def do(self, op: Op, a: int, b: int) -> None:
        layout, values = self.layout, self.values
        match op:
            case Op.SET:
                self.inputs[a].set()
            case Op.GET:
                self.outputs[a].get()
            case Op.STEP:
                self.instances[a].step(self.instants[self.index], self.master.step)
            case Op.COPY:
                values[layout.copy_target[a:b]] = (
                    values[layout.copy_source[a:b]] * layout.copy_gain[a:b]
                    + layout.copy_offset[a:b]
                )
            case Op.EXTERNAL:
                values[layout.external] = self.external[self.index]
            case Op.RECORD:
                self.record()
            case Op.ENERGY:
                self.account()

    def record(self) -> None:
        layout, values = self.layout, self.values
        self.previous = values[layout.bond_output].tolist()
        if self.index % self.every:
            return
        row = values[layout.record_source] * layout.record_gain + layout.record_offset
        if not np.isfinite(row).all():
            name = self.observed[int(np.flatnonzero(~np.isfinite(row))[0])]
            value = row[self.observed.index(name)]
            raise FmuCallError(f"{name} became {value} without an error of its FMU")
        self.rows[self.row] = row
        self.row += 1

    def account(self) -> None:
        """Trapezoid of output times held input, in a fixed order of summation."""
        layout = self.layout
        outputs = self.values[layout.bond_output].tolist()
        inputs = self.values[layout.bond_input].tolist()
        half = 0.5 * self.master.step
        for term, bond in enumerate(layout.bond_index.tolist()):
            mean = self.previous[term] + outputs[term]
            self.bond_energy[bond] += layout.bond_sign[term] * inputs[term] * mean * half

    def recording(self, error: str) -> Recording:
        return Recording(
            time=self.times[:: self.every][: self.row].copy(),
            values=self.rows[: self.row].copy(),
            names=tuple(self.observed),
            units={name: self.master.system.unit(name) for name in self.observed},
            provenance={
                **self.master.provenance(),
                "inputs": {name: signal.text for name, signal in self.signals.items()},
                "fmu_steps": self.index * len(self.instances),
            },
            bond_energy={
                bond.name: float(energy)
                for bond, energy in zip(self.layout.bonds, self.bond_energy, strict=True)
            },
            error=error,
        )
