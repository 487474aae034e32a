"""One FMU instance for co-simulation, FMI 2.0 or 3.0, through ctypes with one Python interface.

The call sequence:

1. `Instance(fmu, name)` creates it.
2. `set` of parameters and start values.
3. `enter_initialization(start, stop)`, then `set` of inputs and `get` of outputs as often as
   needed, then `exit_initialization()`.
4. `set` inputs, `step(time, size)`, `get` outputs, again and again; `save` and `restore` in
   between if the FMU can.
5. `reset()` returns to 2; `free()` ends it (a `with` block does that, and so does the garbage
   collector).

`address` and `functions` hold the addresses of the instance and of its C functions, so that
compiled code can make the same calls; `Block` holds the arrays that go with them.
"""

from __future__ import annotations

import contextlib
import ctypes as ct
import math
import os
import weakref
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import EndRequest, FmuCallError, ValueRangeError
from .archive import Fmu, open_fmu
from .assignment import Assignment
from .calls import announce
from .exchange import Block, Objects, Part
from .fmi2 import Fmi2
from .fmi3 import EARLY, ENDED, SAME, Fmi3
from .intermediate import REFUSED, Moved
from .library import WORK, bind
from .messages import STATUS, forget, new_key, status_name, tail, take
from .surroundings import MODES, kept, modes

Vector = NDArray[np.float64]
WARNING, FATAL = STATUS.index("warning"), STATUS.index("fatal")
WARNINGS = tuple(f"{name}: " for name in STATUS[1:])
"""How messages begin that are more than information."""

_single: set[str] = set()
_UNWATCHED = contextlib.nullcontext()


@dataclass(frozen=True)
class State:
    """A saved state; belongs to the instance that saved it until `release` or `free`."""

    address: int


