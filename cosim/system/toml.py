"""Systems as TOML files, before their FMUs are opened."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from ..errors import ScenarioError, UnknownNameError, listing, within
from ..files import flatten, overlay, read_toml
from ..reading.schema import Check, anything, keyed, list_of, table, text
from .provider import Provider
from .system import System


class DeclaredConnection(NamedTuple):
    """A connection as `System.connect` takes it."""

    source: str
    target: str
    factor: float = 1.0
    offset: float = 0.0
    convert: bool = True


@dataclass(frozen=True)
class SystemFile:
    """A system as written in TOML or SSP, before its FMUs are opened.

    Attributes:
        path: the file, for error texts and relative .fmu paths.
        name, text: of the system.
        instances: name -> variant or path of an .fmu.
        parameters: full name -> value.
        connections: between instances.
        shown: what error texts call it, its path by default.
    """

    path: Path
    name: str
    text: str
    instances: dict[str, str]
    parameters: dict[str, Any]
    connections: tuple[DeclaredConnection, ...]
    shown: str = ""

    def build(
        self, provider: Provider | None, parameters: Mapping[str, Any] | None = None
    ) -> System:
        """Open the FMUs and connect them.

        Args:
            provider: where variants come from.
            parameters: full name -> value; replace those of the file.
        """
        system = System(self.name, provider, self.text)
        given = parameters or {}
        with within(self.shown or str(self.path)):
            for name, reference in self.instances.items():
                system.add(name, reference, base=self.path.parent)
            for wire in self.connections:
                system.connect(
                    wire.source,
                    wire.target,
                    factor=wire.factor,
                    offset=wire.offset,
                    convert=wire.convert,
                )
            for name, value in overlay(self.parameters, given).items():
                if name not in given:
                    system.set(name, value)
        for name, value in given.items():
            system.set(name, value)
        return system

    def without(self, names: Iterable[str]) -> SystemFile:
        """The system without some instances, their connections and values; inputs are open then.

        Raises:
            UnknownNameError: no such instance.
        """
        gone = set(names)
        for name in sorted(gone - set(self.instances)):
            raise UnknownNameError(
                f"{self.path}: there is no instance {name!r} to leave out; "
                f"{listing(self.instances, name)}"
            )

        def stays(full: str) -> bool:
            return full.partition(".")[0] not in gone

        return replace(
            self,
            instances={name: of for name, of in self.instances.items() if name not in gone},
            parameters={name: value for name, value in self.parameters.items() if stays(name)},
            connections=tuple(w for w in self.connections if stays(w.source) and stays(w.target)),
        )


_KINDS: dict[str, Check] = {
    "name": text, "description": text, "instances": anything, "connections": list_of(anything),
    "parameters": table,
}  # fmt: skip


def read_system(path: Path | str) -> SystemFile:
    """Read a system from TOML (docs/scenarios.md has the schema).

    Raises:
        ScenarioError: not TOML, or a wrong key or value.
    """
    path = Path(path)
    content = read_toml(path)
    unknown = set(content) - {"name", "description", "instances", "connections", "parameters"}
    if unknown:
        raise ScenarioError(
            f"{path}: unknown key {', '.join(sorted(unknown))}; a system has name, description, "
            "instances, connections and parameters"
        )
    keyed(_KINDS)(content, str(path))
    instances = content.get("instances", {})
    if not isinstance(instances, dict) or not instances:
        raise ScenarioError(f'{path}: [instances] with name = "variant" is missing')
    for name, reference in instances.items():
        if not isinstance(reference, str):
            raise ScenarioError(
                f"{path}: instance {name!r} must be a variant or the path of an .fmu, "
                f"not {reference!r}"
            )
    return SystemFile(
        path,
        content.get("name", path.stem),
        content.get("description", ""),
        dict(instances),
        flatten(content.get("parameters", {})),
        tuple(_arrow(path, line) for line in content.get("connections", [])),
    )


def _arrow(path: Path, line: Any) -> DeclaredConnection:
    parts = [part.strip() for part in line.split("->")] if isinstance(line, str) else []
    if len(parts) != 2 or not all(parts):
        raise ScenarioError(
            f'{path}: {line!r} is not a connection; write "instance.output -> instance.input"'
        )
    return DeclaredConnection(parts[0], parts[1])
