"""Reads SSP packages, ours and anybody's, into systems."""

from __future__ import annotations

import csv
import json
import math
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data.signals import Signal
from ..errors import listing
from ..fmu.archive import Fmu
from ..reading import markup
from ..reading.limits import TEXT
from ..spec.units import Unit
from ..system.system import System
from ..system.toml import DeclaredConnection, SystemFile
from . import flatten
from .document import File, Structure, open_package, read_structure
from .flatten import Net, shown
from .values import Scalar, Value, read_binding

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Experiment:
    """How a package is meant to be run; None where it does not say.

    Attributes:
        start, stop, step: [s].
        algorithm: a co-simulation algorithm of ours.
        options: of the algorithm.
        tolerance: handed to the FMUs, None for their own.
    """

    start: float | None = None
    stop: float | None = None
    step: float | None = None
    algorithm: str | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    tolerance: float | None = None


@dataclass(frozen=True)
class Terminal:
    """A variable behind a connector of the root system: `inside = factor * outside + offset`.

    For outputs it is `outside = factor * inside + offset`.

    Attributes:
        unit: outside, of an input; None if nothing on the way has one.
        relative: the variable is a difference, which offsets of units do not move.
    """

    name: str
    factor: float
    offset: float
    unit: Unit | None = None
    relative: bool = False


@dataclass(frozen=True)
class Package:
    """What a package holds, nested systems flattened.

    Attributes:
        system: instances, connections, parameters.
        experiment: how it is meant to be run.
        inputs, outputs: connectors of the root system -> variables of FMUs.
        signals: full names of inputs -> signals that came with the package.
        ignored: parameters of a set for several elements that match none in this one.
        elements: element of the package, `sub.motor` -> instance, `sub_motor`.
    """

    system: SystemFile
    experiment: Experiment
    inputs: Mapping[str, tuple[Terminal, ...]] = field(default_factory=dict)
    outputs: Mapping[str, Terminal] = field(default_factory=dict)
    signals: Mapping[str, Signal] = field(default_factory=dict)
    ignored: tuple[str, ...] = ()
    elements: Mapping[str, str] = field(default_factory=dict)


def read(path: Path | str, *, ssd: str = "SystemStructure.ssd") -> System:
    """Read a package into a system.

    Args:
        path: an .ssp archive, a folder with its content, or an .ssd file.
        ssd: which structure, where a package holds several.

    Raises:
        ScenarioError: it cannot be read; the text names the element.
        FmuFileError: an FMU inside cannot be read.
        GraphError: its connections, values or units are wrong.
    """
    return read_package(path, ssd=ssd).system.build(None)


def read_package(path: Path | str, *, ssd: str = "SystemStructure.ssd") -> Package:
    """Read a package with what lies beside its system (see `read`)."""
    structure = read_structure(open_package(Path(path), ssd))
    return _Flat(structure).package()


