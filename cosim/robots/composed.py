"""Systems from components: instances, and connections where power ports or names tell them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import VariantError, listing
from ..files import write_text
from ..fmu.description import Description
from ..fmu.variables import Variable
from ..installation.builder import components
from ..spec.variant import parse_name
from ..system.provider import Provider
from ..system.system import System
from .create import new_folder

ACCOUNTS = ("E_stored", "P_in", "P_loss")
"""Outputs that nobody plots first."""
_ELEMENT = re.compile(r"\[\d+\]$")


def write(
    name: str,
    folder: Path,
    components: Sequence[str],
    parameters: Mapping[str, Any],
    provider: Provider,
) -> list[Path]:
    """Write system.toml and scenario.toml of instances of these components; returns the files.

    Power ports of neighbours are connected in the order of the components, then inputs that exactly
    one other instance has an output of the same name and unit for. What stays open is listed.

    Args:
        name: of the system.
        folder: for the files.
        components: components (their simplest fidelity is taken), variants or .fmu files.
        parameters: full name -> value.
        provider: where FMUs come from.

    Raises:
        VariantError: no such component.
        GraphError: a parameter that no instance has.
        InputError: see `create.new_folder`.
    """
    system = System(name, provider)
    here: dict[str, str] = {}
    for reference in components:
        reference = reference if _is_whole(reference) else _simplest(reference)
        stem = (
            Path(reference).stem if reference.endswith(".fmu") else parse_name(reference).component
        )
        stem = re.sub(r"\W+", "_", stem)
        instance, number = stem, 2
        while instance in here:
            instance, number = f"{stem}_{number}", number + 1
        system.add(instance, reference)
        here[instance] = str(Path(reference).resolve()) if reference.endswith(".fmu") else reference
    lines = _power(system) + _alike(system)
    for key, value in parameters.items():
        system.set(key, value)
    new_folder(name, folder)
    files = {
        "system.toml": _system_text(system, here, lines, parameters),
        "scenario.toml": _scenario_text(system, folder),
    }
    for file, text in files.items():
        write_text(folder / file, text)
    return [folder / file for file in files]


def _is_whole(reference: str) -> bool:
    return "/" in reference or reference.endswith(".fmu")


def _simplest(component: str) -> str:
    """The simplest fidelity of a component, `component.device` taken as well."""
    entries = {entry["component"]: entry["fidelities"] for entry in components()}
    short = component.partition(".")[0]
    if short not in entries:
        raise VariantError(f"--from: there is no component {short!r}; {listing(entries, short)}")
    return f"{component}/{entries[short][0]}"


def _groups(description: Description, causality: Any) -> dict[str, list[Variable]]:
    """Vectors, and scalars as vectors of one, by name."""
    groups: dict[str, list[Variable]] = {}
    for variable in description.of(causality):
        groups.setdefault(_ELEMENT.sub("", variable.name), []).append(variable)
    return groups


def _power(system: System) -> list[str]:
    """Connect free power ports of each instance with those of the next ones."""
    taken: set[tuple[str, str]] = set()
    lines = []
    members = list(system.members.values())
    for i, first in enumerate(members):
        for second in members[i + 1 :]:
            for port in first.description.ports:
                for other in second.description.ports:
                    ends = (first.name, port.name), (second.name, other.name)
                    if taken & set(ends) or port.causality == other.causality:
                        continue
                    effort = [first.description.find(item).symbol for item in port.effort]
                    flow = [first.description.find(item).symbol for item in port.flow]
                    if effort != [second.description.find(item).symbol for item in other.effort]:
                        continue
                    if flow != [second.description.find(item).symbol for item in other.flow]:
                        continue
                    taken |= set(ends)
                    for a, b in ((port.effort, other.effort), (port.flow, other.flow)):
                        gives = first.description.find(a[0]).causality == "output"
                        source, target = (first, second) if gives else (second, first)
                        out, into = (a, b) if gives else (b, a)
                        lines += _wire(system, source.name, out, target.name, into)
    return lines


def _wire(
    system: System, source: str, out: Sequence[str], target: str, into: Sequence[str]
) -> list[str]:
    outs, ins = {_ELEMENT.sub("", name) for name in out}, {_ELEMENT.sub("", name) for name in into}
    whole = len(outs) == len(ins) == 1
    pairs = [(outs.pop(), ins.pop())] if whole else list(zip(out, into, strict=True))
    lines = []
    for a, b in pairs:
        system.connect(f"{source}.{a}", f"{target}.{b}")
        lines.append(f"{source}.{a} -> {target}.{b}")
    return lines


def _alike(system: System) -> list[str]:
    """Connect open inputs for which exactly one other instance has an output like it."""
    lines = []
    for member in system.members.values():
        for name, variables in _groups(member.description, "input").items():
            if system.driver(f"{member.name}.{variables[0].name}") is not None:
                continue
            found = [
                (other.name, output)
                for other in system.members.values()
                if other is not member
                for output, items in _groups(other.description, "output").items()
                if _fits(name, variables, output, items, other.description)
            ]
            if len(found) == 1:
                source, output = found[0]
                system.connect(f"{source}.{output}", f"{member.name}.{name}")
                lines.append(f"{source}.{output} -> {member.name}.{name}")
    return lines


def _fits(
    name: str, inputs: list[Variable], output: str, outputs: list[Variable], giver: Description
) -> bool:
    """Whether names (or, of inertias that are handed on, units) say that two belong together."""
    if [v.symbol for v in inputs] != [v.symbol for v in outputs]:
        return False
    handed_on = outputs[0].name in giver.extra.get("passed_on", {})
    return name == output or (handed_on and name == "J_added")


def _system_text(
    system: System, here: Mapping[str, str], lines: Sequence[str], parameters: Mapping[str, Any]
) -> str:
    out = [f'description = "{system.name}: {", ".join(here)}."', ""]
    out.append("connections = [   # output -> input; a vector connects all its elements")
    out += [f'  "{line}",' for line in lines]
    out += ["]", ""]
    if untaken := system.untaken():
        out += ["# What part of the system is lost without (connect it):"]
        out += [f"#   {line}" for line in untaken] + [""]
    out += ["# Outputs that may be connected or compared:"]
    for member in system.members.values():
        for name, items in _groups(member.description, "output").items():
            out.append(
                f"#   {member.name}.{name}{_size(items)} [{items[0].symbol}] {items[0].text}"
            )
    out += ["", "# name = component.device/fidelity+effect, or path of an .fmu", "[instances]"]
    out += [f'{name} = "{reference}"' for name, reference in here.items()]
    out += ["", "[parameters]   # taken out of the comment where they differ from the FMU's"]
    out += [f"{name} = {value}" for name, value in parameters.items()]
    for member in system.members.values():
        for name, items in _groups(member.description, "parameter").items():
            full = f"{member.name}.{name}"
            if full in parameters or name.startswith("solver.") or not items[0].start:
                continue
            starts = [item.start[0] for item in items if item.start]
            value = str(starts[0] if len(items) == 1 else starts)
            out.append(f"# {full} = {value}   # [{items[0].symbol}] {items[0].text}")
    return "\n".join(out) + "\n"


def _size(items: Sequence[Variable]) -> str:
    return f"[1..{len(items)}]" if len(items) > 1 else ""


def _scenario_text(system: System, folder: Path) -> str:
    open_inputs = [name for name in system.open_inputs()]
    shown = [name for name in system.signals() if name.rpartition(".")[2] not in ACCOUNTS]
    signals = [f'"{name}"' for name in shown[:8]]
    out = [
        f"# cosim run {folder.as_posix()}",
        f'description = "{system.name}"',
        'system = "system.toml"',
        "duration = 5.0",
        "step = 1e-3          # exchange between the FMUs [s]",
        'algorithm = "gauss_seidel"',
        f"plot = [{', '.join(signals)}]",
        "",
        "# Open inputs keep their start values unless driven here: by a number, a table",
        '# { times = [0.0, 1.0], values = [0.0, 5.0] } or a log { file = "log.csv", column = "u" }',
        "[inputs]",
    ]
    for name in open_inputs:
        variable = system.declaration(name)
        start = str(variable.start[0] if variable.start else 0.0)
        out.append(f'# "{name}" = {start}   # [{variable.symbol}] {variable.text}')
    return "\n".join(out) + "\n"
