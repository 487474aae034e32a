"""Inputs that an FMU of FMI 3 asks for while it steps: intermediate updates.

The importer says before the step how the inputs move in it, u(t) = u + u' dt + u'' dt^2 / 2 with dt
from the begin of the step; within the step the FMU calls back with a time and is given the values
there. `kernel.c` answers in the same way, bit for bit, on the same memory. Not modelled: outputs
within a step are not fetched, and no FMU is asked to return early.
"""

from __future__ import annotations

import ctypes as ct
import math
from collections.abc import Mapping, Sequence
from typing import Any, Protocol
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from ..errors import FmuCallError
from .values import fitting
from .variables import Variable

Vector = NDArray[np.float64]
Integers = NDArray[np.int64]
_P, _I64, _D, _B = ct.c_void_p, ct.c_int64, ct.c_double, ct.c_bool
MISSED = 1e-9
"""Time by which an FMU may miss its step by rounding, relative to 1 s and to the time itself."""
REFUSED = 1006
"""Status of a step within which an update could not be answered."""
OUTSIDE, UNFIT = 1001, 1002
"""Statuses of updates that were refused: a time outside of the step, a number that does not fit."""


class Teller(Protocol):
    """What makes errors: an instance."""

    def failure(self, what: str, status: int) -> FmuCallError:
        """The error for a call that returned `status`."""

    def refusal(self, what: str) -> FmuCallError:
        """The error for what was not even tried."""


class Group(ct.Structure):
    """As in `run.h`: one set call."""

    _fields_ = (
        ("function", _P), ("references", _P), ("buffer", _P), ("n_references", _I64),
        ("n_values", _I64), ("first", _I64), ("single", _I64), ("warned", _I64),
    )  # fmt: skip


class Update(ct.Structure):
    """As in `run.h`: the memory of which FMUs pass on the address when they ask."""

    _fields_ = (
        ("component", _P), ("begin", _D), ("end", _D), ("last", _D), ("finished", _D),
        ("wrong", _D), ("back", _D), ("status", _I64), ("failed", _I64), ("values", _P),
        ("slope", _P), ("curve", _P), ("slots", _P), ("means", _P), ("groups", _P),
        ("n_groups", _I64),
    )  # fmt: skip


