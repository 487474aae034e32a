"""SystemStructure.ssd as plain objects, and the files of an SSP archive.

Namespaces and meaning follow System Structure and Parameterization (SSP) 1.0 and 2.0, which share
their namespaces. Geometry and annotations of other tools are not read.
"""

from __future__ import annotations

import urllib.parse
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Literal

from ..errors import ScenarioError
from ..files import is_file
from ..fmu import archive
from ..fmu.attributes import read_units
from ..reading import markup
from ..spec.units import Unit

_BASE = "http://ssp-standard.org/SSP1/SystemStructure"
SSD, SSC, SSV, SSM, SSB = (
    f"{_BASE}{part}"
    for part in ("Description", "Common", "ParameterValues", "ParameterMapping", "SignalDictionary")
)
NAMES = {"ssd": SSD, "ssc": SSC, "ssv": SSV, "ssm": SSM, "ssb": SSB}
REALS = ("Real", "Float64", "Float32")
INTEGERS = (
    "Integer", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64",
)  # fmt: skip
TYPES = (*REALS, *INTEGERS, "Boolean", "String", "Enumeration", "Binary", "Clock")
FMU, DEFINITION, PACKAGE = (
    "application/x-fmu-sharedlibrary", "application/x-ssp-definition", "application/x-ssp-package",
)  # fmt: skip


@dataclass(frozen=True)
class File:
    """A file of an unpacked package.

    Attributes:
        folder: of the unpacked package.
        name: path inside it.
        shown: what error texts call it.
    """

    folder: Path
    name: str
    shown: str

    @property
    def path(self) -> Path:
        """Where it is."""
        return self.folder / self.name

    def error(self, text: str) -> ScenarioError:
        """An error that names the file."""
        return ScenarioError(f"{self.shown}: {text}")

    def beside(self, source: str, what: str, folder: Path | None = None) -> File:
        """The file that a relative URI names.

        Args:
            source: the URI, relative to this file.
            what: which element names it, for error texts.
            folder: of an FMU, if the URI is relative to that.

        Raises:
            ScenarioError: another kind of URI, outside the package, or not there.
        """
        try:
            parts = urllib.parse.urlsplit(source)
        except ValueError as error:  # brackets of an address of the network
            raise self.error(f"{what} refers to {source!r}, which is no URI ({error})") from None
        if parts.scheme or parts.netloc:
            raise self.error(
                f"{what} refers to {source!r}; only files inside the package can be read, so put "
                "it there and refer to it by a relative path"
            )
        base = PurePosixPath() if folder is not None else PurePosixPath(self.name).parent
        places: list[str] = []
        for part in (base / urllib.parse.unquote(parts.path)).parts:
            if part == ".." and not places:
                raise self.error(f"{what} refers to {source!r}, which leaves the package")
            if part == "..":
                places.pop()
            elif part != ".":
                places.append(part)
        found = File(folder or self.folder, "/".join(places), f"{self.shown}: {source}")
        if not is_file(found.path):
            raise self.error(f"{what} refers to {source!r}, which the package does not hold")
        return found

    def parse(self, root: str) -> ET.Element:
        """The root element.

        Raises:
            ScenarioError: not XML, or of another kind or version.
        """
        try:
            element = markup.read(self.path).root
        except (markup.MarkupError, OSError) as error:
            raise self.error(f"cannot be read ({error})") from error
        self.check(element, root)
        return element

    def check(self, element: ET.Element, root: str) -> None:
        """Raise unless this is a root element `ssd:...` of a known version."""
        prefix, _, local = root.partition(":")
        if element.tag != f"{{{NAMES[prefix]}}}{local}":
            raise self.error(f"its root element is {_local(element)!r}, not {root}")
        version = element.get("version", "")
        if not version.startswith(("1.", "2.")):
            raise self.error(f"is of SSP version {version or 'unknown'}; 1.0 and 2.0 can be read")


def _local(element: ET.Element) -> str:
    return element.tag.rpartition("}")[2]


