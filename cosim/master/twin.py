"""A system that is stepped from outside: set inputs, go on, get outputs; save, return, fork.

    with Twin(Master(system)) as twin:
        twin.set("motor.w_ref", 50.0)
        twin.step(0.01)
        twin.get("load.w")

The executors, plans and values are those of `Master.run`, and so are the results, bit for bit. What
is not modelled: a twin does not know what its inputs will be. The trial steps with which a run with
extrapolation begins (`startup`) look at the inputs of the second communication point; a twin holds
those of the first there.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..arguments import need_number, wrong
from ..data.recording import Recording
from ..data.signals import is_signal
from ..errors import (
    AlgebraicLoopError,
    EndRequest,
    FmuCallError,
    GraphError,
    StepError,
    ValueRangeError,
)
from ..fmu.surroundings import Surroundings
from ..system.inputs import Driver
from .access import Access, held, whole_steps
from .driven import DrivenInputs
from .execution import Execution
from .initialization import initialize
from .kernel.stepper import Compiled
from .master import Master
from .memory import Memory, Saved
from .plan import Op, decoded

Vector = NDArray[np.float64]
WINDOW = 4096
"""Communication points for which an endless twin has room at a time."""


class Twin:
    """A system in steps.

    Args:
        master: system, algorithm and communication step.
        duration: how far it can go [s]; infinite by default. Inputs that are tables are then held
            beyond their ends.
        inputs, record, every, start: as of `Master.run`.
        about: what the provenance of its recordings says besides.

    Attributes:
        ended: the words of an FMU that asked to end, "" if none did.

    Raises:
        InputError: as of `Master.run`; the algorithm looks ahead, which a twin cannot.
    """

    def __init__(
        self,
        master: Master,
        duration: float = math.inf,
        *,
        inputs: Mapping[str, Driver] | None = None,
        record: Sequence[str] | None = None,
        every: int = 1,
        start: float = 0.0,
        about: Mapping[str, Any] | None = None,
    ) -> None:
        if not isinstance(master, Master):
            way = 'write Twin(Master(system)), or cosim.open("motor_bench/ST1") for a scenario'
            raise wrong("the master of a Twin", master, "a Master", way)
        need_number("the duration of a Twin", duration, "give it in seconds")
        self._made = (master, duration, inputs, record, every, start, about)
        self.master, endless = master, duration == math.inf
        if endless:
            duration = math.ceil(WINDOW / every) * every * master.step
            inputs = {name: held(driver) for name, driver in (inputs or {}).items()}
        outline = master.outline(duration, inputs=inputs, record=record, every=every, start=start)
        if endless and outline.plan.layout.objects.any():
            raise ValueRangeError(
                "an endless twin cannot pass on texts and integers of 64 bits; give it a duration"
            )
        self._outline = replace(outline, endless=endless)
        self._start = start
        self._stack = ExitStack()
        self._failed = self.ended = ""
        self._begun = self._closed = False
        self._base = self._taken = 0
        self._blocks: list[tuple[Vector, Vector]] = []
        self._saved: list[Saved] = []
        self._told: set[str] = set()
        self._final: Recording | None = None
        try:
            self._execution = Execution(self._outline, self._stack)
            self._run = self._execution.run
            self._stepper = self._execution.prepare()
            if self._stepper.looks_ahead:
                raise ValueRangeError(
                    f"algorithm {outline.plan.algorithm!r} looks ahead to the next change of an "
                    "input, which a twin cannot know; take gauss_seidel, jacobi or iterated"
                )
            self._access = Access(self._run, tuple(self._outline.signals))
            self._inputs = DrivenInputs(master, self._run)
        except BaseException:
            self._stack.close()
            raise

    # -- values ----------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Where the twin stands [s]."""
        return float(self._run.times[self._run.index])

    @property
    def end(self) -> float:
        """How far it can go [s]; may be infinite."""
        return self._outline.end

    @property
    def recorded(self) -> tuple[str, ...]:
        """Full scalar names of the signals that are recorded."""
        return self._outline.observed

    def inputs(self) -> dict[str, str]:
        """What `set` takes besides tunable parameters -> its unit: inputs that no FMU drives."""
        system = self.master.system
        return {name: system.unit(name) for name in system.open_inputs()}

    def outputs(self) -> dict[str, str]:
        """All outputs -> their units; `get` takes every variable."""
        return {name: self.unit(name) for name in self.master.system.signals()}

    def unit(self, name: str) -> str:
        """The unit in which `set` takes and `get` gives a variable, "" if it declares none.

        Raises:
            UnknownNameError: with the nearest names.
        """
        return self.master.system.unit(self.master.system.elements(name)[0])

    def set(self, name: str, value: Any, unit: str = "") -> None:
        """Give an input a value from now on, until it is set again.

        Before the first step it counts in the initialization, as an input of a run does.

        Args:
            name: an input that no FMU drives, or a tunable parameter; whole or an element.
            value: a number (a list for a vector), in the variable's unit; or a signal over the
                twin's time, for an input that the twin was opened with.
            unit: of the value, if it is another one.

        Raises:
            UnknownNameError: no such variable, or none that can be set; with the nearest names.
            GraphError: an FMU drives it.
            UnitError: the unit does not convert.
            ValueRangeError: out of bounds, or not finite.
        """
        self._check_open()
        target = self._access.target(name)
        if is_signal(value):
            if target.columns is None or len(target.columns) != 1:
                raise GraphError(
                    f"{name} takes no signal: the twin was not opened with something that drives "
                    "it, or it is a vector; set numbers, or open the twin with inputs"
                )
            self._inputs.set(target.columns[0], value)
            self._told.add(name)
            return
        if unit:
            value = self._access.convert(name, value, unit, into=True)
        self._access.put(name, value, self._inputs)
        self._told.add(name)

    def get(self, name: str, unit: str = "") -> Any:
        """The present value of any variable: a float, an array of a vector, a text.

        An output that follows an input directly shows the input of the step that has ended; the
        recording has it with the input of the same time.

        Args:
            name: `instance.variable`.
            unit: in which to give it, if not the variable's own.

        Raises:
            UnknownNameError: with the nearest names.
            UnitError: the unit does not convert.
        """
        self._begin()
        source = self._access.source(name)
        if source.slot >= 0:
            value: Any = float(self._run.values[source.slot] * source.gain + source.offset)
        elif source.column >= 0:
            value = self._inputs.get(source.column)
        else:
            value = self._access.fetch(source)
        return self._access.convert(name, value, unit, into=False) if unit else value

    # -- going on --------------------------------------------------------------------------------

    def step(self, duration: float | None = None) -> float:
        """Go on by a duration; the new time [s].

        Args:
            duration: a whole number of communication steps [s]; one if not given.

        Raises:
            ValueRangeError: no whole number of steps, or beyond the end.
            StepError: an FMU failed; carries the recording up to then. The twin can return to a
                saved state, or be closed.
        """
        left = 1 if duration is None else whole_steps(duration, self._run.step)
        self._begin()
        self._check_alive()
        run = self._run
        if not self._outline.endless and run.index + left > self._outline.count:
            raise ValueRangeError(
                f"a step of {left * run.step:.9g} s from t = {self.time:.9g} s goes beyond the end "
                f"at {self.end:.9g} s; open the twin with a longer duration, or duration=math.inf"
            )
        try:
            try:
                self._go(left)
            except EndRequest as request:  # an end that an FMU asks for is one
                self.ended = str(request)
                self._execution.finish(request)
        except (FmuCallError, AlgebraicLoopError) as error:
            self._failed = str(error)
            stopped = self._execution.stopped(error, keep=False)
            raise StepError(
                str(stopped), stopped.messages, time=stopped.time, recording=self.recording
            ) from error
        return self.time

    def _go(self, left: int) -> None:
        """Make some communication steps."""
        run = self._run
        while left:
            if run.index == self._outline.count:
                self._roll()
            last = min(run.index + left, self._outline.count)
            left -= last - run.index
            self._inputs.put(run.index, last + 1)
            self._stepper.advance(last)

    def _begin(self) -> None:
        """Initialize, with the inputs that have been set."""
        self._check_open()
        if self._begun:
            return
        self._inputs.put(0, 2)
        before = Surroundings.now()
        try:
            initialize(self._run)
            self._execution.find_lost()
            self._execution.begin()
        except (FmuCallError, AlgebraicLoopError) as error:
            self._failed = str(error)
            raise self._execution.stopped(error, keep=False) from error
        finally:
            self._execution.changed = before.restore()
        self._begun = True

    def _roll(self) -> None:
        """Let an endless twin's window begin where it stands."""
        run = self._run
        self._blocks.append(self._fresh())
        self._taken = 0
        memory = self._stepper.save()
        self._window(self._base + run.index)
        run.past[0] = max(int(run.past[0]), 3)  # values there are before the window
        run.index = run.row = 0
        self._stepper.restore(memory)

    def _window(self, base: int) -> None:
        """Times and inputs from a communication point on."""
        run, points = self._run, np.arange(self._outline.times.size, dtype=np.float64)
        self._base = base
        run.times[:] = self._start + run.step * (base + points)
        vars(run).pop("instants", None)
        self._inputs.tabulate()

    def _check_open(self) -> None:
        if self._closed:
            raise FmuCallError("the twin is closed; open another one")

    def _check_alive(self) -> None:
        self._check_open()
        if self._failed:
            raise FmuCallError(f"the twin has stopped ({self._failed}); return to a saved state")
        if self.ended:
            raise FmuCallError(f"the twin has ended: {self.ended}")

    # -- states ----------------------------------------------------------------------------------

    def save(self) -> Saved:
        """What `restore` returns to; kept until `drop`, or until the twin is closed.

        Raises:
            FmuCallError: an FMU cannot save its state.
        """
        self._begin()
        self._check_alive()
        memory = Memory.of(self._run, self._stepper.save(), self._base, self._inputs.given)
        memory.blocks = len(self._blocks)
        for instance in self._run.instances:  # steps from here on may be taken back
            instance.returning(True)
        if isinstance(self._stepper, Compiled):
            self._stepper.kernel.run.final = 0
        saved = Saved(self.time, memory)
        self._saved.append(saved)
        return saved

    def restore(self, saved: Saved) -> None:
        """Return to a saved state: time, values, inputs, recording.

        Raises:
            ValueRangeError: it is of another twin, or was dropped.
        """
        self._check_open()
        if saved not in self._saved:
            raise ValueRangeError(
                f"the state saved at t = {saved.time:.9g} s is not one of this twin, or was "
                "dropped; fork the twin to go on from it elsewhere"
            )
        for other in self._saved:  # what they recorded will be written over
            other.memory.keep_rows(self._run, self._blocks, self._base, saved.memory)
        self._take(saved.memory)

    def _take(self, memory: Memory, states: Sequence[Any] | None = None) -> None:
        if memory.base != self._base:
            self._window(memory.base)
        self._inputs.replace(memory.given)
        self._blocks = memory.recorded(self._run, self._blocks)
        memory.put(self._run, states)
        self._stepper.restore(memory.stepper)
        self._failed = self.ended = ""

    def drop(self, saved: Saved) -> None:
        """Forget a saved state."""
        if saved in self._saved:
            self._saved.remove(saved)
            saved.memory.release(self._run)

    def fork(self) -> Twin:
        """Another twin at the same point, with FMUs of its own; the two share nothing.

        Raises:
            FmuCallError: an FMU cannot hand its state on, or allows one instance only.
        """
        saved = self.save()
        try:
            states = saved.memory.serialized(self._run)
            master, duration, inputs, record, every, start, about = self._made
            other = Twin(
                master, duration, inputs=inputs, record=record, every=every, start=start,
                about=about,
            )  # fmt: skip
            try:
                other._inputs.begin_as(self._inputs)
                other._begin()
                other._blocks, other._taken = list(self._blocks), self._taken
                memory = copy.copy(saved.memory)
                memory.rows = self._run.rows[: self._run.row].copy()
                given = [
                    instance.deserialize(content)
                    for instance, content in zip(other._run.instances, states, strict=True)
                ]
                other._take(memory, given)
                for instance, state in zip(other._run.instances, given, strict=True):
                    instance.release(state)
                other._told = set(self._told)
            except BaseException:
                other.close()
                raise
            return other
        finally:
            self.drop(saved)

    def restart(self) -> None:
        """Return to the begin, before the initialization, with nothing set and nothing recorded."""
        self._check_open()
        for saved in list(self._saved):
            self.drop(saved)
        self._execution.restart()
        if self._base:
            self._window(0)
        self._inputs.replace({})
        self._blocks.clear()
        self._taken = 0
        self._told.clear()
        self._failed = self.ended = ""
        self._begun = False

    # -- what was ----------------------------------------------------------------------------------

    @property
    def recording(self) -> Recording:
        """What has been recorded up to now, the present point included if it is its turn."""
        if self._final is not None:
            return self._final
        if not self._failed:
            self._begin()
        run = self._run
        parts = [*self._blocks, self._fresh()]
        times, rows = [part[0] for part in parts], [part[1] for part in parts]
        objects = {name: list(items) for name, items in run.passing.kept.items()}
        if not self._failed:
            now = self._present(objects)
            if now is not None:
                times.append(np.array([self.time]))
                rows.append(now[None])
        energy, turnover = self._execution.energies()
        found = replace(
            self._outline, times=np.concatenate(times), every=1, endless=False
        ).recording(
            np.concatenate(rows),
            energy,
            self._execution.how(),
            self._failed,
            objects=objects,
            turnover=turnover,
            notes=[*self._execution.notes(), *filter(None, [self.ended])],
        )  # fmt: skip
        given = {**found.provenance["inputs"], **dict.fromkeys(sorted(self._told), "set in steps")}
        about = self._made[-1] or {}
        return replace(found, provenance={**found.provenance, "inputs": given, **about})

    def _fresh(self) -> tuple[Vector, Vector]:
        """Times and rows of the window that were not drained."""
        run = self._run
        return run.recorded_times()[self._taken :], run.rows[self._taken : run.row].copy()

    def drain(self) -> tuple[Vector, Vector]:
        """Times and rows that were recorded since the last call; the twin then forgets them.

        The present point is not among them: it is recorded by the step that leaves it, with the
        inputs that it has then. States saved before cannot be returned to.
        """
        parts = [*self._blocks, self._fresh()]
        self._blocks, self._taken = [], self._run.row
        for saved in list(self._saved):
            self.drop(saved)
        return (
            np.concatenate([part[0] for part in parts]),
            np.concatenate([part[1] for part in parts]),
        )

    def _present(self, objects: dict[str, list[Any]]) -> Vector | None:
        """The present point as a run that ends here records it; nothing changes by this."""
        run, layout = self._run, self._run.layout
        if self.ended or run.index % run.every or run.row > run.index // run.every:
            return None
        self._inputs.put(run.index, run.index + 1)
        with Memory.exchange(run):
            for op, a, b in decoded(run.plan.final):
                if op is not Op.RECORD:
                    run.do(op, a, b)
            for name, items in objects.items():
                slot = layout.record_source[self._outline.observed.index(name)]
                items.append(run.objects[slot])
            now: Vector = (
                run.values[layout.record_source] * layout.record_gain + layout.record_offset
            )
        return now

    # -- end -------------------------------------------------------------------------------------

    def close(self) -> None:
        """Free the instances; what was recorded is still there."""
        if not self._closed:
            for saved in list(self._saved):
                self.drop(saved)
            try:
                if self._begun:
                    self._final = self.recording
            finally:
                self._closed = True
                self._stack.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
