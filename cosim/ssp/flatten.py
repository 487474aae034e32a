"""Nested systems as one net of connectors, and the ways from output to input through it."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

from ..errors import ConnectError, UnitError, listing
from ..fmu.archive import Fmu, open_fmu
from ..fmu.variables import Variable
from ..spec.units import Unit, conversion
from .document import Element, End, File, Link, Structure, Transformation

Path = tuple[str, ...]
"""Names of elements from below the root system; () is the root system itself."""
Node = tuple[Path, str, int]
"""Element, connector, and which element of an array."""


@dataclass(frozen=True)
class Route:
    """A way through the net: `value at its end = factor * value at its start + offset`.

    Attributes:
        end: node where it ends, a connector of an FMU or of the root system.
        unit: of the value at its start, None if nothing on the way has one.
        order: of its last connection in the file.
    """

    end: Node
    factor: float
    offset: float
    unit: Unit | None
    order: int = 0


class _Way(NamedTuple):
    """From the value at a start to that at a node.

    Attributes:
        factor, offset: as in `Route`.
        difference: the offset without those of units, which differences do not have.
        unit: at the node, None if not known.
    """

    factor: float
    offset: float
    difference: float
    unit: Unit | None

    def offset_of(self, relative: bool) -> float:
        """The offset of a difference (`relative`) or of another quantity."""
        return self.difference if relative else self.offset


@dataclass(frozen=True)
class _Edge:
    node: Node
    link: Link | None
    order: int = 0


def shown(path: Path) -> str:
    """An element as error texts call it."""
    return ".".join(path) or "the root system"


class Net:
    """All elements and connections below a root system.

    Attributes:
        fmus: by element, in the order of the file.
        systems: by element.
    """

    def __init__(self, structure: Structure) -> None:
        self.file = structure.file
        self.fmus: dict[Path, Fmu] = {}
        self.components: dict[Path, Element] = {}
        self.systems: dict[Path, Element] = {}
        self._edges: dict[Node, list[_Edge]] = {}
        self._units: dict[Node, Unit | None] = {}
        self._count = 0
        self._add(structure.system, (), ())

    # -- building ----------------------------------------------------------------------------------

    def _add(self, system: Element, path: Path, scopes: tuple[tuple[Path, Element], ...]) -> None:
        self.systems[path] = system
        scopes = (*scopes, (path, system))
        for connector in system.connectors.values():
            for index in range(connector.size):
                self._units[path, connector.name, index] = connector.unit
        children = system.elements or {}
        for name, child in children.items():
            place = (*path, name)
            if child.kind == "system":
                self._add(child, place, scopes)
            elif child.kind == "dictionary":
                self._add_dictionary(child, place, scopes)
            else:
                assert isinstance(child.source, File)
                self.components[place] = child
                self.fmus[place] = open_fmu(child.source.path, child.source.shown)
                for connector in child.connectors.values():
                    for index in range(self.variable(place, connector.name).size):
                        self._units[place, connector.name, index] = connector.unit
        for link in system.links:
            starts, ends = self._nodes(link.start, path), self._nodes(link.end, path)
            if len(starts) != len(ends):
                raise ConnectError(
                    f"{self.file.shown}: connection {_name(link)} in {shown(path)} joins "
                    f"{len(starts)} and {len(ends)} elements"
                )
            self._count += 1
            for start, end in zip(starts, ends, strict=True):
                self._edges.setdefault(start, []).append(_Edge(end, link, self._count))
                self._edges.setdefault(end, []).append(_Edge(start, link, self._count))

    def _add_dictionary(
        self, reference: Element, place: Path, scopes: tuple[tuple[Path, Element], ...]
    ) -> None:
        """Join the connectors of a reference with the signals of the dictionary it refers to."""
        scope, signals = next(
            (
                (path, (system.dictionaries or {})[reference.dictionary])
                for path, system in reversed(scopes)
                if reference.dictionary in (system.dictionaries or {})
            ),
            ((), None),
        )
        if signals is None:
            raise self.file.error(
                f"{shown(place)} refers to signal dictionary {reference.dictionary!r}, which no "
                "enclosing system has"
            )
        for connector in reference.connectors.values():
            if connector.name not in signals:
                raise self.file.error(
                    f"signal dictionary {reference.dictionary!r} has no signal "
                    f"{connector.name!r}, which {shown(place)} refers to; "
                    f"{listing(signals, connector.name)}"
                )
            outer: Node = (place, connector.name, 0)
            inner: Node = ((*scope, f"#{reference.dictionary}"), connector.name, 0)
            self._units[outer] = connector.unit
            self._units[inner] = signals[connector.name]
            self._edges.setdefault(outer, []).append(_Edge(inner, None))
            self._edges.setdefault(inner, []).append(_Edge(outer, None))

    def _nodes(self, end: End, path: Path) -> list[Node]:
        place = (*path, end.element) if end.element else path
        if place in self.fmus:
            size = self.variable(place, end.connector).size
        else:
            owner = self.systems[path]
            if end.element:
                known = owner.elements or {}
                if end.element not in known:
                    raise self.file.error(
                        f"a connection in {shown(path)} names element {end.element!r}; "
                        f"{listing(known, end.element)}"
                    )
                owner = known[end.element]
            if end.connector not in owner.connectors:
                raise self.file.error(
                    f"a connection in {shown(path)} names connector {end.connector!r} of "
                    f"{shown(place)}; {listing(owner.connectors, end.connector)}"
                )
            size = owner.connectors[end.connector].size
        if not end.indices:
            return [(place, end.connector, index) for index in range(size)]
        # SSP 2.0 does not say from where indices count; here as in the names of FMI, from 1
        if not all(1 <= index <= size for index in end.indices):
            raise self.file.error(
                f"a connection in {shown(path)} names elements {list(end.indices)} of "
                f"{shown(place)}.{end.connector}, which has {size}"
            )
        return [(place, end.connector, index - 1) for index in end.indices]

    def variable(self, place: Path, name: str) -> Variable:
        """The variable of an FMU that a connector stands for."""
        description = self.fmus[place].description
        if name not in description.variables:
            names = [v.name for v in description.variables.values() if v.causality != "local"]
            raise self.file.error(
                f"connector {name!r} of {shown(place)} is no variable of "
                f"{description.name!r}; {listing(names, name)}"
            )
        return description.variables[name]

    # -- ways --------------------------------------------------------------------------------------

    def leaf(self, node: Node) -> Variable | None:
        """The FMU's variable at a node, None for a connector of a system or dictionary."""
        return self.variable(node[0], node[1]) if node[0] in self.fmus else None

    def outputs(self) -> list[Node]:
        """Connected outputs of FMUs."""
        found = []
        for node in self._edges:
            variable = self.leaf(node)
            if variable is not None and variable.causality in (
                "output", "local", "calculatedParameter",
            ):  # fmt: skip
                found.append(node)
        return found

    def routes(self, start: Node) -> list[Route]:
        """The ways from an FMU's output, or from a connector of a system, to where values go.

        Raises:
            ConnectError: the way from an output leads to another output.
            UnitError: units on the way do not convert.
        """
        own = self.leaf(start)
        relative = own is not None and own.relative
        way = _Way(1.0, 0.0, 0.0, self._units.get(start))
        if own is not None:
            way = self._step(_Way(1.0, 0.0, 0.0, own.unit), way.unit, f"{shown(start[0])}")
        first = way.unit if own is None else own.unit
        found: list[Route] = []
        seen = {start}
        queue = deque([(start, way, first)])
        while queue:
            node, before, first = queue.popleft()
            for edge in self._edges.get(node, ()):
                if edge.node in seen:
                    continue
                seen.add(edge.node)
                way = self._along(edge, before)
                origin = first if first is not None else way.unit
                leaf = self.leaf(edge.node)
                if leaf is None:
                    queue.append((edge.node, way, origin))
                    if not edge.node[0]:
                        offset = way.offset_of(relative)
                        found.append(Route(edge.node, way.factor, offset, origin, edge.order))
                elif leaf.causality in ("output", "local", "calculatedParameter"):
                    if own is not None:
                        raise ConnectError(
                            f"{self.file.shown}: {shown(start[0])}.{start[1]} and "
                            f"{shown(edge.node[0])}.{edge.node[1]} are both outputs but connected "
                            "to each other"
                        )
                else:
                    what = f"{shown(edge.node[0])}.{edge.node[1]}"
                    way = self._step(way, leaf.unit, what)
                    origin = origin if origin is not None else leaf.unit
                    offset = way.offset_of(relative or leaf.relative)
                    found.append(Route(edge.node, way.factor, offset, origin, edge.order))
        return found

    def _along(self, edge: _Edge, way: _Way) -> _Way:
        there, link = self._units.get(edge.node), edge.link
        if there is None:
            variable = self.leaf(edge.node)
            there = variable.unit if variable is not None else None
        what = _name(link) if link else shown(edge.node[0])
        if link is None or not link.suppress:
            way = self._step(way, there, what)
        else:
            way = way._replace(unit=there)
        if link is not None:
            gain, shift = self._affine(link.transformation, what)
            if (gain, shift) != (1.0, 0.0):
                way = _Way(
                    way.factor * gain,
                    way.offset * gain + shift,
                    way.difference * gain + shift,
                    there,
                )
        return way

    def _step(self, way: _Way, there: Unit | None, what: str) -> _Way:
        if way.unit is None or there is None:
            return way._replace(unit=there if there is not None else way.unit)
        try:
            gain, shift = conversion(way.unit, there)
        except UnitError as error:
            raise UnitError(f"{self.file.shown}: {what}: unit {error}") from error
        return _Way(way.factor * gain, way.offset * gain + shift, way.difference * gain, there)

    def _affine(self, transformation: Transformation, what: str) -> tuple[float, float]:
        if transformation.kind == "linear":
            return transformation.factor, transformation.offset
        entries = transformation.entries or {}
        if transformation.kind == "boolean":
            low, high = (entries.get(a, entries.get(b, a)) in ("true", "1")
                         for a, b in (("false", "0"), ("true", "1")))  # fmt: skip
            return float(high) - float(low), float(low)
        if any(source != target for source, target in entries.items()):
            raise self.file.error(
                f"{what} has {'an' if transformation.kind[0] in 'aeiou' else 'a'} "
                f"{transformation.kind} mapping, which cannot be run between FMUs"
            )
        return 1.0, 0.0


def _name(link: Link) -> str:
    ends = (f"{end.element}.{end.connector}".lstrip(".") for end in (link.start, link.end))
    return " - ".join(ends)
