"""The executor in Python, the reference: each operation of a plan is a few lines of Python."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import AlgebraicLoopError, EndRequest, FmuCallError
from ..fmu.assignment import Assignment
from ..fmu.attributes import INTEGERS
from ..fmu.exchange import Block
from ..fmu.instance import Instance
from ..fmu.intermediate import Moved
from ..fmu.variables import Variable
from .extrapolation import continuous, derivatives_at_begin, mean_of_part, mean_of_step
from .input_derivatives import InputDerivatives, asked_for
from .newton import Newton, floor
from .objects import ObjectPassing
from .outline import Outline
from .plan import PARTS, Loop, Mean, Op, decoded

Vector = NDArray[np.float64]
ROUNDING = 1e-9
"""Part of a step by which its end may miss the end of the run: sums of steps round by far less."""


class Shared(Protocol):
    """Memory that the process of a run shares with the one that waits for it: see `witness`."""

    def compiled(self, run: Any) -> Any:
        """The compiled executor's structure with the same content, in shared memory."""

    def list_calls(
        self, calls: Sequence[tuple[int, int]], derivatives: Sequence[tuple[int, int]]
    ) -> None:
        """Operation and instance of each call of the compiled executor."""

    def enter(self) -> None:
        """Note the thread that goes on with the run."""


