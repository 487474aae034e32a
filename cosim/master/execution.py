"""One execution of a plan: creates the FMUs, initializes them together, makes the steps.

The executor in Python is the reference: each operation of `plan.Op` is a few lines of Python.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..data.recording import Recording
from ..data.signals import Signal
from ..errors import AlgebraicLoopError, FmuCallError, StepError, ValueRangeError
from ..fmu.exchange import Block
from ..fmu.instance import Instance
from . import kernel
from .algebraic_loops import Newton
from .input_derivatives import InputDerivatives, bend
from .iteration import Iterated
from .plan import PARTS, Loop, Mean, Op, Plan
from .startup import find_past
from .step_control import StepControl

if TYPE_CHECKING:
    from .master import Master

Vector = NDArray[np.float64]
SWEEPS = 100
"""Exchanges during initialization before a loop is said not to settle."""
LOOPED = 1e-9
"""The same where loops are solved: they are to 1e-10, and other outputs follow from them."""
PATIENCE = 25
"""Exchanges before algebraic loops are solved by Newton's method during initialization."""
RUNAWAY = 1e12
"""Size of a value from which on exchanges are given up."""
SETTLED = 1e-12
"""Relative change at which an algebraic loop counts as settled during initialization."""


class Execution:
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
        self.bound: kernel.Kernel | None = None
        self.newtons = [Newton(loop.sources.size) for loop in plan.loops]
        self.history = np.zeros((len(plan.means), 4))
        self.past = np.zeros(1, dtype=np.int64)  # values in the history before the first step
        self.derivatives = InputDerivatives(plan, self.instances)
        self.held = np.zeros(len(self.layout.bond_input))
        moving = {mean.target: i for i, mean in enumerate(plan.means) if mean.moving}
        self.bond_mean = [moving.get(slot, -1) for slot in self.layout.bond_input.tolist()]
        self.iterated: Iterated | None = None
        self.control: StepControl | None = None
        self.started = False
        self._advance: Callable[[int], None] | None = None

    @cached_property
    def instants(self) -> list[float]:
        """Communication points as the executor in Python takes them: a compiled one needs none."""
        return list(self.times.tolist())

    # -- phases ----------------------------------------------------------------------------------

    def execute(self, count: int, progress: Callable[[float], None] | None) -> Recording:
        """The whole run.

        Raises:
            AlgebraicLoopError: initial values do not settle.
            StepError: an FMU failed; carries the recording up to then.
        """
        self.initialize()
        shown = max(count // 100, 1)
        try:
            find_past(self)
            advance = self.executor()
            while self.index < count:
                advance(min(self.index + shown, count))
                if progress is not None:
                    progress(self.index / count)
            self.finish()
        except (FmuCallError, AlgebraicLoopError) as error:
            time = float(self.times[self.index])
            text = f"run stopped at t = {time:.9g} s: {error}"
            messages = error.messages if isinstance(error, FmuCallError) else ()
            raise StepError(text, messages, time=time, recording=self.recording(text)) from error
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
        self.past[0] = 0
        self.started = False
        if self.iterated is not None:
            self.iterated.restart()
        if self.control is not None:
            self.control.restart()
        for newton in self.newtons:
            newton.valid[0] = 0
        for instance, member in zip(
            self.instances, self.master.system.members.values(), strict=True
        ):
            instance.reset()
            instance.set(member.parameters)
        if self.bound is not None:
            self.bound.restart()

    def executor(self) -> Callable[[int], None]:
        """What makes communication steps up to an index; made once."""
        if self._advance is None:
            self._advance = self._make_executor()
        return self._advance

    def _make_executor(self) -> Callable[[int], None]:
        settings = self.plan.iteration
        if settings is None:
            return self.compiled() or self.interpreted()
        if self.master.executor == "c":
            raise ValueRangeError(
                f"executor 'c': algorithm {self.plan.algorithm!r} repeats steps, which the one "
                "in Python does; take executor auto"
            )
        if settings.adaptive:
            self.control = StepControl(self, settings)
            return self.control.advance
        self.iterated = Iterated(self, settings)
        return self.interpreted()

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
                self.newtons, self.history, self.past, self.derivatives, self.bond_mean,
            )  # fmt: skip
        except FileNotFoundError as error:
            raise ValueRangeError(
                f"executor 'c': this machine has no {error}; 'cosim fmus build' compiles it"
            ) from None
        self.bound = bound

        def advance(last: int) -> None:
            self._ended(bound.advance(last))

        return advance

    def advance_within(self, last: int, limit: float, most: float) -> int:
        """Steps up to `last` by the compiled executor, and what ended them early (see `Kernel`)."""
        assert self.bound is not None
        return self._ended(self.bound.advance_within(last, limit, most))

    def _ended(self, status: int) -> int:
        """Where the compiled executor is; what has not failed goes through."""
        bound = self.bound
        assert bound is not None
        self.index, self.row = int(bound.run.index), int(bound.run.row)
        if status and status not in (kernel.TOO_LONG, kernel.TOO_LARGE):
            self.fail(bound, status)
        return status

    def fail(self, bound: kernel.Kernel, status: int) -> None:
        """Raise what the executor in Python would have raised."""
        if status == kernel.UNSETTLED:
            raise self.unsolved(int(bound.run.failed_loop))
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
        if op is Op.SET_DERIVATIVES:
            raise instance.failed_derivatives(part, status)
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
        begin = self.values.copy()
        settled, change = self.exchange(sweep, PATIENCE if self.newtons else SWEEPS, SETTLED)
        if not settled and self.newtons:
            self.values[:] = begin
            self.exchange(sweep, 1, SETTLED)
            solving = [(Op(int(op)), int(a), int(b)) for op, a, b in self.plan.solving]
            settled, change = self.exchange(solving, SWEEPS, LOOPED)
            for index in range(len(self.instances)):
                self.do(Op.COPY, *self.layout.copies[index].tolist())
                self.do(Op.SET, index, 0)
        if not settled:
            raise AlgebraicLoopError(self._unsettled(change))
        for instance in self.instances:
            instance.exit_initialization()
        for block in self.outputs:
            block.get()
        self.started = True

    def exchange(
        self, sweep: list[tuple[Op, int, int]], sweeps: int, tolerance: float
    ) -> tuple[bool, Vector]:
        """Exchange connected values until nothing changes: whether they settled, last change."""
        before = np.full_like(self.values, np.nan)
        change, size = before, np.ones_like(before)
        for _ in range(sweeps):
            for op, a, b in sweep:
                self.do(op, a, b)
            if np.array_equal(before, self.values):
                return True, change
            change, size = np.abs(self.values - before), np.maximum(np.abs(self.values), 1.0)
            before = self.values.copy()
            if tolerance > SETTLED and bool(np.all(change <= tolerance * size)):
                return True, change
            if self.newtons and np.any(size > RUNAWAY):
                return False, change
        return bool(np.all(change <= tolerance * size)), change

    def solve(self, index: int) -> None:
        """Solve an algebraic loop."""
        loop, newton, values = self.plan.loops[index], self.newtons[index], self.values
        sweep = [(Op(int(op)), int(a), int(b)) for op, a, b in loop.sweep]

        def around(z: list[float]) -> list[float]:
            values[loop.sources] = z
            for op, a, b in sweep:
                self.do(op, a, b)
            found: list[float] = values[loop.sources].tolist()
            return found

        z = values[loop.sources].tolist()
        if not newton.valid[0] and not self.started:
            around(z)
            jacobian = self.around_derivative(loop)
            if jacobian is not None:
                newton.keep(jacobian)
        if not newton.solve(around, z):
            raise self.unsolved(index)
        values[loop.sources] = z  # the solution; solving again then changes nothing

    def around_derivative(self, loop: Loop) -> Vector | None:
        """dG/dz of a loop from the FMUs' directional derivatives; None if one has none."""
        layout = self.layout
        members = dict.fromkeys(a for op, a, _ in loop.sweep.tolist() if op == Op.GET)
        for a in members:
            instance = self.instances[a]
            if not instance.description.can("providesDirectionalDerivatives"):
                return None
        jacobian = np.zeros((loop.sources.size, loop.sources.size))
        for column in range(loop.sources.size):
            tangent = np.zeros(self.values.size)
            tangent[loop.sources[column]] = 1.0
            for a in members:
                first, last = layout.copies[a]
                targets, sources = layout.copy_target[first:last], layout.copy_source[first:last]
                tangent[targets] = tangent[sources] * layout.copy_gain[first:last]
                seeded = [int(slot) for slot in targets if tangent[slot] != 0.0]
                fetched = range(*layout.outputs[a].tolist())
                if not seeded:
                    tangent[fetched.start : fetched.stop] = 0.0
                    continue
                name = len(layout.instances[a]) + 1
                tangent[fetched.start : fetched.stop] = self.instances[a].directional_derivative(
                    [layout.names[slot][name:] for slot in fetched],
                    [layout.names[slot][name:] for slot in seeded],
                    tangent[seeded],
                )
            jacobian[:, column] = tangent[loop.sources]
        return jacobian if np.isfinite(jacobian).all() else None

    def unsolved(self, index: int) -> AlgebraicLoopError:
        """The error for a loop without a solution."""
        names = ", ".join(self.layout.names[slot] for slot in self.plan.loops[index].sources)
        return AlgebraicLoopError(
            f"{self.master.system.name}: an algebraic loop has no solution that Newton's method "
            f"finds (unknown: {names}) at t = {self.instants[self.index]:.9g} s\n"
            f"algebraic loop:\n{self.plan.loops[index].text}\n"
            "Take a component with a state in the loop (an elastic gearbox, a compliant contact)"
        )

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
        """One operation of a plan."""
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
                self.account(self.held if a == 1 else values[layout.bond_input])
            case Op.HOLD:
                self.held = values[layout.bond_input]
                for term, index in enumerate(self.bond_mean):
                    if index >= 0:
                        self.held[term] = self.derivatives.average[index]
            case Op.SOLVE:
                self.solve(a)
            case Op.ITERATE:
                if self.iterated is not None:
                    self.iterated.step()
            case Op.NOTE:
                self.history[:, 1:] = self.history[:, :-1].copy()
                self.history[:, 0] = [values[mean.source] for mean in self.plan.means]
            case Op.EXTRAPOLATE:
                for index in range(a, b):
                    self.extrapolate(index, self.plan.means[index])
            case Op.SET_DERIVATIVES:
                self.derivatives.tell(a, b)
            case Op.SUBSTEP:
                parts, part = divmod(b, PARTS)
                size = self.master.step
                time = self.instants[self.index] + part * size / parts
                self.instances[a].step(time, size / parts)

    def extrapolate(self, index: int, mean: Mean) -> None:
        """Let an input follow the polynomial through the last values of its source."""
        past = self.history[index].tolist()
        if mean.bonded or not mean.moving:
            average = self.mean(mean, past) * mean.gain + mean.offset
            self.derivatives.average[index] = average
        if not mean.moving:
            self.values[mean.target] = average
            return
        slope, curve = self.slopes(mean, past)
        self.values[mean.target] = past[0] * mean.gain + mean.offset
        self.derivatives.slope[index] = slope * mean.gain
        self.derivatives.curve[index] = curve * mean.gain

    def slopes(self, mean: Mean, past: list[float]) -> tuple[float, float]:
        """Derivatives at the begin of the step of the polynomial through the last values."""
        now, inverse = float(self.values[mean.source]), 1.0 / self.master.step
        order = min(mean.order, self.index + int(self.past[0]) + mean.ahead)
        if order == 0:
            return 0.0, 0.0
        if order == 1:
            return (now - past[0] if mean.ahead else past[0] - past[1]) * inverse, 0.0
        half, square = 0.5 * inverse, inverse * inverse
        if mean.ahead:
            second = bend(now, *past[:3])
            return (2.0 * (now - past[0]) - second) * half, second * square
        second = bend(*past)
        return (2.0 * (past[0] - past[1]) + second) * half, second * square

    def mean(self, mean: Mean, past: list[float]) -> float:
        """Mean over the step of the polynomial through the last values of a source."""
        now = float(self.values[mean.source])
        order = min(mean.order, self.index + int(self.past[0]) + mean.ahead)
        if mean.ahead:
            if order == 1:
                return 0.5 * (now + past[0])
            return 0.5 * (now + past[0]) - bend(now, *past[:3]) / 12.0
        if order == 0:
            return past[0]
        if order == 1:
            return 1.5 * past[0] - 0.5 * past[1]
        return past[0] + 0.5 * (past[0] - past[1]) + 5.0 * bend(*past) / 12.0

    def record(self) -> None:
        """Keep observed values if it is their turn; note outputs for the energy of bonds."""
        layout, values = self.layout, self.values
        self.previous = values[layout.bond_output].tolist()
        if self.index % self.every:
            return
        self.keep(values[layout.record_source] * layout.record_gain + layout.record_offset)

    def keep(self, row: Vector) -> None:
        """Add a row to the recording."""
        if not np.isfinite(row).all():
            name = self.observed[int(np.flatnonzero(~np.isfinite(row))[0])]
            value = row[self.observed.index(name)]
            raise FmuCallError(f"{name} became {value} without an error of its FMU")
        self.rows[self.row] = row
        self.row += 1

    def account(self, held: Vector) -> None:
        """Trapezoid of output times held input, in a fixed order of summation."""
        layout = self.layout
        outputs = self.values[layout.bond_output].tolist()
        inputs = held.tolist()
        half = 0.5 * self.master.step
        for term, bond in enumerate(layout.bond_index.tolist()):
            mean = self.previous[term] + outputs[term]
            self.bond_energy[bond] += layout.bond_sign[term] * inputs[term] * mean * half

    def steps(self) -> int:
        """Steps of the whole system that were made, repeated ones too."""
        if self.control is not None:
            return 3 * (self.control.taken + self.control.rejected)
        return self.iterated.repetitions if self.iterated is not None else self.index

    def recording(self, error: str) -> Recording:
        """What was recorded so far."""
        return Recording(
            time=self.times[:: self.every][: self.row].copy(),
            values=self.rows[: self.row].copy(),
            names=tuple(self.observed),
            units={name: self.master.system.unit(name) for name in self.observed},
            provenance={
                **self.master.provenance(),
                "inputs": {name: signal.text for name, signal in self.signals.items()},
                "fmu_steps": self.steps() * len(self.instances),
                **({"step_control": self.control.report()} if self.control else {}),
            },
            bond_energy={
                bond.name: float(energy)
                for bond, energy in zip(self.layout.bonds, self.bond_energy, strict=True)
            },
            error=error,
        )
