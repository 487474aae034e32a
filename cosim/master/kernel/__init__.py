"""The compiled executor of plans: finds its library and binds a run to it; `stepper` uses it.

The library is part of an installed wheel; in a checkout it is compiled into the cache when FMUs are
built. Without one, runs use the executor in Python, which gives the same numbers, bit for bit.
"""

from __future__ import annotations

import ctypes as ct
import hashlib
import math
import platform
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...fmu.exchange import Block
from ...fmu.instance import Instance
from ...fmu.library import WORK
from ...fmu.surroundings import MODES
from ...spec import cache
from ..input_derivatives import InputDerivatives
from ..interpreter import Interpreter
from ..plan import Op
from . import instructions as made
from . import structures

SOURCES = tuple(
    Path(__file__).with_name(name) for name in ("kernel.c", "extrapolation.c", "newton.c", "run.h")
)
"""Of the library; the first is compiled and includes the others."""
_TYPES = (
    "Float64", "Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Enumeration",
    "Boolean", "Boolean2", "Float32Whole",
)  # fmt: skip
_TYPE_CODES = {**{name: code for code, name in enumerate(_TYPES)}, "Enumeration2": 6}


UNFIT = 1002
"""Status of a set call that was not made, because a number does not fit the variable's type."""
UNSETTLED = 1003
"""Status of an algebraic loop that has no solution or does not settle."""
SAVE, RESTORE, FORGET = range(3)
"""What `Kernel.states` does."""
TOO_LONG, TOO_LARGE = 1004, 1005
"""Statuses of a run that took more than its limit, and of one that ran away."""


@dataclass(frozen=True)
class Standing:
    """Where a compiled run stands: step, rows, and what is under way (-1: it is not this)."""

    index: int = 0
    row: int = 0
    call: int = -1
    member: int = -1
    derivatives: int = -1


def standing(memory: NDArray[np.uint8]) -> Standing:
    """Where a run of another process stands, whose structure is in shared memory."""
    run = structures.Run.from_buffer(memory.data)
    begins = [run.calls or 0, run.members or 0, run.derivatives or 0]
    found = [-1, -1, -1]
    if at := run.at:  # read once: the other process goes on
        # arrays are apart: the one that begins last before the address holds it
        near = max(range(3), key=lambda kind: begins[kind] if begins[kind] <= at else -1)
        size = ct.sizeof((structures.Call, structures.Member, structures.Derivatives)[near])
        found[near] = (at - begins[near]) // size
    return Standing(int(run.index), int(run.row), *found)


def library_name(target: str = "") -> str:
    """File name of the library for these sources.

    Args:
        target: machine and system, such as x86_64-linux; this machine's if not given.
    """
    if not target:
        machine = platform.machine().lower()
        machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
        target = f"{machine}-{platform.system().lower()}"
    suffix = {"windows": ".dll", "darwin": ".dylib"}.get(target.rpartition("-")[2], ".so")
    return f"kernel-{_digest(SOURCES)}-{target}{suffix}"


@lru_cache(maxsize=1)
def _digest(sources: tuple[Path, ...]) -> str:
    """Of the sources, read once: a system of short runs asks for the library hundreds of times."""
    return hashlib.sha256(b"\0".join(path.read_bytes() for path in sources)).hexdigest()[:16]


def cache_folder() -> Path:
    """Where a checkout keeps the library that it compiled."""
    return cache.cache_folder() / "kernel"


@lru_cache(maxsize=1)
def load(path: str) -> Any:
    """The library of a path."""
    library = ct.CDLL(path)
    library.cosim_run.argtypes, library.cosim_run.restype = [structures.P, structures.I64], ct.c_int
    library.cosim_run_within.argtypes = [structures.P, structures.I64, structures.D, structures.D]
    library.cosim_run_within.restype = ct.c_int
    library.cosim_do.argtypes = [
        structures.P,
        structures.I64,
        structures.I64,
        structures.D,
        structures.D,
    ]
    library.cosim_do.restype = ct.c_int
    library.cosim_states.argtypes, library.cosim_states.restype = [structures.P, ct.c_int], ct.c_int
    library.cosim_size.argtypes, library.cosim_size.restype = [ct.c_int], structures.I64
    sizes = [library.cosim_size(what) for what in range(len(structures.ALL))]
    expected = [ct.sizeof(kind) for kind in structures.ALL]
    if sizes != expected:
        raise OSError(f"{path}: its structures have sizes {sizes}, expected {expected}")
    return library