def open_package(path: Path, ssd: str = "SystemStructure.ssd") -> File:
    """The .ssd file of a package: an .ssp archive, a folder, or an .ssd file.

    Raises:
        ScenarioError: missing, damaged, or without that .ssd.
    """
    if path.suffix == ".ssd" and path.is_file():
        return File(path.parent, path.name, str(path))
    folder = path
    if not path.is_dir():
        folder, _ = archive.unpacked(path, "ssp", "an SSP", ScenarioError)
    file = File(folder, ssd, f"{path}: {ssd}")
    if not is_file(file.path):
        present = ", ".join(sorted(item.name for item in folder.glob("*.ssd"))) or "no .ssd at all"
        raise ScenarioError(f"{path}: has no {ssd}; it has {present}")
    return file


# -- elements --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Transformation:
    """What is done to a value on its way.

    Attributes:
        kind: `linear`, `boolean`, `integer` or `enumeration`.
        factor, offset: of `linear`.
        entries: of the others: value (as text) -> value; others stay as they are.
    """

    kind: Literal["linear", "boolean", "integer", "enumeration"] = "linear"
    factor: float = 1.0
    offset: float = 0.0
    entries: Mapping[str, str] | None = None


@dataclass(frozen=True)
class Connector:
    """A connector of an element; `type` is "" where it is left to the component."""

    name: str
    kind: str
    type: str = ""
    unit: Unit | None = None
    size: int = 1


@dataclass(frozen=True)
class End:
    """One end of a connection; `element` is "" for the enclosing system."""

    element: str
    connector: str
    indices: tuple[int, ...] = ()


@dataclass(frozen=True)
class Link:
    """A connection; which end is the source follows from the kinds of the connectors."""

    start: End
    end: End
    transformation: Transformation
    suppress: bool


@dataclass(frozen=True)
class Binding:
    """A parameter binding, still as XML.

    Attributes:
        file: for error texts and relative URIs.
        element: `ssd:ParameterBinding`.
    """

    file: File
    element: ET.Element


@dataclass(frozen=True)
class Element:
    """A component, a system or a reference to a signal dictionary.

    Attributes:
        name: as in the file.
        kind: which of them.
        connectors: by name.
        bindings: in rising precedence.
        source: the FMU of a component.
        elements, links: of a system.
        dictionaries: of a system: name -> unit per signal.
        dictionary: that a reference refers to.
    """

    name: str
    kind: Literal["component", "system", "dictionary"]
    connectors: Mapping[str, Connector]
    bindings: tuple[Binding, ...] = ()
    source: File | None = None
    elements: Mapping[str, Element] | None = None
    links: tuple[Link, ...] = ()
    dictionaries: Mapping[str, Mapping[str, Unit | None]] | None = None
    dictionary: str = ""


@dataclass(frozen=True)
class Structure:
    """A whole .ssd file.

    Attributes:
        file: it.
        name, text: of the root system.
        system: the root system.
        experiment: `ssd:DefaultExperiment`, None if there is none.
    """

    file: File
    name: str
    text: str
    system: Element
    experiment: ET.Element | None


def read_structure(file: File, within: tuple[Path, ...] = ()) -> Structure:
    """Read an .ssd file and those that it refers to as components.

    Args:
        file: the .ssd file.
        within: the files that led to it.

    Raises:
        ScenarioError: something that cannot be read; the text names the element.
    """
    if file.path in within:
        raise file.error("contains itself as a component")
    root = file.parse("ssd:SystemStructureDescription")
    system = root.find("ssd:System", NAMES)
    if system is None:
        raise file.error("has no System")
    reader = _Reader(file, root, (*within, file.path))
    return Structure(
        file,
        root.get("name") or system.get("name") or "system",
        system.get("description") or root.get("description") or "",
        reader.element(system, None),
        root.find("ssd:DefaultExperiment", NAMES),
    )