class _Flat:
    """A structure with its FMUs opened."""

    def __init__(self, structure: Structure) -> None:
        self.structure, self.file = structure, structure.file
        self.net = Net(structure)
        if not self.net.fmus:
            raise self.file.error("holds no FMU")
        self.names: dict[flatten.Path, str] = {}
        for place in self.net.fmus:
            name = re.sub(r"\W", "_", "_".join(place))
            name = name if name.isidentifier() else f"_{name}"
            taken, number = name, 2
            while taken in self.names.values():
                taken, number = f"{name}_{number}", number + 1
            self.names[place] = taken
        self.ignored: list[str] = []
        self.sizes: dict[str, int] = {}

    def full(self, node: flatten.Node) -> str:
        """Full name of the scalar variable at a node of an FMU."""
        variable = self.net.variable(node[0], node[1])
        return f"{self.names[node[0]]}.{variable.elements()[node[2]]}"

    def package(self) -> Package:
        wires, outputs = self.wires()
        inputs = self.inputs(outputs)
        experiment, signals = self.experiment()
        system = SystemFile(
            path=self.file.path,
            name=self.structure.name,
            text=self.structure.text,
            instances={
                name: self.reference(self.net.components[place].source)
                for place, name in self.names.items()
            },
            parameters=self.parameters(),
            connections=tuple(wires),
            shown=self.file.shown,
        )
        return Package(
            system, experiment, inputs, outputs, signals, tuple(self.ignored),
            {".".join(place): name for place, name in self.names.items()},
        )  # fmt: skip

    def reference(self, source: File | None) -> str:
        assert source is not None  # components have one
        return Path(os.path.relpath(source.path, self.file.path.parent)).as_posix()

    # -- connections -------------------------------------------------------------------------------

    def wires(self) -> tuple[list[DeclaredConnection], dict[str, Terminal]]:
        """Connections between FMUs, in the order of the file, and outputs of the root system."""
        found: dict[tuple[str, str], list[tuple[int, int, float, float]]] = {}
        order: dict[tuple[str, str], int] = {}
        outputs: dict[str, Terminal] = {}
        for start in self.net.outputs():
            source = f"{self.names[start[0]]}.{start[1]}"
            for route in self.net.routes(start):
                change = (route.factor, route.offset)
                if self.net.leaf(route.end) is None:
                    outputs[_element(route.end)] = Terminal(self.full(start), *change)
                else:
                    target = f"{self.names[route.end[0]]}.{route.end[1]}"
                    found.setdefault((source, target), []).append((start[2], route.end[2], *change))
                    order.setdefault((source, target), route.order)
            self.sizes[source] = self.net.variable(start[0], start[1]).size
        sequence = sorted(found, key=order.__getitem__)
        return [self.wire(*ends, found[ends]) for ends in sequence], outputs

    def wire(
        self, source: str, target: str, ways: list[tuple[int, int, float, float]]
    ) -> DeclaredConnection:
        """One wire for a scalar, or for an array that is joined as a whole."""
        size = self.sizes[source]
        order = sorted((start, end) for start, end, _, _ in ways)
        changes = {(factor, offset) for _, _, factor, offset in ways}
        if order != [(index, index) for index in range(size)] or len(changes) > 1:
            raise self.file.error(
                f"connection {source} - {target} joins single elements of arrays; only whole "
                "arrays can be connected"
            )
        return DeclaredConnection(source, target, *changes.pop(), False)

    def inputs(self, outputs: Mapping[str, Terminal]) -> dict[str, tuple[Terminal, ...]]:
        """Inputs of the root system."""
        found = {}
        root = self.structure.system
        for connector in root.connectors.values():
            for index in range(connector.size):
                node: flatten.Node = ((), connector.name, index)
                if _element(node) in outputs:
                    continue
                terminals = tuple(
                    Terminal(
                        self.full(route.end), route.factor, route.offset, route.unit, leaf.relative
                    )
                    for route in self.net.routes(node)
                    if (leaf := self.net.leaf(route.end)) is not None and leaf.causality == "input"
                )
                if terminals:
                    found[_element(node)] = terminals
        return found

    # -- parameters --------------------------------------------------------------------------------

    def parameters(self) -> dict[str, Any]:
        """Full name -> value; enclosing systems win over what they hold, later over earlier."""
        found: dict[str, Any] = {}
        used: dict[tuple[Path, str], list[bool]] = {}
        unmatched: list[tuple[flatten.Path, str, Value]] = []
        places = [*self.net.components, *self.net.systems]
        for place in sorted(places, key=len, reverse=True):
            element = self.net.components.get(place) or self.net.systems[place]
            fmu = self.net.fmus.get(place)
            for binding in element.bindings:
                inside = fmu.folder if fmu else None
                for name, value in read_binding(binding, shown(place), inside):
                    targets = self.targets(place, name)
                    used.setdefault((value.file.path, value.origin), []).append(bool(targets))
                    if not targets:
                        unmatched.append((place, name, value))
                    for route in targets:
                        self.assign(found, route, value)
        for place, name, value in unmatched:
            if not any(used[value.file.path, value.origin]):
                names = self.names_in(place)
                raise value.file.error(
                    f"{value.origin} matches nothing in {shown(place)}, which has no {name!r}; "
                    f"{listing(names, name)}"
                )
            self.ignored.append(".".join((*place, name)))
        return found

    def names_in(self, place: flatten.Path) -> list[str]:
        """Names that a parameter of an element may have."""
        if place in self.net.fmus:
            variables = self.net.fmus[place].description.variables.values()
            return [v.name for v in variables if v.causality in ("parameter", "input", "local")]
        system = self.net.systems.get(place)
        if system is None:
            return []
        return [
            *(c.name for c in system.connectors.values() if c.kind != "output"),
            *(f"{child}.{name}" for child in system.elements or {}
              for name in self.names_in((*place, child))),
        ]  # fmt: skip

    def targets(self, place: flatten.Path, name: str) -> list[flatten.Route]:
        """The variables that a name means, seen from an element."""
        fmu = self.net.fmus.get(place)
        if fmu is not None:
            known = fmu.description.variables
            if name not in known:
                return []
            node: flatten.Node = (place, name, -1)
            return [flatten.Route(node, 1.0, 0.0, known[name].unit)]
        system = self.net.systems.get(place)
        if system is None:  # a reference to a signal dictionary
            return []
        found: list[flatten.Route] = []
        if name in system.connectors and system.connectors[name].kind != "output":
            routes = self.net.routes((place, name, 0))
            found += [route for route in routes if self.net.leaf(route.end) is not None]
        for child in system.elements or {}:
            if name.startswith(f"{child}."):
                found += self.targets((*place, child), name[len(child) + 1 :])
        return found

    def assign(self, found: dict[str, Any], route: flatten.Route, value: Value) -> None:
        place, name, index = route.end
        variable = self.net.variable(place, name)
        items = _items(self.net.fmus[place], name) if value.kind == "item" else {}
        given = value.given(route.unit, items, variable.relative)
        if (route.factor, route.offset) != (1.0, 0.0):
            given = [
                item if isinstance(item, str) else route.factor * float(item) + route.offset
                for item in given
            ]
        if variable.type in ("Float64", "Float32"):
            given = [self.exact(item, value, route) for item in given]
        if index >= 0 and variable.size > 1:  # one element, through a connector of a system
            key, size = f"{self.names[place]}.{variable.elements()[index]}", 1
        else:
            key, size = f"{self.names[place]}.{name}", variable.size
        if len(given) != size:
            raise value.file.error(
                f"{value.origin} has {len(given)} values, but {shown(place)}.{name} takes {size}"
            )
        if variable.causality == "structuralParameter":
            raise value.file.error(
                f"{value.origin}: {shown(place)}.{name} is a structural parameter; sizes of "
                "arrays cannot be changed"
            )
        found[key] = given[0] if size == 1 else given

    def exact(self, item: Scalar, value: Value, route: flatten.Route) -> Scalar:
        """A whole number as floating point, if it is one."""
        if isinstance(item, bool) or not isinstance(item, int):
            return item
        try:
            given = float(item)
        except OverflowError:
            given = math.inf
        if given != item:
            raise value.file.error(
                f"{value.origin} = {item} has no exact floating-point number, as "
                f"{shown(route.end[0])}.{route.end[1]} takes; give the nearest, {given:.17g}"
            )
        return given

    # -- experiment --------------------------------------------------------------------------------

    def experiment(self) -> tuple[Experiment, dict[str, Signal]]:
        """The default experiment, with the step that our, OSP's and OMSimulator's annotations name.

        Only start and stop are standard.
        """
        element = self.structure.experiment
        if element is None:
            return Experiment(), {}
        step: float | None = None
        ours: ET.Element | None = None
        for item in element.iter():
            local = item.tag.rpartition("}")[2]
            if local == "Run" and item.tag.startswith("{cosim}"):
                ours = item
            if local == "FixedStepAlgorithm":
                step = self.number(item, "baseStepSize")
            elif local == "FixedStepMaster":
                step = self.number(item, "stepSize")
        algorithm, signals = None, {}
        options: dict[str, Any] = {}
        tolerance: float | None = None
        if ours is not None:
            step = self.number(ours, "step") or step
            algorithm = ours.get("algorithm")
            options, tolerance = self.options(ours), self.number(ours, "tolerance")
            if source := ours.get("inputs"):
                signals = _signals(self.file.beside(source, "the default experiment"), step or 0.0)
        start, stop = self.number(element, "startTime"), self.number(element, "stopTime")
        return Experiment(start, stop, step, algorithm, options, tolerance), signals

    def options(self, element: ET.Element) -> dict[str, Any]:
        """Options of the algorithm."""
        text = element.get("options", "{}")
        try:
            found = json.loads(text)
        except (ValueError, RecursionError):
            found = None
        if not isinstance(found, dict):
            raise self.file.error(
                f"default experiment: options = {text!r} is no JSON object such as "
                '{"extrapolation": 1}'
            )
        return found

    def number(self, element: ET.Element, key: str) -> float | None:
        text = element.get(key)
        try:
            return None if text is None else float(text)
        except ValueError:
            raise self.file.error(f"default experiment: {key} = {text!r} is no number") from None


