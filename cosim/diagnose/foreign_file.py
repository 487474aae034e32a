"""The system file of what was found at FMUs without sources: their adapters are in no other one."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from ..calibrate.problem import Problem
from ..errors import UnitError
from ..files import write_text
from ..spec.units import conversion
from ..system.system import System
from ..system.toml import DeclaredConnection
from .foreign import Adapter

NAME = "system.toml"


def leave_system(
    problem: Problem,
    adapters: Sequence[Adapter],
    made: Mapping[str, Mapping[str, object]],
    out: Path,
    warnings: list[str],
) -> list[Path]:
    """Write the system with those adapters that carry effects, and all calibrated values.

    Args:
        problem: with all adapters.
        adapters: these.
        made: `variants` and `values` of the model, as of `adding.made_of`.
        out: folder.
        warnings: gets why there is no file.

    Returns:
        The file; none where no adapter carries an effect or a file cannot say the system.
    """
    variants, values = made["variants"], made["values"]
    names = {a.name for a in adapters}
    if not names & set(variants):
        return []
    wires = _without(problem.file.connections, names - set(variants))
    system = problem.system()
    # others hold the factor of their units, or are as their file says them
    own = [w for w in wires if not w.convert]
    odd = [w for w in own if not _said(system, w)]
    odd += [w for w in wires if w.convert and (w.factor, w.offset) != (1.0, 0.0)]
    if odd:
        warnings.append(
            f"{NAME} is not written: {odd[0].source} -> {odd[0].target} has the factor "
            f"{odd[0].factor:g} and the offset {odd[0].offset:g}, which its units do not say and "
            "only SSP files can"
        )
        return []
    path = out / NAME
    write_text(path, _text(problem, adapters, names - set(variants), wires, variants, values))
    return [path]


def _without(
    wires: Sequence[DeclaredConnection], dropped: Collection[str]
) -> list[DeclaredConnection]:
    """Connections without some adapters: what went through them goes straight on."""
    into = {w.target: w for w in wires if w.target.partition(".")[0] in dropped}
    kept = []
    for wire in wires:
        if wire.target.partition(".")[0] in dropped:
            continue
        while (before := wire.source.partition(".")[0]) in dropped:
            first = into.get(f"{before}.u")
            if first is None:
                break  # a log drives the adapter, and then what it went to
            wire = wire._replace(
                source=first.source, factor=wire.factor * first.factor,
                offset=wire.factor * first.offset + wire.offset,
            )  # fmt: skip
        if wire.source.partition(".")[0] not in dropped:
            kept.append(wire)
    return kept


def _said(system: System, wire: DeclaredConnection) -> bool:
    """Whether a file that only names both ends makes this very connection, by their units."""
    out, into = (system.declaration(name).unit for name in (wire.source, wire.target))
    factor, offset = 1.0, 0.0
    if out is not None and into is not None:
        try:
            factor, offset = conversion(out, into)
        except UnitError:
            return False
    return math.isclose(factor, wire.factor) and math.isclose(offset, wire.offset, abs_tol=1e-12)


def _text(
    problem: Problem,
    adapters: Sequence[Adapter],
    dropped: Collection[str],
    wires: Sequence[DeclaredConnection],
    variants: Mapping[str, object],
    values: Mapping[str, object],
) -> str:
    file = problem.file
    lines = [
        f"# What was measured at {a.at} is {a.name}.y here: it is behind the adapter."
        for a in adapters
        if a.role == "output" and a.name in variants
    ]
    lines += [f"description = {json.dumps(file.text, ensure_ascii=False)}", "connections = ["]
    lines += [f'    "{w.source} -> {w.target}",' for w in wires]
    lines += ["]", "", "[instances]"]
    for name, reference in problem.instances.items():
        if name in dropped:
            continue
        shown = str(variants.get(name, reference))
        if shown.endswith(".fmu"):
            shown = (file.path.parent / shown).resolve().as_posix()
        lines.append(f"{name} = {json.dumps(shown, ensure_ascii=False)}")
    lines += ["", "[parameters]"]
    known = {**file.parameters, **values}
    lines += [
        f'"{name}" = {json.dumps(value)}'
        for name, value in known.items()
        if name.partition(".")[0] not in dropped and not name.startswith("clock:")
    ]
    return "\n".join(lines) + "\n"