def read_transformation(parent: ET.Element, file: File, what: str) -> Transformation:
    """The transformation inside a connection or a mapping entry."""
    for kind in ("Linear", "BooleanMapping", "IntegerMapping", "EnumerationMapping"):
        element = parent.find(f"ssc:{kind}Transformation", NAMES)
        if element is None:
            element = parent.find(f"ssd:{kind}Transformation", NAMES)  # a common slip
        if element is None:
            continue
        if kind == "Linear":
            try:
                return Transformation(
                    "linear", float(element.get("factor", "1")), float(element.get("offset", "0"))
                )
            except ValueError as error:
                raise file.error(f"{what}: LinearTransformation: {error}") from None
        entries = {
            entry.get("source", ""): entry.get("target", "")
            for entry in element.iterfind("ssc:MapEntry", NAMES)
        }
        name: Literal["boolean", "integer", "enumeration"] = (
            "boolean" if kind == "BooleanMapping"
            else "integer" if kind == "IntegerMapping" else "enumeration"
        )  # fmt: skip
        return Transformation(name, entries=entries)
    return Transformation()


def units_of(root: ET.Element, prefix: str, file: File) -> dict[str, Unit]:
    """The units that a file defines; `prefix` is that of its root element."""
    try:
        return read_units(root.iterfind(f"{prefix}:Units/ssc:Unit", NAMES), f"{{{SSC}}}")
    except ValueError as error:
        raise file.error(f"a unit cannot be read ({error})") from None


