"""A co-simulation algorithm as a flat list of operations on one array of values.

Every exchanged variable has a slot in `values`: first, instance by instance, the outputs that are
fetched, then the inputs that are given. An algorithm is the order of operations of one
communication step; it is executed by `interpreter` and can be executed by compiled code, since all
there is are arrays of numbers. Algorithms whose steps are more than such a list bring a `Stepper`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..fmu.values import OBJECTS
from ..system.system import Bond, System

Integers = NDArray[np.int64]
Vector = NDArray[np.float64]


class Op(IntEnum):
    """Operations; a and b are their two numbers."""

    EXTERNAL = 0  # values of external inputs at the present time
    RECORD = 1  # keep observed values if it is their turn; note outputs for the energy of bonds
    COPY = 2  # copies a <= i < b: values[target] = values[source] * gain + offset
    SET = 3  # give inputs to instance a
    STEP = 4  # instance a goes one communication step
    GET = 5  # fetch outputs of instance a
    ENERGY = 6  # add the energy that went over each bond in this step; a = 1: with inputs of HOLD
    SOLVE = 7  # solve algebraic loop a
    NOTE = 8  # remember the outputs that are extrapolated
    EXTRAPOLATE = 9  # means a <= i < b: values[target] = mean over the step (begin, if moving)
    SUBSTEP = 10  # instance a goes part `b % PARTS` of `b // PARTS` of a communication step
    HOLD = 11  # remember the inputs of bonds, before others are set at the end of the step
    SET_DERIVATIVES = (
        12  # tell an instance how its inputs move: means a <= i < b, all of them its own
    )
    MOVE = 13  # mean a: values[target] = mean over part `b % PARTS` of `b // PARTS` of the step


_OPS = tuple(Op)
PARTS = 1 << 16


@dataclass(frozen=True)
class Layout:
    """Which variable is where.

    Attributes:
        instances: names.
        names: full name of each slot.
        outputs, inputs: per instance (first slot, behind last slot).
        fetched, given: per instance the names of the variables behind these slots.
        copy_source, copy_target, copy_gain, copy_offset: connections, sorted by target instance.
        copies: per instance (first, behind last) of the copies into it.
        external: slots of the external inputs.
        record_source, record_gain, record_offset: where observed signals come from.
        objects: per slot, whether it carries an object beside its number (64-bit integers, strings,
            binaries), which the interpreter alone passes on.
        bonds: power bonds.
        bond_index, bond_output, bond_input, bond_sign: their terms.
    """

    instances: tuple[str, ...]
    names: tuple[str, ...]
    outputs: Integers
    inputs: Integers
    fetched: tuple[tuple[str, ...], ...]
    given: tuple[tuple[str, ...], ...]
    copy_source: Integers
    copy_target: Integers
    copy_gain: Vector
    copy_offset: Vector
    copies: Integers
    external: Integers
    record_source: Integers
    record_gain: Vector
    record_offset: Vector
    objects: NDArray[np.bool_]
    bonds: tuple[Bond, ...]
    bond_index: Integers
    bond_output: Integers
    bond_input: Integers
    bond_sign: Vector


@dataclass(frozen=True)
class Loop:
    """An algebraic loop, cut at some outputs.

    Attributes:
        sources: slots of the outputs at which it is cut, the unknowns.
        sweep: operations that pass on their values once around the loop and fetch them again.
        text: the loop port by port.
        single: whether a value of it is a Float32.
    """

    sources: Integers
    sweep: Integers
    text: str
    single: bool


@dataclass(frozen=True)
class Mean:
    """An input that follows a polynomial through its source's values.

    Attributes:
        source, target: slots.
        gain, offset: target = gain * source + offset.
        order: of the polynomial.
        ahead: the source is at the end of the step already (interpolation).
        instance: whose input it is.
        moving: the instance follows value and derivatives at the begin of the step; else it takes
            the mean over the step, held.
        told: it is told the derivatives (FMI 2); else it asks for inputs within the step (FMI 3).
        parts: inner steps of the instance, which gets the mean over each; 1: it goes one step.
        bonded: the input belongs to a power bond, whose energy needs the mean in any case.
    """

    source: int
    target: int
    gain: float
    offset: float
    order: int
    ahead: bool
    instance: int
    moving: bool
    told: bool
    bonded: bool
    parts: int = 1


class Stepper(Protocol):
    """What makes the communication steps of a run, given its `interpreter.Interpreter`.

    A step goes through `communication_step`, which knows what an FMU's request to end means, or
    moves `index` on itself. Slots of inputs may be overwritten between steps (SOLVE exchanges too),
    so a stepper keeps what it needs of them; `extrapolation.smooth` says which connections carry
    values that may be blended.

    Attributes:
        looks_ahead: it must know the inputs of points to come.
    """

    looks_ahead: bool

    def advance(self, last: int) -> None:
        """Go on up to a communication point."""

    def restart(self) -> None:
        """Begin anew, at the first communication point."""

    def save(self) -> Any:
        """What it keeps from step to step, beside what `run` has; a copy."""

    def restore(self, memory: Any) -> None:
        """Return to what `save` gave, of this run or another one of the same outline."""

    def steps(self) -> int:
        """Steps of the whole system that were made, repeated ones too."""

    def report(self) -> Mapping[str, Any]:
        """What the provenance of the recording says of it."""


@dataclass(frozen=True)
class Plan:
    """Operations over a layout.

    Attributes:
        layout: where the values are.
        initial: one sweep over the instances during initialization, repeated until nothing changes.
        step: one communication step.
        final: at the end of the run.
        loops: what SOLVE solves.
        solving: makes outputs consistent at one instant, in the order of direct feedthrough, with
            loops solved.
        means: what EXTRAPOLATE, SET_DERIVATIVES and MOVE set.
        stepper: for algorithms whose steps are more than operations, what makes a stepper of an
            `interpreter.Interpreter`; None if the operations of `step` are all there is.
        algorithm: name of the module that made it, for provenance.
    """

    layout: Layout
    initial: Integers
    step: Integers
    final: Integers
    loops: tuple[Loop, ...] = ()
    solving: Integers = field(default_factory=lambda: operations(()))
    means: tuple[Mean, ...] = ()
    stepper: Callable[[Any], Stepper] | None = None
    algorithm: str = ""


def operations(items: Iterable[Sequence[int]]) -> Integers:
    """Rows (operation, a, b)."""
    rows = [(int(item[0]), *item[1:], 0, 0)[:3] for item in items]
    return np.array(rows, dtype=np.int64).reshape(-1, 3)


def decoded(rows: Integers) -> list[tuple[Op, int, int]]:
    """The operations in these rows, as the interpreter takes them."""
    return [(_OPS[op], a, b) for op, a, b in rows.tolist()]


def lay_out(system: System, external: Sequence[str], observed: Sequence[str]) -> Layout:
    """Give every exchanged variable of a system its slot.

    Args:
        system: the graph.
        external: full scalar names of the inputs that signals drive.
        observed: full scalar names of the variables to record.
    """
    instances = tuple(system.members)
    bonds = tuple(system.bonds())
    fetched: dict[str, dict[str, None]] = {name: {} for name in instances}
    given: dict[str, dict[str, None]] = {name: {} for name in instances}

    def add(table: dict[str, dict[str, None]], full: str) -> None:
        table[full.partition(".")[0]][system.declaration(full).name] = None

    for connection in system.connections:
        add(fetched, connection.source)
        add(given, connection.target)
    for name in external:
        add(given, name)
    passed_in = {connection.target for connection in system.connections} | set(external)
    firsts = [system.first_name(name) for name in observed]
    for name in firsts:
        if name not in passed_in:
            add(fetched, name)

    names: list[str] = []
    spans: dict[str, list[tuple[int, int]]] = {"out": [], "in": []}
    for table, key in ((fetched, "out"), (given, "in")):
        for instance in instances:
            first = len(names)
            variables = system.members[instance].description.variables
            for variable in table[instance]:
                names += [f"{instance}.{element}" for element in variables[variable].elements()]
            spans[key].append((first, len(names)))
    outputs = {name: slot for slot, name in enumerate(names[: spans["out"][-1][1]])}
    inputs = {name: slot for slot, name in enumerate(names) if slot >= spans["out"][-1][1]}

    position = {name: index for index, name in enumerate(instances)}
    wires = sorted(system.connections, key=lambda c: position[c.target.partition(".")[0]])
    into = [position[c.target.partition(".")[0]] for c in wires]
    copies = [(into.index(i), into.index(i) + into.count(i)) if i in into else (0, 0)
              for i in range(len(instances))]  # fmt: skip
    by_target = {c.target: c for c in wires}
    record = []
    for name in firsts:
        wire = by_target.get(name)
        if wire is not None:
            record.append((outputs[wire.source], wire.gain, wire.offset))
        else:
            record.append((inputs[name] if name in external else outputs[name], 1.0, 0.0))
    terms = [(index, outputs[given_], inputs[taken], sign)
             for index, bond in enumerate(bonds) for given_, taken, sign in bond.terms]  # fmt: skip
    return Layout(
        instances=instances,
        names=tuple(names),
        outputs=np.array(spans["out"], dtype=np.int64),
        inputs=np.array(spans["in"], dtype=np.int64),
        fetched=tuple(tuple(fetched[name]) for name in instances),
        given=tuple(tuple(given[name]) for name in instances),
        copy_source=np.array([outputs[c.source] for c in wires], dtype=np.int64),
        copy_target=np.array([inputs[c.target] for c in wires], dtype=np.int64),
        copy_gain=np.array([c.gain for c in wires], dtype=np.float64),
        copy_offset=np.array([c.offset for c in wires], dtype=np.float64),
        copies=np.array(copies, dtype=np.int64),
        external=np.array([inputs[name] for name in external], dtype=np.int64),
        record_source=np.array([item[0] for item in record], dtype=np.int64),
        record_gain=np.array([item[1] for item in record], dtype=np.float64),
        record_offset=np.array([item[2] for item in record], dtype=np.float64),
        objects=np.array([system.declaration(name).type in OBJECTS for name in names], np.bool_),
        bonds=bonds,
        bond_index=np.array([term[0] for term in terms], dtype=np.int64),
        bond_output=np.array([term[1] for term in terms], dtype=np.int64),
        bond_input=np.array([term[2] for term in terms], dtype=np.int64),
        bond_sign=np.array([term[3] for term in terms], dtype=np.float64),
    )


def initial_sweep(system: System, layout: Layout) -> Integers:
    """Exchange connected values once, in the order of direct feedthrough."""
    position = {name: index for index, name in enumerate(layout.instances)}
    rows: list[tuple[int, ...]] = [(Op.EXTERNAL,)]
    for name in system.order():
        index = position[name]
        rows += exchange(layout, index)
        rows.append((Op.GET, index))
    return operations(rows)


def exchange(layout: Layout, index: int) -> list[tuple[int, ...]]:
    """Operations that bring the newest connected values into one instance."""
    first, last = (int(item) for item in layout.copies[index])
    return [(Op.COPY, first, last), (Op.SET, index)]


def final_operations(consistent: Sequence[tuple[int, ...]] = ()) -> Integers:
    """Operations at the end of a run; `consistent` are those before recording."""
    return operations([(Op.EXTERNAL,), *consistent, (Op.RECORD,)])
