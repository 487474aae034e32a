"""Inputs of the system that no column drives, though the log has one that nothing uses."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...data.logs import Log
from ...errors import UnitError
from ...installation.examples import read_mapping
from ...spec.units import Unit, parse
from ...system.system import System
from ..columns import expand
from .finding import Finding

MOST = 4
"""Columns that are named; more hardly help."""


def check_undriven(
    system: System,
    driven: Iterable[str],
    settled: Collection[str],
    logs: Mapping[str, Log],
    units: Mapping[str, str],
    tables: Iterable[Mapping[str, Any]],
) -> Iterator[Finding]:
    """Open inputs that stay at their start values, though a column may be them.

    Many inputs are left on purpose: of a mount that stands, of what a camera does not see. So one
    is named only where a column moves that no mapping uses and that fits: one of the input's unit,
    or one of unknown unit where the log drives another input of the same instance and unit (the
    other wheel). Nothing here is of chance.

    Args:
        system: whose inputs.
        driven: inputs that columns drive.
        settled: variables that the mapping sets to a value.
        logs, units: with the columns.
        tables: the mapping, and those that it names as further ones (`mappings`).
    """
    driven = list(driven)
    left = [
        name for name in system.open_inputs()
        if not {name, name.partition("[")[0]} & {*driven, *settled}
    ]  # fmt: skip
    if not left:
        return
    unused = _moving(logs, set().union(*map(used, tables)))
    for name in left:
        declared = system.variables(name)[1][0]
        beside = any(
            other.partition(".")[0] == name.partition(".")[0]
            and _same(system.variables(other)[1][0].unit, declared.unit)
            for other in driven
        )
        fit = [
            column for column in unused
            if (_same(_known(units[column]), declared.unit) if units.get(column) else beside)
        ]  # fmt: skip
        if not fit:
            continue
        start = float((declared.start or (0.0,))[0] or 0.0)
        text = (
            f"is an input that no column drives: it stays at {start:g} {declared.symbol}".rstrip()
            + f", though nothing uses {', '.join(fit[:MOST])} of the log; give the column under "
            f'[inputs] ("{name}" = "{fit[0]}"), or the value that it keeps under [parameters] '
            f'("{name}" = {start:.1f})'
        )
        yield Finding("warning", "undriven", "", name, text)


def mappings(table: Mapping[str, Any], path: Path) -> Iterator[Mapping[str, Any]]:
    """A mapping, and the further ones beside it, which use the same logs."""
    yield table
    for name in table.get("further", ()):
        yield read_mapping(path.parent / name)


def used(table: Mapping[str, Any]) -> set[str]:
    """Columns that a mapping uses, and what it makes them of."""
    found = {"time", str(table.get("time", "time"))}
    for pattern, entry in table.get("channels", {}).items():
        found.update(str(entry.get("column", one)) for one in expand(pattern))
    for said in table.get("inputs", {}).values():
        columns = said if isinstance(said, str) else said.get("column", said.get("columns", ()))
        found.update(expand(columns) if isinstance(columns, str) else columns)
    values = [*table.get("starts", {})]
    values += [e.get("nominal") for k in ("parameter", "nuisance") for e in table.get(k, ())]
    found.update(v.removeprefix("first:") for v in values if isinstance(v, str))
    for pattern, entry in table.get("columns", {}).items():
        for i, name in enumerate(expand(pattern), 1):
            if name in found or name in ("time", table.get("time")):
                made = [entry.get("source", name), entry.get("time", "time")]
                made += [*entry.get("quaternion", ()), *entry.get("ends", ())]
                found.update(str(one).replace("{}", str(i)).partition("[")[0] for one in made)
    return found


def _moving(logs: Mapping[str, Log], known: set[str]) -> list[str]:
    """Columns of the logs that change and are none of these."""
    found: dict[str, None] = {}
    for log in logs.values():
        for name, values in log.columns.items():
            if name in known or name in found or values.shape != log.time.shape:
                continue
            good = values[np.isfinite(values)]
            if good.size and float(np.ptp(good)) > 0.0:
                found[name] = None
    return list(found)


def _known(unit: str) -> Unit | None:
    try:
        return parse(unit)
    except UnitError:
        return None


def _same(one: Unit | None, other: Unit | None) -> bool:
    """Whether two units measure the same."""
    return one is not None and other is not None and one.exponents == other.exponents
