"""A prepared run that is repeated with other values: calibration runs thousands of them.

    session = Session(master, 10.0, inputs={"motor.w_ref": table}, record=["load.w"])
    times, rows = session.run({"load.J": 0.09})

Instances, plan, arrays and the binding to the compiled executor are made once. A repetition is the
same as a new run, bit for bit. Sessions do not share anything that changes, so each thread can run
one of its own; the compiled executor releases the interpreter lock.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..arguments import need_number, need_table, need_texts, wrong
from ..data.recording import Recording
from ..data.signals import Shifted, Signal, as_signal
from ..errors import (
    AlgebraicLoopError,
    EndRequest,
    FmuCallError,
    GraphError,
    UnknownNameError,
    ValueRangeError,
    listing,
)
from ..fmu.exchange import Block
from ..fmu.library import WORK
from ..fmu.values import check_values
from ..system.inputs import Driver
from . import kernel
from .execution import Execution
from .initialization import initialize
from .kernel.stepper import Compiled
from .master import Master
from .numbers import Numbers
from .outline import Outline

Vector = NDArray[np.float64]
LOOK, CHECK = 50, 100
"""Communication steps after which a limited run looks at its work, and at what it has recorded; as
in the compiled executor."""
SETS = 8
"""Sets of names whose places are kept: a fit alternates between few."""
RUNAWAY = 1e30
"""Recorded value beyond which a limited run ends: no quantity of a robot is as large in any unit,
and solvers crawl long before squares overflow."""


class Session:
    """A run of a master, ready to be repeated.

    Args:
        master: system, algorithm and communication step.
        duration: [s], a whole number of steps.
        inputs: as of `Master.run`.
        record: signals to record.
        every: record every n-th communication point.
        start: time at which the run begins [s].
        targets: full names of parameters and start values that `run` may be given as an array.
        like: outline of a run of a similar system; its table of inputs is shared if it is the same,
            and neither session can be driven by others then.
    """

    def __init__(
        self,
        master: Master,
        duration: float,
        *,
        inputs: Mapping[str, Driver] | None = None,
        record: Sequence[str],
        every: int = 1,
        start: float = 0.0,
        targets: Sequence[str] = (),
        like: Outline | None = None,
    ) -> None:
        if not isinstance(master, Master):
            raise wrong(
                "the master of a Session", master, "a Master", "write Session(Master(system), 10.0)"
            )
        need_texts("targets of a Session", targets, 'targets=["load.J"]')
        self.master = master
        outline = master.outline(
            duration, inputs=inputs, record=record, every=every, start=start, like=like
        )
        self._prepare(outline, targets)

    @classmethod
    def of(cls, outline: Outline) -> Self:
        """A session of a run that is outlined already; it has no `master`."""
        found = cls.__new__(cls)
        found._prepare(outline, ())
        return found

    def _prepare(self, outline: Outline, targets: Sequence[str]) -> None:
        """Make what repetitions share."""
        self.system, self.names, self.count = outline.system, outline.observed, outline.count
        self.times = outline.times[:: outline.every].copy()
        self.targets = tuple(targets)
        self.work = 0
        self._signals: dict[str, Signal] = {}
        self._later: dict[str, float] = {}
        self._numbers: dict[tuple[str, ...], Numbers | None] = {}
        self._stack = ExitStack()
        try:
            self._execution = Execution(outline, self._stack)
            self._run = self._execution.run
            # FMUs that count their work do not ask to end, for which a last row would be wanted
            self._run.sparse = not any(i.watched for i in self._run.instances)
            self._stepper = self._execution.prepare()
            self._blocks = {name: self._block(name) for name in self.targets}
            counting = [i for i in self._run.instances if not i.watched]
            self._counters = [(i.function(WORK), i.address) for i in counting]
        except BaseException:
            self._stack.close()
            raise

    @property
    def outline(self) -> Outline:
        """What is run."""
        return self._execution.outline

    def _block(self, name: str) -> tuple[Block, Any]:
        member, variables = self.system.variables(name)
        position = list(self.system.members).index(member.name)
        whole = [member.description.whole(v.name) for v in variables]
        return Block(self._run.instances[position], whole), variables

    def _begin(self, name: str) -> list[Any]:
        """Values of an array as the system has them."""
        member, (variable,) = self.system.variables(name)
        given = member.parameters.get(variable.name)  # as it was written: rows, one for all
        if given is None and len(variable.start) != variable.size:
            raise ValueRangeError(f"{name} has no start values; set it as a whole")
        return check_values(name, [variable], variable.start if given is None else given)

    def run(
        self, values: Mapping[str, float] | Vector | None = None, *, limit: float = math.inf
    ) -> tuple[Vector, Vector]:
        """Run with these values on top of the system's own.

        Args:
            values: by full name, or one per target.
            limit: work that it may take: communication steps times instances, and steps of
                solvers where FMUs count them (`library.WORK`). Time would depend on the machine.

        Returns:
            times, and one row per time with a column per name in `names` (a copy).

        Raises:
            ValueRangeError: outside the declared bounds.
            StepError: an FMU failed, or the run took more than its limit.
        """
        if values is None:
            values = {}
        need_number("the limit of a run", limit)
        if not isinstance(values, Mapping):
            if isinstance(values, (str, bytes)) or not hasattr(values, "__len__"):
                raise wrong(
                    "values of a run", values, "a table or a list", 'write {"load.J": 0.09}'
                )
            if len(values) != len(self.targets):
                raise ValueRangeError(f"{len(values)} values for {len(self.targets)} targets")
            values = dict(zip(self.targets, np.asarray(values).tolist(), strict=True))
        if tuple(values) not in self._numbers:  # else they were looked at before
            need_table("values of a run", values, '{"load.J": 0.09}')
        run = self._run
        self._execution.restart()
        if not self._given_together(values):
            self._give(values)
        initialize(run)
        begun = self._steps_of_solvers()
        try:
            self._execution.begin()
            try:
                self._advance_within(limit)
            except EndRequest as request:  # an end that an FMU asks for is one
                self._execution.finish(request)
            else:
                self._execution.finish()
        except (FmuCallError, AlgebraicLoopError) as error:
            raise self._execution.stopped(error, keep=False) from error
        self.work = self._steps_of_solvers() - begun + self.count * len(run.instances)
        return run.recorded_times(), run.rows[: run.row].copy()

    def _given_together(self, values: Mapping[str, Any]) -> bool:
        """Give values in one call per instance, where all are plain numbers that fit."""
        names = tuple(values)
        if names not in self._numbers:
            fit = Numbers.fit(self.system, names)
            made = Numbers(self.system, self._run.instances, names) if fit else None
            self._numbers = dict([*self._numbers.items(), (names, made)][-SETS:])
        together = self._numbers[names]
        if together is None:
            return False
        try:
            return together.give(values)
        except FmuCallError:
            if any(instance.dead for instance in self._run.instances):
                raise
        self._execution.restart()  # one by one, the error says which it was
        return False

    def _give(self, values: Mapping[str, Any]) -> None:
        """Give values one by one."""
        wholes: dict[str, list[Any]] = {}
        elements: list[tuple[str, Block, int, Any]] = []
        for name, value in values.items():
            if name not in self._blocks:
                self._blocks[name] = self._block(name)
            block, variables = self._blocks[name]
            found = check_values(name, variables, value)
            if variables[0].index is None:
                block.set(found)
                if variables[0].dimensions:
                    wholes[self.system.first_name(name)] = found
            else:
                whole = self.system.first_name(name).rpartition("[")[0]
                elements.append((whole, block, variables[0].index, found[0]))
        arrays: dict[str, tuple[Block, list[Any]]] = {}
        for whole, block, index, item in elements:  # FMI sets arrays as a whole
            if whole not in arrays:
                begin = wholes[whole] if whole in wholes else self._begin(whole)
                arrays[whole] = (block, list(begin))
            arrays[whole][1][index] = item
        for block, items in arrays.values():
            block.set(items)

    def shift(self, later: Mapping[str, float]) -> None:
        """Let inputs come later than their signals say, from the next run on (see `Shifted`).

        Args:
            later: driven input, as the run has it -> by how much [s], negative for earlier; those
                that are not named come in time.
        """
        need_table("what comes later", later, '{"motor.w_ref": 0.01}')
        wanted = {name: value for name, value in later.items() if value}
        if wanted == self._later:
            return
        self.drive(self._signals, wanted)

    def drive(
        self, signals: Mapping[str, Signal], later: Mapping[str, float] | None = None
    ) -> None:
        """Drive some inputs by other signals from the next run on, the others by their own.

        Args:
            signals: driven input, as the run has it -> what drives it.
            later: inputs that come later than what drives them says, as of `shift`.

        Raises:
            UnknownNameError: it is no input that the session drives.
            GraphError: the session shares its inputs with others.
        """
        need_table("signals of a session", signals, '{"motor.w_ref": 20.0}')
        outline = self._execution.outline
        if not self._run.external.flags.writeable:
            raise GraphError(
                "this session shares its inputs with others and can't be driven; make one without "
                "like="
            )
        driving = dict(outline.signals)
        for name in {**signals, **(later or {})}:
            if name not in driving:
                raise UnknownNameError(
                    f"this session does not drive {name!r}, so nothing can be put in the place of "
                    f"its signal; {listing(driving, name)}"
                )
        driving.update({name: as_signal(signal) for name, signal in signals.items()})
        for name, value in (later or {}).items():
            need_number(f"how late {name} comes", value, "give it in seconds")
            if not math.isfinite(value):
                raise ValueRangeError(f"{name} cannot come {value} s later")
            driving[name] = Shifted(driving[name], value, outline.step)
        outline.driven.update(signals, later or {})
        self._run.external[:] = self.master.tabulate(driving, outline.times)
        for column, items in self.master.carried(driving, outline.times).items():
            outline.objects[column][:] = items
        outline.driven.intersection_update({*signals, *(later or {})})
        self._signals = dict(signals)
        self._later = {name: value for name, value in (later or {}).items() if value}

    def _advance_within(self, limit: float) -> None:
        if math.isinf(limit):
            self._stepper.advance(self.count)
        elif isinstance(self._stepper, Compiled):
            status = self._stepper.advance_within(self.count, limit, RUNAWAY)
            self._stopped(limit, status == kernel.TOO_LONG, status == kernel.TOO_LARGE)
        else:
            begun = self._steps_of_solvers()
            for last in [*range(LOOK, self.count, LOOK), self.count]:
                self._stepper.advance(last)
                work = self._steps_of_solvers() - begun + last * len(self._run.instances)
                self._stopped(
                    limit, work > limit, last % CHECK == 0 and self._largest()[1] > RUNAWAY
                )

    def _steps_of_solvers(self) -> int:
        """Made so far by those that count them."""
        return sum(int(count(address)) for count, address in self._counters)

    def _largest(self) -> tuple[str, float]:
        """Name and size of the largest value recorded last."""
        newest = np.abs(self._run.rows[max(self._run.row - 1, 0)])
        place = int(np.argmax(newest)) if newest.size else -1
        return (self.names[place], float(newest[place])) if newest.size else ("", 0.0)

    def _stopped(self, limit: float, late: bool, large: bool) -> None:
        """Raise if a run took too long or ran away."""
        if late:
            raise FmuCallError(
                f"it took more than {limit:.15g} steps of solvers and instances: with these "
                "values a solver takes very small steps"
            )
        if large:
            raise FmuCallError(
                f"{self._largest()[0]} passed {RUNAWAY:g}: with these values the system is unstable"
            )

    def record(self, progress: Callable[[float], None] | None = None) -> Recording:
        """Run with the values that the system has now: change them by `master.system.set`.

        Args:
            progress: told now and then which fraction is done; what it raises ends the run.

        Raises:
            AlgebraicLoopError: initial values do not settle.
            StepError: an FMU failed; carries the recording up to then.
        """
        self._execution.restart()
        return self._execution.execute(progress)

    def close(self) -> None:
        """Free the instances."""
        self._stack.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