class _Reader:
    """Reads the elements of one .ssd file."""

    def __init__(self, file: File, root: ET.Element, within: tuple[Path, ...]) -> None:
        self.file, self.root, self.within = file, root, within
        self.units = units_of(root, "ssd", file)

    def element(self, element: ET.Element, path: str | None) -> Element:
        """An element and all below it; `path` is that of its parent, None for the root system."""
        name = element.get("name", "")
        where = "" if path is None else f"{path}.{name}".lstrip(".")
        kind = _local(element)
        if kind == "Component":
            return self.component(element, where)
        connectors = self.connectors(element, where)
        bindings = self.bindings(element)
        if kind == "SignalDictionaryReference":
            return Element(
                name, "dictionary", connectors, bindings, dictionary=element.get("dictionary", "")
            )
        if kind != "System":
            raise self.file.error(f"element {where!r} is a {kind}, which cannot be read")
        inside = f"system {where!r}" if where else "the root system"
        children: dict[str, Element] = {}
        for child in element.iterfind("ssd:Elements/*", NAMES):
            if _local(child) == "Annotations":
                continue
            found = self.element(child, where)
            if not found.name:
                raise self.file.error(f"{inside} has a {_local(child)} without a name")
            if found.name in children:
                raise self.file.error(f"{inside} has two elements named {found.name!r}")
            children[found.name] = found
        return Element(
            name,
            "system",
            connectors,
            bindings,
            elements=children,
            links=tuple(
                self.link(item, where)
                for item in element.iterfind("ssd:Connections/ssd:Connection", NAMES)
            ),
            dictionaries={
                item.get("name", ""): self.signals(item, where)
                for item in element.iterfind("ssd:SignalDictionaries/ssd:SignalDictionary", NAMES)
            },
        )

    def component(self, element: ET.Element, where: str) -> Element:
        name, type_ = element.get("name", ""), element.get("type", FMU)
        source, bindings = element.get("source", ""), self.bindings(element)
        what = f"component {where!r}"
        if type_ == FMU:
            if element.get("implementation", "any") not in ("any", "CoSimulation"):
                raise self.file.error(
                    f"{what} asks for {element.get('implementation')}; only co-simulation is run"
                )
            if not source:
                raise self.file.error(f"{what} names no source")
            return Element(
                name, "component", self.connectors(element, where), bindings,
                self.file.beside(source, what),
            )  # fmt: skip
        if type_ == DEFINITION and source.startswith("#"):
            for system in self.root.iter(f"{{{SSD}}}System"):
                if system.get("id") == source[1:]:
                    return _renamed(self.element(system, where), name, bindings)
            raise self.file.error(f"{what} refers to {source!r}, and no System has that id")
        if type_ == DEFINITION:
            inner = read_structure(self.file.beside(source, what), self.within)
        elif type_ == PACKAGE:
            place, _, variant = source.partition("#")
            package = self.file.beside(place, what)
            ssd = open_package(package.path, variant or "SystemStructure.ssd")
            inner = read_structure(ssd, self.within)
        else:
            raise self.file.error(f"{what} is of type {type_!r}; FMUs and SSP can be read")
        return _renamed(inner.system, name, bindings)

    def connectors(self, element: ET.Element, where: str) -> dict[str, Connector]:
        found: dict[str, Connector] = {}
        for item in element.iterfind("ssd:Connectors/ssd:Connector", NAMES):
            name, size = item.get("name", ""), 1
            for dimension in item.iterfind("ssc:Dimension", NAMES):
                text = dimension.get("size")
                if text is None:
                    raise self.file.error(
                        f"connector {name!r} of {where!r} has a dimension without a fixed size"
                    )
                size *= self.whole(text, f"size of connector {name!r} of {where!r}")
            type_, unit = "", None
            for child in item:
                if _local(child) in TYPES and child.tag.startswith(f"{{{SSC}}}"):
                    type_ = _local(child)
                    unit = self.unit(child.get("unit"), f"connector {name!r} of {where!r}")
            found[name] = Connector(name, item.get("kind", ""), type_, unit, size)
        return found

    def whole(self, text: str, what: str) -> int:
        try:
            return int(text)
        except ValueError:
            raise self.file.error(f"{what}: {text!r} is not a whole number") from None

    def unit(self, name: str | None, what: str) -> Unit | None:
        if not name:
            return None
        if name not in self.units:
            raise self.file.error(f"{what} has unit {name!r}, which the file does not define")
        return self.units[name]

    def bindings(self, element: ET.Element) -> tuple[Binding, ...]:
        found = element.iterfind("ssd:ParameterBindings/ssd:ParameterBinding", NAMES)
        return tuple(Binding(self.file, item) for item in found)

    def link(self, element: ET.Element, where: str) -> Link:
        def end(side: str) -> End:
            indices = element.get(f"{side}Indices", "").split()
            return End(
                element.get(f"{side}Element", ""),
                element.get(f"{side}Connector", ""),
                tuple(self.whole(item, f"{side}Indices in {where!r}") for item in indices),
            )

        start, stop = end("start"), end("end")
        what = f"connection {start.element}.{start.connector} - {stop.element}.{stop.connector}"
        return Link(
            start,
            stop,
            read_transformation(element, self.file, f"{what} in {where!r}"),
            element.get("suppressUnitConversion", "false") in ("true", "1"),
        )

    def signals(self, element: ET.Element, where: str) -> dict[str, Unit | None]:
        """Signals of a signal dictionary with their units."""
        what = f"signal dictionary {element.get('name')!r} of {where!r}"
        source = element.get("source")
        if source is None:
            file, root = self.file, element.find("ssb:SignalDictionary", NAMES)
            if root is None:
                raise self.file.error(f"{what} is empty")
        else:
            file = self.file.beside(source, what)
            root = file.parse("ssb:SignalDictionary")
        units = units_of(root, "ssb", file)
        found: dict[str, Unit | None] = {}
        for entry in root.iterfind("ssb:DictionaryEntry", NAMES):
            name = next((child.get("unit") for child in entry if _local(child) in REALS), None)
            if name and name not in units:
                raise file.error(f"{what}: unit {name!r} is not defined")
            found[entry.get("name", "")] = units[name] if name else None
        return found


def _renamed(system: Element, name: str, bindings: tuple[Binding, ...]) -> Element:
    return Element(
        name, "system", system.connectors, (*system.bindings, *bindings),
        elements=system.elements, links=system.links, dictionaries=system.dictionaries,
    )  # fmt: skip
