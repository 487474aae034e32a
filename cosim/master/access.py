"""What names of variables mean to a run in steps: where a value comes from, where one goes."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arguments import need_number
from ..data.signals import SignalVector, Table
from ..errors import GraphError, UnitError, UnknownNameError, ValueRangeError, listing
from ..fmu.exchange import Block
from ..fmu.values import check_values
from ..fmu.variables import Variable
from ..spec.units import change
from ..system.inputs import Driver
from .driven import DrivenInputs
from .interpreter import Interpreter

WHOLE = 1e-6
"""Part of a communication step by which a duration may miss a whole number of them, as in runs."""


@dataclass(frozen=True)
class Target:
    """Where a value goes.

    Attributes:
        variables: what is set.
        member: position of the instance.
        name: of the variable in it.
        columns: of the driven inputs; None: the FMU is told at once.
    """

    variables: Sequence[Variable]
    member: int
    name: str
    columns: tuple[int, ...] | None


@dataclass(frozen=True)
class Source:
    """Where a value comes from.

    Attributes:
        slot: of the exchanged values, -1 if it is not one of them.
        gain, offset: value = gain * slot + offset.
        column: of the driven inputs, -1 if it is none.
        block: asks the FMU.
        element: of the block; None: all of it.
    """

    slot: int = -1
    gain: float = 1.0
    offset: float = 0.0
    column: int = -1
    block: Block | None = None
    element: int | None = None


class Access:
    """Sources and targets by name, found once each.

    Args:
        run: the run.
        driven: names of the inputs that signals drive.
    """

    def __init__(self, run: Interpreter, driven: Sequence[str]) -> None:
        self._run, self._system = run, run.system
        self._driven = {name: column for column, name in enumerate(driven)}
        self._members = {name: index for index, name in enumerate(run.system.members)}
        names = run.layout.names
        first = int(run.layout.inputs[0, 0])
        self._slots = {names[slot]: slot for slot in range(first, len(names))}
        self._targets: dict[str, Target] = {}
        self._sources: dict[str, Source] = {}

    def target(self, name: str) -> Target:
        """Where a value that is set goes.

        Raises:
            UnknownNameError: no such variable, or none that can be set.
            GraphError: an FMU drives it.
        """
        found = self._targets.get(name)
        if found is None:
            found = self._targets[name] = self._find_target(name)
        return found

    def _find_target(self, name: str) -> Target:
        system = self._system
        member, variables = system.variables(name)
        for variable in variables:
            kind, variability = variable.causality, variable.variability
            if kind == "input" or (kind == "parameter" and variability == "tunable"):
                continue
            way = (
                "give it as a parameter when you open the twin"
                if kind == "parameter"
                else listing(system.open_inputs(), name)
            )
            raise UnknownNameError(
                f"{member.name}.{variable.name} cannot be set in steps: it is a variable of "
                f"causality {kind!r} and variability {variability!r} (inputs and tunable "
                f"parameters can); {way}"
            )
        elements = [system.first_name(element) for element in system.elements(name)]
        for element in elements:
            source = system.driver(element)
            if source is not None:
                raise GraphError(
                    f"input {element} is driven by {source}; set what drives that, or drop the "
                    f"connection. Inputs to set: {listing(system.open_inputs(), name)}"
                )
        columns = tuple(self._driven[e] for e in elements if e in self._driven)
        whole = len(columns) == len(elements)
        return Target(
            variables,
            self._members[member.name],
            name.partition(".")[2],
            columns if whole else None,
        )

    def put(self, name: str, value: Any, inputs: DrivenInputs) -> None:
        """Give a target a value; where a signal drives an element, in place of that signal.

        Raises:
            ValueRangeError: out of bounds, or not finite.
        """
        target = self.target(name)
        items = check_values(name, target.variables, value)
        if target.columns is not None:
            for column, item in zip(target.columns, items, strict=True):
                inputs.set(column, item)
            return
        run, layout = self._run, self._run.layout
        run.instances[target.member].set({target.name: value})
        for alias, item in zip(self._system.elements(name), items, strict=True):
            element = self._system.first_name(alias)
            slot = self._slots.get(element, -1)
            if element in self._driven:
                inputs.set(self._driven[element], item)
            elif slot >= 0 and layout.objects[slot]:
                run.objects[slot] = item
            elif slot >= 0:  # beside driven ones: steps give arrays as a whole
                run.values[slot] = float(item)

    def source(self, name: str) -> Source:
        """Where the value of a variable comes from.

        Raises:
            UnknownNameError: no such variable.
        """
        found = self._sources.get(name)
        if found is None:
            found = self._sources[name] = self._find_source(name)
        return found

    def _find_source(self, name: str) -> Source:
        system, layout = self._system, self._run.layout
        member, variables = system.variables(name)
        elements = system.elements(name)
        if elements == [name]:
            first = system.first_name(name)
            if first in self._driven:
                return Source(column=self._driven[first])
            outputs = layout.names[: int(layout.outputs[-1, 1])]
            if first in outputs and not layout.objects[outputs.index(first)]:
                return Source(slot=outputs.index(first))
            for connection in system.connections:
                if (
                    connection.target == first
                    and not layout.objects[outputs.index(connection.source)]
                ):
                    return Source(
                        outputs.index(connection.source), connection.gain, connection.offset
                    )
        instance = self._run.instances[self._members[member.name]]
        element = variables[0].index if elements == [name] else None
        wholes = [member.description.whole(variable.name) for variable in variables]
        return Source(block=Block(instance, wholes), element=element)

    def fetch(self, source: Source) -> Any:
        """Ask the FMU."""
        assert source.block is not None
        source.block.get()
        items = source.block.contents()
        if source.element is not None:
            return items[source.element]
        if len(items) == 1:
            return items[0]
        return items if any(isinstance(i, (str, bytes)) for i in items) else np.array(items)

    def convert(self, name: str, value: Any, unit: str, *, into: bool) -> Any:
        """A value in the variable's own unit (`into`), or from it in another one.

        Raises:
            UnitError: the units do not convert.
        """
        declared = self._system.declaration(self._system.elements(name)[0])
        if declared.unit is None:
            raise UnitError(f"{name} declares no unit, so {unit!r} does not convert")
        try:
            gain, offset = change(unit, declared.unit, back=not into, difference=declared.relative)
        except UnitError as error:
            raise UnitError(f"{name} in {unit!r}: {error}") from error
        shifted = np.asarray(value) * gain + offset
        return float(shifted) if shifted.ndim == 0 else shifted


def held(driver: Driver) -> Driver:
    """What holds its last value beyond its end."""
    if isinstance(driver, SignalVector):
        return SignalVector(tuple(held(item) for item in driver.signals))  # type: ignore[misc]
    if isinstance(driver, Table):
        driver = copy.copy(driver)
        driver.extend = True
    return driver


def whole_steps(duration: float, step: float) -> int:
    """How many communication steps a duration is.

    Raises:
        ValueRangeError: no whole number of them.
    """
    need_number("the duration of a step", duration, "give it in seconds")
    count = round(duration / step) if math.isfinite(duration) else 0
    if count < 1 or abs(count * step - duration) > WHOLE * step:
        raise ValueRangeError(
            f"a step of {duration:.9g} s is not a whole number of communication steps of "
            f"{step:.9g} s; take {max(count, 1) * step:.9g} s"
        )
    return count