def find() -> Path | None:
    """The library, None if this machine has none."""
    installed, compiled = (
        folder / library_name() for folder in (SOURCES[0].parent / "lib", cache_folder())
    )
    if installed.is_file():
        return installed
    try:
        stat = compiled.stat()
    except OSError:
        return None
    return compiled if _whole(compiled, stat.st_mtime_ns, stat.st_size) else None


@lru_cache(maxsize=8)
def _whole(path: Path, changed: int, size: int) -> bool:
    """Whether a compiled library is as it was written; loading another one may end the process."""
    return bool(cache.sealed(path, path.read_bytes()))


class Kernel:
    """A run bound to the compiled executor.

    Args:
        bound: the run, whose arrays it works on.
        programs: sequences of operations for `do`; steps may be taken back then.
    """

    def __init__(
        self, bound: Interpreter, programs: Sequence[NDArray[np.int64]] | None = None
    ) -> None:
        path = find()
        if path is None:
            raise FileNotFoundError(library_name())
        self._library = load(str(path))
        plan = bound.plan
        layout, instances = plan.layout, bound.instances
        self._keep: list[Any] = [bound]
        self._made: dict[type[ct.Structure], Any] = {}
        self._same: dict[bytes, NDArray[np.uint32]] = {}
        self._bound = bound
        self._parts: list[tuple[Op, Instance, Any]] = []
        self._instances = instances
        self._told: list[tuple[Instance, NDArray[np.uint32]]] = []
        calls: list[structures.Call] = []
        spans: dict[tuple[Op, int], tuple[int, int]] = {}
        for op, blocks, slots in (
            (Op.SET, bound.inputs, layout.inputs),
            (Op.GET, bound.outputs, layout.outputs),
        ):
            for index, (instance, block) in enumerate(zip(instances, blocks, strict=True)):
                first = len(calls)
                for part in block.parts:
                    calls.append(self._call(op, instance, block, part, int(slots[index, 0])))
                    self._parts.append((op, instance, part))
                spans[op, index] = (first, len(calls))
        fewer = self._fewer(calls)
        self.run = structures.Run(
            members=self._structures(structures.Member, map(_member, instances)),
            n_members=len(instances),
            calls=self._structures(structures.Call, calls),
            values=self._array(bound.values),
            times=self._array(bound.times),
            step=bound.step,
            end=bound.outline.end,
            bounded=bound.outline.end - 2.0 * bound.step,
            external=self._array(bound.external),
            external_slot=self._array(layout.external),
            n_external=bound.external.shape[1],
            copies=self._structures(
                structures.Copy,
                zip(
                    layout.copy_gain.tolist(), layout.copy_offset.tolist(),
                    layout.copy_source.tolist(), layout.copy_target.tolist(), strict=True,
                ),
            ),
            records=self._structures(
                structures.Copy,
                zip(
                    layout.record_gain.tolist(), layout.record_offset.tolist(),
                    layout.record_source.tolist(), range(bound.rows.shape[1]), strict=True,
                ),
            ),
            n_record=bound.rows.shape[1],
            every=bound.every,
            rows=self._array(bound.rows),
            terms=self._structures(
                structures.Term,
                zip(
                    layout.bond_sign.tolist(), *[[0.0] * len(layout.bond_sign)] * 2,
                    layout.bond_output.tolist(), layout.bond_input.tolist(),
                    layout.bond_index.tolist(),
                    bound.bond_mean, strict=True,
                ),
            ),
            bond_energy=self._array(bound.bond_energy),
            bond_turnover=self._array(bound.bond_turnover),
            n_terms=len(layout.bond_output),
            final=programs is None,
            sparse=bound.sparse,
            carried=made.carried(plan),
        )  # fmt: skip
        if bound.witness is not None:
            self.run = bound.witness.compiled(self.run)
        told = self._derivatives(bound.derivatives)
        instructions = made.instructions(plan, plan.step, spans, calls, instances, told, fewer)
        self.run.n_instructions = len(instructions)
        loops = []
        for loop, newton in zip(plan.loops, bound.newtons, strict=True):
            first = len(instructions)
            instructions += made.instructions(plan, loop.sweep, spans, calls, instances, told)
            loops.append(
                structures.Loop(
                    self._array(loop.sources),
                    self._array(newton.inverse),
                    self._array(newton.valid),
                    self._array(newton.floor),
                    self._array(np.zeros(5 * newton.n + 2 * newton.n**2)),
                    newton.tolerance,
                    newton.increment,
                    newton.n,
                    first,
                    len(instructions),
                )
            )
        self.run.loops = self._structures(structures.Loop, loops)
        self._programs = []
        for program in programs or ():
            first = len(instructions)
            instructions += made.instructions(plan, program, spans, calls, instances, told)
            self._programs.append((first, len(instructions)))
        self.run.instructions = self._structures(structures.Instruction, instructions)
        self.run.means = self._structures(
            structures.Mean,
            (
                (m.gain, m.offset, m.source, m.target, alike, m.order, m.ahead, m.moving, m.bonded)
                for m, alike in zip(plan.means, made.alike(plan.means), strict=True)
            ),
        )
        self.run.n_means = len(plan.means)
        self.run.history, self.run.past = self._array(bound.history), self._array(bound.past)
        if bound.witness is not None:
            numbers = {instance: number for number, instance in enumerate(instances)}
            bound.witness.list_calls(
                [(int(op), numbers[instance]) for op, instance, _ in self._parts],
                [(int(Op.SET_DERIVATIVES), numbers[instance]) for instance, _ in self._told],
            )

    def _fewer(self, calls: list[structures.Call]) -> dict[int, made.Fetched]:
        """Calls that fetch no more than is read before the same outputs are fetched again.

        They are added to `calls`; returned are their numbers by row of `plan.step`.
        """
        bound, found = self._bound, {}
        plan, needed = bound.plan, made.needed(bound.plan)
        beside = made.only_recorded(plan) if bound.sparse and bound.every > 1 else set()
        for row, (op, index, _) in enumerate(plan.step.tolist()):
            whole = range(*bound.layout.outputs[index].tolist()) if op == Op.GET else range(0)
            slots = needed.get(row, list(whole))
            if len(slots) == len(whole) and beside.isdisjoint(slots):
                continue
            spans = []
            for some in ([s for s in slots if s not in beside], [s for s in slots if s in beside]):
                first = len(calls)
                calls += self._some(index, some)
                spans.append((first, len(calls)))
            found[row] = made.Fetched(*spans)
        return found

    def _some(self, index: int, slots: Sequence[int]) -> list[structures.Call]:
        """Calls that fetch these outputs of an instance, and what must be fetched with them."""
        instance, block = self._instances[index], self._bound.outputs[index]
        base = int(self._bound.layout.outputs[index, 0])
        own, found = [slot - base for slot in slots], []
        for part in block.parts:
            call = self._call(Op.GET, instance, block, part, base)
            if call.slots or part.references.size != part.buffer.size:
                taken = [call] if own else []
            else:
                taken = []
                for begin, end in made.stretches(own):
                    some = structures.Call.from_buffer_copy(call)
                    some.references = self._references(part.references[begin:end])
                    some.buffer = part.buffer[begin:end].ctypes.data
                    some.n_references = some.n_values = end - begin
                    taken.append(some)
            found += taken
            self._parts += [(Op.GET, instance, part)] * len(taken)
        return found

    def _derivatives(self, derivatives: InputDerivatives) -> dict[tuple[int, int], tuple[int, int]]:
        """Bind the calls; per SET_DERIVATIVES operation the first and behind the last."""
        self.run.average = self._array(derivatives.average)
        self.run.slope = self._array(derivatives.slope)
        self.run.curve = self._array(derivatives.curve)
        rows: list[structures.Derivatives] = []
        told = {}
        for key, told_calls in derivatives.calls.items():
            for call in told_calls:
                instance = self._instances[call.instance]
                rows.append(
                    structures.Derivatives(
                        instance.address, instance.functions["fmi2SetRealInputDerivatives"],
                        self._references(call.references), call.orders.ctypes.data,
                        call.values.ctypes.data, call.references.size,
                    )
                )  # fmt: skip
                self._told.append((instance, call.references))
            told[key] = (len(rows) - len(told_calls), len(rows))
        self.run.derivatives = self._structures(structures.Derivatives, rows)
        return told

    def _array(self, array: NDArray[Any]) -> int:
        """Address of an array of 8-byte numbers, which is kept alive."""
        if not array.flags.c_contiguous or array.dtype not in (np.float64, np.int64):
            raise TypeError("not a contiguous array of float64 or int64")
        self._keep.append(array)
        return int(array.ctypes.data)

    def _references(self, references: NDArray[np.uint32]) -> int:
        """Address of value references: one for all calls that have the same, as FMUs of a kind do.

        They stay in the processor's cache then, however many instances there are.
        """
        content = references.tobytes()
        return int(self._same.setdefault(content, references.copy()).ctypes.data)

    def _structures(self, kind: type[ct.Structure], rows: Iterable[Any]) -> int:
        """Address of C structures with these contents, which are kept alive."""
        items = [row if isinstance(row, kind) else kind(*row) for row in rows]
        array = (kind * max(len(items), 1))(*items)
        self._keep.append(array)
        self._made[kind] = array
        return ct.addressof(array)

    def _call(
        self, op: Op, instance: Instance, block: Block, part: Any, base: int
    ) -> structures.Call:
        slots = 0
        if part.buffer is not block.values:
            within = np.arange(block.values.size)[part.slots]
            slots = self._array(np.ascontiguousarray(within + base, dtype=np.int64))
        names = instance.binding.SET if op is Op.SET else instance.binding.GET
        return structures.Call(
            instance.address, instance.functions[names[part.type]],
            self._references(part.references), part.buffer.ctypes.data, slots,
            part.references.size, part.buffer.size,
            _TYPE_CODES[part.type], instance.binding.version,
        )  # fmt: skip

    def advance(self, last: int) -> int:
        """Communication steps up to `last`; 0, or the status that ended it."""
        self._enter()
        return int(self._library.cosim_run(ct.addressof(self.run), last))

    def advance_within(self, last: int, limit: float, most: float) -> int:
        """The same within some work (see `Session.run`), while no recorded value is above `most`.

        It does not return in between: each time, a thread would wait for the interpreter lock.
        """
        self._enter()
        return int(self._library.cosim_run_within(ct.addressof(self.run), last, limit, most))

    def do(self, program: int, time: float, size: float) -> int:
        """A program, whose steps have this size and begin at this time; 0, or what ended it."""
        first, last = self._programs[program]
        return int(self._library.cosim_do(ct.addressof(self.run), first, last, time, size))

    def states(self, what: int) -> int:
        """All instances SAVE, RESTORE or FORGET their states; 0, or the first refusal."""
        return int(self._library.cosim_states(ct.addressof(self.run), what))

    def _enter(self) -> None:
        if self._bound.witness is not None:
            self._bound.witness.enter()

    def restart(self) -> None:
        """Begin again at the first communication point."""
        self.run.index = self.run.row = self.run.next_record = 0

    def save(self) -> bytes:
        """What it keeps beside the run's arrays: outputs noted for the energy of bonds."""
        return bytes(self._made[structures.Term])

    def restore(self, terms: bytes) -> None:
        """Return to what `save` gave, at the communication point where the run stands."""
        ct.memmove(self._made[structures.Term], terms, len(terms))
        self.run.index, self.run.row = self._bound.index, self._bound.row
        self.run.next_record = -(-self._bound.index // self._bound.every) * self._bound.every

    def reached(self) -> float | None:
        """The time that the failed step has reached, where the FMU says so [s]."""
        instance = self._instances[self.run.failed_member]
        if instance.binding.version != 3:
            return None
        return float(self._made[structures.Member][self.run.failed_member].reached)

    def hand_over(self) -> None:
        """Give the interpreter what it needs to go on within a step."""
        terms = list(self._made[structures.Term])[: len(self._bound.previous)]
        self._bound.previous = [term.previous for term in terms]
        self._bound.held[:] = [term.held for term in terms]

    def note_warnings(self) -> None:
        """Tell the instances which of their calls returned warnings."""
        for (op, instance, _), call in zip(self._parts, self._made[structures.Call], strict=False):
            if call.warned:
                instance.warned("getting values" if op is Op.GET else "setting values", math.nan)
        for instance, member in zip(self._instances, self._made[structures.Member], strict=False):
            if member.warned:
                instance.warned("a step", math.nan)
            if member.modes:
                instance.changed(MODES, "a step")

    def failed(self) -> tuple[Op, Instance | None, Any]:
        """What failed: operation, instance and what it was about.

        That is the part of its block for get and set calls, and the value references of inputs
        whose derivatives were refused.
        A recorded value that is not finite belongs to no instance.
        """
        call, member = int(self.run.failed_call), int(self.run.failed_member)
        derivative = int(self.run.failed_derivatives)
        if call >= 0:
            return self._parts[call]
        if derivative >= 0:
            instance, references = self._told[derivative]
            return Op.SET_DERIVATIVES, instance, references
        if member >= 0:
            return Op.STEP, self._instances[member], None
        return Op.RECORD, None, None


def _member(instance: Instance) -> structures.Member:
    functions = instance.functions
    step = functions[f"fmi{instance.binding.version}DoStep"]
    binding = instance.binding
    states = [
        functions.get(f"fmi{binding.version}{verb}{binding.STATE}", 0)
        for verb in ("Get", "Set", "Free")
    ]
    update = instance.moved.address if instance.moved is not None else 0
    kept = (*states, 0, update)
    return structures.Member(instance.address, step, functions.get(WORK, 0), 0.0, 0, 0, *kept)