class Interpreter:
    """The FMUs of a run, the values that they exchange, and what each operation does to them.

    Args:
        outline: of the run.
        stack: ends the FMUs' instances.
        update: address of compiled code that answers FMUs which ask for inputs within a step, 0:
            the answers are made in Python.

    Attributes:
        values, objects: one per slot of the plan's layout.
        instances, outputs, inputs: the FMUs and the blocks through which they exchange values.
        index: communication point at which the run stands.
        rows, row: recorded values, and how many rows there are.
        passes: whether values travel as objects.
        beside: communication point of the last row if it is none of every n-th, else None.
        noted: communication point whose values stand behind the last row.
        bond_energy, bond_turnover: energy that each bond invented, and that went over it [J].
        newtons: one per algebraic loop.
        history, past: of extrapolated inputs, newest first, and how many values it has before the
            first step.
        derivatives: derivatives of the inputs that move within a step.
        sparse: nobody looks at what is only recorded but where it is, and where a call ends; the
            compiled executor fetches it there only.
        bond_mean: per term of the bonds the mean of its input, -1 where it does not move.
    """

    witness: Shared | None = None
    """What another process learns of the run."""

    def __init__(self, outline: Outline, stack: ExitStack, update: int = 0) -> None:
        self.outline, self.system, self.step = outline, outline.system, outline.step
        self.plan, self.layout = outline.plan, outline.plan.layout
        self.external, self.times, self.every = outline.external, outline.times, outline.every
        self.values = np.zeros(len(self.layout.names))
        self.objects = np.full(len(self.layout.names), None, dtype=object)
        self.instances: list[Instance] = []
        self.outputs: list[Block] = []
        self.inputs: list[Block] = []
        asked = asked_for(self.plan, self.system)
        for index, member in enumerate(self.system.members.values()):
            # interpreted FMUs report their exceptions only when they may log
            chatty = member.description.can("needsExecutionTool")
            moved = Moved(asked[index], update) if asked[index] else None
            instance = stack.enter_context(
                Instance(member.fmu, member.name, logging=chatty, moved=moved)
            )
            instance.set(member.parameters)
            self.instances.append(instance)
            for blocks, spans, names in (
                (self.outputs, self.layout.outputs, self.layout.fetched),
                (self.inputs, self.layout.inputs, self.layout.given),
            ):
                span = slice(*spans[index].tolist())
                variables = [member.description.variables[name] for name in names[index]]
                if blocks is self.inputs:
                    variables = [self._exact(member.name, variable) for variable in variables]
                blocks.append(Block(instance, variables, self.values[span], self.objects[span]))
        origins = {c.target: c.source for c in self.system.connections}
        origins.update({name: signal.text for name, signal in outline.signals.items()})
        for block, owner in zip(self.inputs, self.system.members, strict=True):
            block.origins = [origins.get(f"{owner}.{name}", "") for name in block.names]
        self.passing = ObjectPassing(self.layout, outline.observed, outline.objects)
        self.passes = bool(self.passing)
        self.rows = np.empty((outline.capacity, len(outline.observed)))
        self.row = self.index = 0
        self.beside: int | None = None
        self.noted = -1
        self.bond_energy = np.zeros(len(self.layout.bonds))
        self.bond_turnover = np.zeros(len(self.layout.bonds))
        self.previous: list[float] = [0.0] * len(self.layout.bond_output)
        floors = floor(self.system, self.layout.names)
        self.newtons = [Newton(floors[loop.sources], loop.single) for loop in self.plan.loops]
        self.history = np.zeros((4, len(self.plan.means)))
        self.past = np.zeros(1, dtype=np.int64)
        self.derivatives = InputDerivatives(self.plan, self.instances, self.values)
        self.held = np.zeros(len(self.layout.bond_input))
        moving = {mean.target: i for i, mean in enumerate(self.plan.means) if mean.moving}
        self.bond_mean = [moving.get(slot, -1) for slot in self.layout.bond_input.tolist()]
        self.started = self.sparse = False
        self._given: dict[int, Mapping[str, Any]] = {}
        self._assignments: dict[int, Assignment] = {}

    @cached_property
    def _integers(self) -> set[str]:
        """Inputs that get integers as they are."""
        return {
            wire.target
            for wire in self.system.connections
            if (wire.gain, wire.offset) == (1.0, 0.0)
            and self.system.declaration(wire.source).type in INTEGERS
        }

    def _exact(self, instance: str, variable: Variable) -> Variable:
        """An input, which refuses what it does not carry if only integers come."""
        if variable.type != "Float32":
            return variable
        whole = {f"{instance}.{name}" for name in variable.elements()} <= self._integers
        return replace(variable, type="Float32Whole") if whole else variable

    @cached_property
    def instants(self) -> list[float]:
        """Communication points as the executor in Python takes them: a compiled one needs none."""
        return list(self.times.tolist())

    def communication_step(self, step: Sequence[tuple[Op, int, int]], begin: int = 0) -> None:
        """The operations of one communication step, from the one numbered `begin`.

        Raises:
            EndRequest: an FMU asked to end the simulation. If it went to the end of the step, the
                others have done so, too, and the run stands there.
        """
        end = None
        for op, a, b in step[begin:]:
            try:
                self.do(op, a, b)
            except EndRequest as request:
                if op is not Op.STEP or not self.completes(request):
                    raise
                end = end or request
        self.index += 1
        if end is not None:
            end.complete = True
            raise end

    def completes(self, request: EndRequest) -> bool:
        """Whether an FMU asked to end where the present step ends, to rounding."""
        end = self.instants[self.index + 1]  # start + step * number, FMUs count from the last one
        return request.time >= end - ROUNDING * self.step - 2.0 * math.ulp(end)

    def restart(self) -> None:
        """Return to the state before initialization, with the system's values set again."""
        self.values[:] = 0.0
        self.bond_energy[:] = 0.0
        self.bond_turnover[:] = 0.0
        self.previous = [0.0] * len(self.layout.bond_output)
        self.index = self.row = 0
        self.beside = None
        self.passing.restart()
        self.past[0] = 0
        self.started = False
        for newton in self.newtons:
            newton.valid[0] = 0
        for index, member in enumerate(self.system.members.values()):
            instance = self.instances[index]
            instance.reset()
            if self._given.get(index) != member.parameters:
                self._given[index] = dict(member.parameters)
                self._assignments[index] = Assignment(instance, member.parameters)
            self._assignments[index].give()

    def size(self, time: float, step: float) -> float:
        """A step that does not miss the end of the run by rounding, and never goes beyond."""
        end = self.outline.end
        if time + step > end - ROUNDING * step:
            step = end - time
            while time + step > end:
                step = math.nextafter(step, 0.0)
        return step

    # -- operations ------------------------------------------------------------------------------

    def do(self, op: Op, a: int, b: int) -> None:
        """One operation of a plan."""
        layout, values = self.layout, self.values
        match op:
            case Op.SET:
                self.inputs[a].set()
            case Op.GET:
                self.outputs[a].get()
            case Op.STEP:
                time, step = self.instants[self.index], self.step
                if self.index >= self.times.size - 2:
                    step = self.size(time, step)
                self.instances[a].step(time, step)
            case Op.COPY:
                values[layout.copy_target[a:b]] = (
                    values[layout.copy_source[a:b]] * layout.copy_gain[a:b]
                    + layout.copy_offset[a:b]
                )
                if self.passes:
                    self.passing.copy(self.values, self.objects, a, b)
            case Op.EXTERNAL:
                values[layout.external] = self.external[self.index]
                if self.passes:
                    self.passing.drive(self.objects, self.index)
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
            case Op.NOTE:
                self.history[1:] = self.history[:-1].copy()
                self.history[0] = [values[mean.source] for mean in self.plan.means]
            case Op.EXTRAPOLATE:
                for index in range(a, b):
                    self.extrapolate(index, self.plan.means[index])
            case Op.SET_DERIVATIVES:
                self.derivatives.tell(a, b)
            case Op.MOVE:
                self.move(a, *divmod(b, PARTS))
            case Op.SUBSTEP:
                parts, part = divmod(b, PARTS)
                time = self.instants[self.index] + part * self.step / parts
                self.instances[a].step(time, self.size(time, self.step / parts))

    def extrapolate(self, index: int, mean: Mean) -> None:
        """Let an input follow the polynomial through the last values of its source."""
        past, now = self.history[:, index].tolist(), float(self.values[mean.source])
        known = self.index + int(self.past[0]) + mean.ahead  # values before the newest
        order = min(mean.order, known, 1 if known < 3 else 2)  # a parabola looks at four
        if mean.bonded or not mean.moving:
            average = mean_of_step(order, mean.ahead, now, past) * mean.gain + mean.offset
            self.derivatives.average[index] = average
        if not mean.moving:
            self.values[mean.target] = average
            return
        slope, curve = derivatives_at_begin(order, mean.ahead, now, past, self.step)
        self.values[mean.target] = past[0] * mean.gain + mean.offset
        self.derivatives.slope[index] = slope * mean.gain
        self.derivatives.curve[index] = curve * mean.gain

    def move(self, index: int, parts: int, part: int) -> None:
        """Let an input take its mean over a part of the step."""
        mean, derivatives = self.plan.means[index], self.derivatives
        begin = float(self.history[0, index]) * mean.gain + mean.offset
        slope, curve = float(derivatives.slope[index]), float(derivatives.curve[index])
        self.values[mean.target] = mean_of_part(begin, slope, curve, self.step, parts, part)

    def record(self) -> None:
        """Keep observed values if it is their turn; note outputs for the energy of bonds.

        Otherwise they stand behind the last row, and are one if the run ends within the next step.
        """
        layout, values = self.layout, self.values
        self.previous = values[layout.bond_output].tolist()
        row = values[layout.record_source] * layout.record_gain + layout.record_offset
        if self.index % self.every == 0:
            self.keep(row)
            return
        self.rows[self.row] = row
        self.noted = self.index
        if self.passes:
            self.passing.note(self.objects)

    def keep_last(self, *, present: bool) -> None:
        """Keep a last row although it is not its turn.

        Args:
            present: with the present values; otherwise with those of the last communication point,
                from which some FMUs have gone on.
        """
        layout = self.layout
        if not self.index % self.every:
            return
        if present:
            self.keep(self.values[layout.record_source] * layout.record_gain + layout.record_offset)
        elif self.noted == self.index:
            self.row += 1
            if self.passes:
                self.passing.keep_noted()
        else:
            return
        self.beside = self.index

    def recorded_times(self) -> Vector:
        """Times of the rows [s]."""
        return self.outline.recorded_times(self.row, self.beside)

    def keep(self, row: Vector) -> None:
        """Add a row to the recording."""
        if not np.isfinite(row).all():
            name = self.outline.observed[int(np.flatnonzero(~np.isfinite(row))[0])]
            value = row[self.outline.observed.index(name)]
            raise FmuCallError(f"{name} became {value} without an error of its FMU")
        self.rows[self.row] = row
        self.row += 1
        if self.passes:
            self.passing.keep(self.objects)

    def account(self, held: Vector) -> None:
        """Trapezoid of output times held input, in a fixed order of summation."""
        layout = self.layout
        outputs = self.values[layout.bond_output].tolist()
        inputs = held.tolist()
        half = 0.5 * self.step
        for term, bond in enumerate(layout.bond_index.tolist()):
            mean = self.previous[term] + outputs[term]
            part = layout.bond_sign[term] * inputs[term] * mean * half
            self.bond_energy[bond] += part
            self.bond_turnover[bond] += 0.5 * abs(part)

    # -- algebraic loops -------------------------------------------------------------------------

    def solve(self, index: int) -> None:
        """Solve an algebraic loop."""
        loop, newton, values = self.plan.loops[index], self.newtons[index], self.values
        sweep = decoded(loop.sweep)

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
        declared = [self.system.declaration(name) for name in layout.names]
        if not all(continuous(declared[slot]) for slot in loop.sources):
            return None
        copied = [s for a in members for s in range(*layout.copies[a].tolist())]
        needed = {*loop.sources.tolist(), *layout.copy_source[copied].tolist()}
        jacobian = np.zeros((loop.sources.size, loop.sources.size))
        for column in range(loop.sources.size):
            tangent = np.zeros(self.values.size)
            tangent[loop.sources[column]] = 1.0
            for a in members:
                first, last = layout.copies[a]
                targets, sources = layout.copy_target[first:last], layout.copy_source[first:last]
                tangent[targets] = tangent[sources] * layout.copy_gain[first:last]
                seeded = [int(slot) for slot in targets if tangent[slot] != 0.0]
                # others, which are recorded alone, may have no derivative
                fetched = [s for s in range(*layout.outputs[a].tolist()) if s in needed]
                fetched = [slot for slot in fetched if continuous(declared[slot])]
                if not (seeded and fetched):
                    tangent[fetched] = 0.0
                    continue
                if any(declared[slot].dimensions for slot in (*fetched, *seeded)):
                    return None  # FMI has them of whole arrays only
                name = len(layout.instances[a]) + 1
                tangent[fetched] = self.instances[a].directional_derivative(
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
            f"{self.system.name}: an algebraic loop has no solution that Newton's method "
            f"finds (unknown: {names}) at t = {self.instants[self.index]:.9g} s\n"
            f"algebraic loop:\n{self.plan.loops[index].text}\n"
            "Take a component with a state in the loop (an elastic gearbox, a compliant contact)"
        )