class Moved:
    """Inputs of one instance that its importer moves within steps.

    Args:
        variables: whole inputs with `intermediateUpdate`.
        callback: address of compiled code that answers, 0: the answers come from here.
    """

    def __init__(self, variables: Sequence[Variable], callback: int = 0) -> None:
        self.variables = tuple(sorted(variables, key=lambda v: v.type))  # one call per type
        self.references = np.array([v.reference for v in self.variables], dtype=np.uint32)
        self.callback = callback or ct.cast(_CALLBACK, _P).value or 0
        self.memory = Update(back=math.nan)
        self.error: BaseException | None = None
        self._parts: list[tuple[str, Any, NDArray[Any], int]] = []
        self._kept: list[Any] = []
        self.restart()

    @property
    def address(self) -> int:
        """Of the memory, by which an FMU says which instance it is."""
        return ct.addressof(self.memory)

    @property
    def names(self) -> list[str]:
        """Of the scalars, in the order of the values."""
        return [name for variable in self.variables for name in variable.elements()]

    def bind(self, address: int, functions: Mapping[str, Any], setters: Mapping[str, str]) -> None:
        """The instance that was made with this, and its functions; the ones that set by type."""
        _moved[self.address] = self
        self.memory.component = address
        groups = []
        first = reference = 0
        for type_ in dict.fromkeys(variable.type for variable in self.variables):
            own = [variable for variable in self.variables if variable.type == type_]
            count = sum(variable.size for variable in own)
            buffer = np.zeros(count, dtype=np.float32 if type_ == "Float32" else np.float64)
            function = functions[setters[type_]]
            numbers = self.references[reference : reference + len(own)]
            self._parts.append((type_, function, buffer, first))
            groups.append(
                Group(
                    ct.cast(function, _P), numbers.ctypes.data, buffer.ctypes.data, len(own),
                    count, first, type_ == "Float32", 0,
                )
            )  # fmt: skip
            first, reference = first + count, reference + len(own)
        self._groups = (Group * len(groups))(*groups)
        self.memory.groups, self.memory.n_groups = ct.addressof(self._groups), len(groups)

    def follow(
        self, values: Vector, slope: Vector, curve: Vector, slots: Integers, means: Integers
    ) -> None:
        """Where values and derivatives at the begin of the step stand, now and later.

        Args:
            values: exchanged values; `slots` are the places of the inputs in it.
            slope, curve: first and second derivatives; `means` are the places of those of the
                inputs, -1 for one that is held.
        """
        self._source = (values, slope, curve, slots, means)
        self._held = means < 0
        memory, arrays = self.memory, (values, slope, curve, slots, means)
        for name, array in zip(("values", "slope", "curve", "slots", "means"), arrays, strict=True):
            setattr(memory, name, array.ctypes.data)

    def begin(self, time: float, size: float) -> None:
        """A step begins, whose inputs have been set."""
        memory = self.memory
        memory.begin = memory.last = memory.finished = time
        memory.end = time + size

    def restart(self) -> None:
        """No step is under way."""
        memory = self.memory
        memory.begin = memory.end = memory.last = memory.finished = math.nan
        memory.status = 0
        self.error = None

    def answer(self, time: float, requested: bool, finished: bool) -> None:
        """The FMU asks for the inputs of a time."""
        memory = self.memory
        missed = MISSED * (1.0 + abs(memory.end))
        if time < memory.finished - missed:
            memory.back = time
        if finished:
            memory.finished = time
        if not requested or memory.status or time == memory.last:
            return
        if not memory.begin - missed <= time <= memory.end + missed:
            memory.status, memory.wrong = OUTSIDE, time
            return
        memory.last = time
        values, slope, curve, slots, means = self._source
        dt = time - memory.begin
        half = 0.5 * dt * dt
        rise = np.where(self._held, 0.0, slope[means])
        bend = np.where(self._held, 0.0, curve[means])
        moved = values[slots] + dt * rise + half * bend
        for index, (type_, function, buffer, first) in enumerate(self._parts):
            numbers = moved[first : first + buffer.size]
            group = self._groups[index]
            status = UNFIT
            if fitting(type_, numbers).all():
                buffer[:] = numbers
                status = function(
                    memory.component, group.references, group.n_references, group.buffer,
                    group.n_values,
                )  # fmt: skip
            if status == 1:
                group.warned = 1
            elif status:
                memory.status, memory.wrong, memory.failed = status, time, index
                return

    @property
    def failed(self) -> bool:
        """Whether an update could not be answered."""
        return bool(self.memory.status) or self.error is not None

    def refusal(self, instance: Teller) -> FmuCallError:
        """The error for an update that could not be answered."""
        memory = self.memory
        if self.error is not None:
            raise self.error
        at = f"t = {memory.wrong:.9g} s"
        if memory.status == OUTSIDE:
            span = f"from {memory.begin:.9g} s to {memory.end:.9g} s"
            if math.isnan(memory.begin):
                span = "it is in none"
            return instance.refusal(f"asked for inputs of {at}, outside of its step ({span})")
        type_ = self._parts[memory.failed][0]
        names = ", ".join(variable.name for variable in self.variables if variable.type == type_)
        what = f"setting {names} within the step, to what they are at {at},"
        if memory.status == UNFIT:
            return instance.refusal(f"{what} is not possible: {type_} does not carry it")
        return instance.failure(what, int(memory.status))

    def warnings(self) -> list[str]:
        """What was odd about the updates so far, once."""
        found = []
        if not math.isnan(self.memory.back):
            found.append(
                f"asked for inputs of t = {self.memory.back:.9g} s after it had said to have "
                "finished a later time"
            )
            self.memory.back = math.nan
        for group in self._groups:
            if group.warned:
                found.append("setting inputs within a step returned status 'warning'")
                group.warned = 0
        return found


# -- the callback ----------------------------------------------------------------------------------

_moved: WeakValueDictionary[int, Moved] = WeakValueDictionary()
"""By address, of the living instances."""


def _answer(
    key: int | None, time: float, requested: bool, allowed: bool, finished: bool, can: bool,
    early: Any, when: Any,
) -> None:  # fmt: skip
    if early:
        early[0] = False
    if when:
        when[0] = time
    moved = _moved.get(key or 0)
    if moved is None or moved.error is not None:
        return
    try:
        moved.answer(time, requested, finished)
    except BaseException as error:  # nothing may go through C; the step raises it
        moved.error = error


_CALLBACK = ct.CFUNCTYPE(
    None, _P, _D, _B, _B, _B, _B, ct.POINTER(_B), ct.POINTER(_D)
)(_answer)  # fmt: skip