class Instance:
    """One FMU instance.

    Args:
        fmu: an opened FMU, or the path of one.
        name: its name in messages.
        logging: let the FMU log everything, not errors alone.
        moved: inputs for which an FMU of FMI 3 may ask within steps.

    Attributes:
        watched: whether it is looked up what its calls leave changed in this process.

    Raises:
        FmuFileError: the file cannot be run here.
        FmuCallError: the FMU refused to be created.
    """

    def __init__(
        self, fmu: Fmu | str | os.PathLike[str], name: str = "", *, logging: bool = False,
        moved: Moved | None = None,
    ):  # fmt: skip
        self.fmu = fmu = fmu if isinstance(fmu, Fmu) else open_fmu(os.fspath(fmu))
        self.description = fmu.description
        self.name = name or fmu.path.stem
        self.label = f"{self.name} ({self.description.name})"
        self.time = math.nan
        once = self.description.can("canBeInstantiatedOnlyOncePerProcess")
        if once and fmu.digest in _single:
            raise FmuCallError(
                f"{self.label}: the FMU says that it can be instantiated only once per process, "
                "and it already is; run the other instance in a process of its own"
            )
        announce(self.name, "loading its library")
        self.binding: Fmi2 | Fmi3
        self.binding, self._functions = bind(fmu)
        self.watched = WORK not in self._functions
        self._step = self._functions[f"fmi{self.binding.version}DoStep"]
        self._step_arguments = self.binding.step_arguments(True)
        self._warned: dict[str, float] = {}
        self.moved = moved
        self._key = new_key(moved.address if moved else 0)
        announce(self.name, "creation")
        self._notes: dict[str, None] = {}
        with self._putting_back("its creation"):
            made = self.binding.instantiate(fmu, self.name, self._key, logging, moved)
        address, self._alive = made
        if not address:
            messages = take(self._key)
            forget(self._key)
            raise FmuCallError(
                f"{self.label}: the FMU could not be created" + tail(messages), messages
            )
        self.address: int = address
        if moved is not None:
            moved.bind(address, self._functions, self.binding.SET)
        if once:
            _single.add(fmu.digest)
        self._terminable = False
        self._dead = [False]
        self._finalizer = weakref.finalize(
            self, _free, self.binding.free_, address, self._key, self._dead, self._alive,
            fmu.digest, self.name,
        )  # fmt: skip

    def __repr__(self) -> str:
        return f"<Instance {self.label}, FMI {self.description.fmi}, t = {self.time}>"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.free()

    # -- calls -----------------------------------------------------------------------------------

    @property
    def functions(self) -> dict[str, int]:
        """Addresses of the C functions."""
        return self._functions.addresses

    def function(self, name: str) -> Any:
        """A C function as a ctypes object; its first argument is `address`."""
        return self._functions[name]

    @property
    def dead(self) -> bool:
        """Whether a call returned `fatal`, after which none may follow."""
        return self._dead[0]

    def failure(self, what: str, status: int) -> FmuCallError:
        """The error for a call that returned `status`, with what the FMU logged."""
        if status == 4:
            self._dead[0] = True
        self._terminable = False
        messages = take(self._key)
        when = "" if math.isnan(self.time) else f" at t = {self.time:.9g} s"
        return FmuCallError(
            f"{self.label}: {what}{when} failed with status {status_name(status)}" + tail(messages),
            messages,
        )

    def refusal(self, what: str) -> FmuCallError:
        """The error for a value that is not given to the FMU at all."""
        when = "" if math.isnan(self.time) else f" at t = {self.time:.9g} s"
        return FmuCallError(f"{self.label}: {what}{when}")

    def _call(self, what: str, name: str, *arguments: Any) -> None:
        if not self._finalizer.alive:
            raise FmuCallError(f"{self.label}: is freed; create a new instance")
        if name not in self._functions:
            raise FmuCallError(f"{self.label}: the FMU has no function {name}")
        announce(self.name, what)
        status = self._functions[name](self.address, *arguments)
        if status:
            if status != WARNING:
                raise self.failure(what, status)
            self.warned(what)

    def warned(self, what: str, time: float | None = None) -> None:
        """Note that a call returned `warning`; a time that nobody knows is nan."""
        self._warned.setdefault(what, self.time if time is None else time)

    def warnings(self) -> list[str]:
        """What the FMU warned of since the last call, once each."""
        found = [f"{self.label}: {text}" for text in dict.fromkeys(take(self._key))
                 if text.startswith(WARNINGS)]  # fmt: skip
        for what, time in self._warned.items():
            when = "" if math.isnan(time) else f", first at t = {time:.9g} s"
            found.append(f"{self.label}: {what} returned status 'warning'{when}")
        self._warned.clear()
        if self.moved is not None:
            found += [f"{self.label}: {text}" for text in self.moved.warnings()]
        found += [f"{self.label}: {text}" for text in self._notes]
        self._notes.clear()
        return found

    def note(self, text: str) -> None:
        """Note something once, for `warnings`."""
        self._notes.setdefault(text)

    def changed(self, what: str, when: str) -> None:
        """Note what a call has changed in this process that was put back."""
        self.note(f"changed {what} in {when}, which was put back")

    def _putting_back(self, when: str) -> contextlib.AbstractContextManager[None]:
        return kept(lambda what: self.changed(what, when)) if self.watched else _UNWATCHED

    def get_part(self, part: Part) -> None:
        """One get call for the values of a block's part."""
        if not self._finalizer.alive:
            raise FmuCallError(f"{self.label}: is freed; create a new instance")
        status = self._functions[self.binding.GET[part.type]](self.address, *part.arguments)
        if status:
            if status != WARNING:
                raise self.failed_access(True, part, status)
            self.warned("getting values")

    def set_part(self, part: Part) -> None:
        """One set call for the values of a block's part."""
        if not self._finalizer.alive:
            raise FmuCallError(f"{self.label}: is freed; create a new instance")
        status = self._functions[self.binding.SET[part.type]](self.address, *part.arguments)
        if status:
            if status != WARNING:
                raise self.failed_access(False, part, status)
            self.warned("setting values")

    def set_input_derivatives(
        self, references: NDArray[np.uint32], orders: NDArray[np.int32], values: Vector
    ) -> None:
        """Derivatives of inputs in time, by which they move in the steps to come (FMI 2)."""
        status = self._functions["fmi2SetRealInputDerivatives"](
            self.address, references.ctypes.data, references.size, orders.ctypes.data,
            values.ctypes.data,
        )  # fmt: skip
        if status not in (0, WARNING):
            raise self.failed_derivatives(references, status)

    def failed_derivatives(self, references: NDArray[np.uint32], status: int) -> FmuCallError:
        """The error for derivatives of inputs that the FMU refused."""
        return self.failure(f"setting derivatives of {self._names(references, 'Float64')}", status)

    def failed_access(self, getting: bool, part: Part, status: int) -> FmuCallError:
        """The error for a get or set call that returned `status`."""
        verb = "getting" if getting else "setting"
        return self.failure(f"{verb} {self._names(part.references, part.type)}", status)

    def _names(self, references: NDArray[np.uint32], type_: str) -> str:
        wanted = {int(reference) for reference in references}
        names = [
            v.name
            for v in self.description.variables.values()
            if v.reference in wanted
            and v.type == type_.removesuffix("Whole")
            and v.causality != "local"
        ]
        return ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")

    # -- values ----------------------------------------------------------------------------------

    def block(
        self, names: Iterable[str], values: Vector | None = None, objects: Objects | None = None
    ) -> Block:
        """Preallocate an exchange of these variables; `q` means all of `q[1]` ... `q[n]`."""
        variables = [v for name in names for v in self.description.expand(name)]
        return Block(self, variables, values, objects)

    def get(self, *names: str) -> Vector:
        """Values of numeric variables (a copy), elements of arrays too.

        Raises:
            ValueRangeError: a string, a binary, or an integer that a double does not carry.
        """
        found = self.fetch(*names)
        for name, value in zip(names, found, strict=False):
            if isinstance(value, (str, bytes)) or float(value) != value:
                raise ValueRangeError(f"{self.label}: {name} = {value!r}: take `fetch` for it")
        return np.array(found, dtype=np.float64)

    def fetch(self, *names: str) -> list[Any]:
        """Values of any variables: floats, exact integers, strings, bytes."""
        found: list[Any] = []
        for name in names:
            for variable in self.description.expand(name):
                whole = self.description.whole(variable.name)
                block = Block(self, [whole])
                block.get()
                contents = block.contents()
                found += contents if variable.index is None else [contents[variable.index]]
        return found

    def set(self, values: Mapping[str, Any]) -> None:
        """Set variables by name; a vector takes a list, a matrix a list of rows.

        Elements of an array leave the other ones as they are, or at their start values.

        Raises:
            ValueRangeError: of another type or size, not finite, not exact, or out of bounds.
            FmuCallError: the FMU refused.
        """
        Assignment(self, values).give()

    # -- phases ----------------------------------------------------------------------------------

    def enter_initialization(
        self, start: float = 0.0, stop: float | None = None, tolerance: float | None = None
    ) -> None:
        """Begin initialization at time `start`."""
        self.time = start
        with self._putting_back("initialization"):
            for name, arguments in self.binding.enter_calls(start, stop, tolerance):
                self._call("initialization", name, *arguments)

    def exit_initialization(self) -> None:
        """End initialization; the instance is then at its first communication point."""
        with self._putting_back("initialization"):
            self._call("initialization", f"fmi{self.binding.version}ExitInitializationMode")
        self._terminable = True

    def step(self, time: float, size: float) -> None:
        """Go from `time` to `time + size`.

        Raises:
            EndRequest: the FMU asked to end the simulation.
            FmuCallError: it refused.
        """
        if not self._finalizer.alive:
            raise FmuCallError(f"{self.label}: is freed; create a new instance")
        self.time = time
        before = modes.get() if self.watched else 0
        moved = self.moved
        if moved is not None:
            moved.begin(time, size)
        status = self._step(self.address, time, size, *self._step_arguments)
        if self.watched and modes.get() != before:
            modes.put(before)
            self.changed(MODES, "a step")
        if status in (0, WARNING):
            status = self.binding.ending(time + size, size) or status
        if moved is not None and moved.failed and status != FATAL:
            status = REFUSED
        if status:
            if status != WARNING:
                raise self.failed_step(size, status, self.binding.reached())
            self.warned("a step")
        self.time = time + size

    def returning(self, wanted: bool) -> None:
        """Whether steps may be followed by a return to a state from before them."""
        self._step_arguments = self.binding.step_arguments(not wanted)

    def failed_step(self, size: float, status: int, reached: float | None) -> FmuCallError:
        """The error for a step that returned `status`, or asked to end the simulation.

        Args:
            size: of the step from `time` [s].
            status: what it returned.
            reached: the time at which the FMU of FMI 3 says that it stands [s].
        """
        if self.moved is not None and status == REFUSED:
            return self.moved.refusal(self)
        if status == EARLY:
            return self.refusal(f"a step of {size:.9g} s ended early, at {reached:.9g} s, unasked")
        asked, last = status == ENDED, reached
        if status == STATUS.index("discard"):
            asked, last = self.binding.terminated(self._functions, self.address)
        if not asked:
            return self.failure(f"a step of {size:.9g} s", status)
        end = self.time + size
        at = end if last is None or not self.time <= last < end - SAME * size else last
        messages = take(self._key)
        self.time = at
        return EndRequest(
            f"{self.label}: asked to end the simulation at t = {at:.9g} s"
            + ("".join(f"; {item}" for item in messages)),
            messages,
            time=at,
        )

    def terminate(self) -> None:
        """End the run; values can still be read."""
        if self._terminable:
            self._terminable = False
            self._call("termination", f"fmi{self.binding.version}Terminate")

    def reset(self) -> None:
        """Return to the state after creation."""
        self._call("reset", f"fmi{self.binding.version}Reset")
        self._terminable = False
        self.time = math.nan
        if self.moved is not None:
            self.moved.restart()

    def free(self) -> None:
        """End it; calling it again does nothing."""
        if self._finalizer.alive and self._terminable and not self._dead[0]:
            with contextlib.suppress(FmuCallError):  # the run's errors were raised in the run
                self.terminate()
        self._finalizer()

    # -- states and derivatives --------------------------------------------------------------------

    def _state_function(self, verb: str) -> str:
        if verb.startswith("De"):
            verb = "DeSerialize" if self.binding.version == 2 else "Deserialize"
        return f"fmi{self.binding.version}{verb}{self.binding.STATE}"

    def _require(self, capability: str) -> None:
        if not self.description.can(capability):
            raise FmuCallError(
                f"{self.label}: the FMU declares {capability} = false, so it can not do this"
            )

    def save(self) -> State:
        """Save the state of the instance."""
        self._require("canGetAndSetFMUState")
        pointer = ct.c_void_p()
        self._call("saving the state", self._state_function("Get"), ct.addressof(pointer))
        return State(pointer.value or 0)

    def restore(self, state: State) -> None:
        """Return to a saved state; `time` is the caller's to track."""
        self._call("restoring a state", self._state_function("Set"), state.address)

    def release(self, state: State) -> None:
        """Free a saved state; after `fatal` no call may follow, and it is lost."""
        if self.dead:
            return
        pointer = ct.c_void_p(state.address)
        self._call("releasing a state", self._state_function("Free"), ct.addressof(pointer))

    def serialize(self, state: State) -> bytes:
        """A saved state as bytes, for another process or instance of the same FMU."""
        self._require("canSerializeFMUState")
        size = ct.c_size_t()
        name = f"fmi{self.binding.version}Serialized{self.binding.STATE}Size"
        self._call("serializing a state", name, state.address, ct.addressof(size))
        buffer = ct.create_string_buffer(max(size.value, 1))
        self._call(
            "serializing a state",
            self._state_function("Serialize"),
            state.address,
            ct.addressof(buffer),
            size.value,
        )
        return buffer.raw[: size.value]

    def deserialize(self, content: bytes) -> State:
        """Make a state of this instance from bytes; release it later."""
        self._require("canSerializeFMUState")
        buffer = ct.create_string_buffer(content, max(len(content), 1))
        pointer = ct.c_void_p()
        self._call(
            "deserializing a state",
            self._state_function("Deserialize"),
            ct.addressof(buffer),
            len(content),
            ct.addressof(pointer),
        )
        return State(pointer.value or 0)

    def directional_derivative(
        self, unknowns: Iterable[str], knowns: Iterable[str], seed: ArrayLike
    ) -> Vector:
        """d(unknowns)/d(knowns) times `seed` at the present communication point."""
        self._require("providesDirectionalDerivatives")
        rows = [v for name in unknowns for v in self.description.expand(name)]
        columns = [v for name in knowns for v in self.description.expand(name)]
        direction = np.ascontiguousarray(seed, dtype=np.float64)
        result = np.zeros(sum(v.size for v in rows))
        if direction.size != sum(v.size for v in columns):
            raise ValueRangeError(
                f"{self.label}: {direction.size} seeds for {len(columns)} known variables"
            )
        self._call(
            "a directional derivative",
            self.binding.DIRECTIONAL,
            *self.binding.directional_arguments(
                np.array([v.reference for v in rows], dtype=np.uint32),
                np.array([v.reference for v in columns], dtype=np.uint32),
                direction,
                result,
            ),
        )
        return result


def _free(
    function: Any, address: int, key: int, dead: list[bool], alive: Any, digest: str, name: str
) -> None:
    if not dead[0]:
        announce(name, "being freed")
        function(address)
    forget(key)
    _single.discard(digest)
