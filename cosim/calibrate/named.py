"""Variables that a mapping names, with factors; and starts that sensors have read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ..errors import ScenarioError, UnknownNameError, listing
from ..files import flatten

FIRST = "first:"
"""Before the name of a column whose first value is meant."""


def named(entry: Any, where: str) -> tuple[tuple[str, float], ...]:
    """`"a.b"`, a list of such, or a table variable -> factor.

    Raises:
        ScenarioError: it is none of these.
    """
    if isinstance(entry, str):
        return ((entry, 1.0),)
    if isinstance(entry, list):
        return tuple((str(item), 1.0) for item in entry)
    if isinstance(entry, dict):
        return tuple((name, float(factor)) for name, factor in flatten(entry).items())
    raise ScenarioError(f"{where}: {entry!r} names no variables")


def readings(table: Mapping[str, Any], where: str) -> dict[str, dict[str, float]]:
    """Error of a sensor, as an effect calls it -> starts that it has read, with factors.

    Where a start is the reading of an encoder, an error of the encoder is one of the start: what is
    simulated begins at the reading less the error.

    Args:
        table: the mapping.
        where: for messages.

    Raises:
        ScenarioError: an entry names no variables.
        UnknownNameError: a start that `[starts]` does not set.
    """
    starts = [n for entry in table.get("starts", {}).values() for n, _ in named(entry, where)]
    found = {}
    for error, entry in table.get("readings", {}).items():
        found[error] = dict(named(entry, where))
        for name in found[error]:
            if name not in starts:
                raise UnknownNameError(
                    f"{where} {error}: [starts] sets no {name!r}; {listing(starts, name)}"
                )
    return found


def read_first(
    table: Mapping[str, Any], path: str
) -> Iterator[tuple[str, Any, str | None, str]]:  # fmt: skip
    """Starts that are read off the first value of a column, as the mapping says it.

    Yields:
        The column, the entry that names what begins so, its unit (None: the column's), and where
        it stands.
    """
    for key, entry in table.get("starts", {}).items():
        if key.startswith(FIRST):
            yield key.removeprefix(FIRST), entry, None, f"{path}: [starts] {key}"
    for entry in table.get("nuisance", []):
        nominal = str(entry["nominal"])
        if nominal.startswith(FIRST):
            where = f"{path}: nuisance {entry.get('name')}"
            yield nominal.removeprefix(FIRST), entry["targets"], str(entry.get("unit", "")), where