def _element(node: flatten.Node) -> str:
    return node[1] if node[2] == 0 else f"{node[1]}[{node[2] + 1}]"


def _items(fmu: Fmu, name: str) -> dict[str, int]:
    """Items of the enumeration that a variable of an FMU has as its type."""
    root = markup.read(fmu.folder / "modelDescription.xml").root
    declared = ""
    for element in root.iterfind("ModelVariables/*"):
        if element.get("name") == name:
            inner = element.find("Enumeration")
            declared = (element if inner is None else inner).get("declaredType", "")
    for kind in root.iterfind("TypeDefinitions/*"):
        if kind.get("name") == declared:
            return {
                item.get("name", ""): int(item.get("value", "0"))
                for item in kind.iter()
                if item.tag == "Item"
            }
    return {}


@dataclass(frozen=True)
class _Steps:
    """Values that hold from one time to the next; times closer than `clock` are the same."""

    times: Vector
    values: Vector
    unit: str
    text: str
    clock: float

    def at(self, times: Vector) -> Vector:
        """Values at these times."""
        index = np.searchsorted(self.times, times + self.clock, side="right") - 1
        return self.values[np.maximum(index, 0)]


def _signals(file: File, step: float) -> dict[str, Signal]:
    """Columns of a CSV file with a head such as `time [s],motor.w_ref [rad/s]`."""
    if excess := TEXT.excess(file.path.stat().st_size):
        raise file.error(excess)
    try:
        with file.path.open(encoding="utf-8", newline="") as handle:
            rows = list(csv.reader(handle))
        heads, numbers = rows[0], [[float(item) for item in row] for row in rows[1:]]
        columns = list(zip(*numbers, strict=True))
        if len(columns) != len(heads) or not columns:
            raise ValueError(f"{len(heads)} heads for {len(columns)} columns")
    except (IndexError, ValueError, OSError, csv.Error) as error:
        raise file.error(f"is not a table of numbers ({error}); export it again") from error
    times = np.array(columns[0])
    if not np.isfinite(numbers).all() or np.any(np.diff(times) < 0.0):
        raise file.error("has times that go back, or numbers that are not finite; export it again")
    found: dict[str, Signal] = {}
    for head, column in zip(heads[1:], columns[1:], strict=True):
        name, _, unit = head.partition(" [")  # names may have spaces
        found[name] = _Steps(
            times,
            np.array(column),
            unit.strip("[]"),
            f"{file.name}:{name}",
            1e-3 * step,
        )
    return found
