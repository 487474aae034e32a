"""The keys of a `dataset.toml` and the kinds of their values; anything else is an error."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ..errors import ScenarioError, listing
from ..files import flatten
from ..master.algorithms import known_options, names
from ..reading.schema import (
    Check,
    anything,
    either,
    fail,
    flag,
    list_of,
    number,
    said,
    table,
    table_of,
    text,
    texts,
)


def positive(value: Any, where: str) -> None:
    """A number above 0."""
    number(value, where)
    if not value > 0.0:
        raise fail(where, value, "greater than 0")


def at_least_zero(value: Any, where: str) -> None:
    """A number that is not negative."""
    number(value, where)
    if value < 0.0:
        raise fail(where, value, "0 or more")


def constants(value: Any, where: str) -> None:
    """Full variable name = number, or a list of numbers for a vector."""
    table(value, where)
    for name, item in flatten(value).items():
        for one in item if isinstance(item, list) else [item]:
            number(one, f"{where} {name}")


def targets(value: Any, where: str) -> None:
    """A variable, a list of such, or a table variable = factor."""
    if isinstance(value, str):
        return
    if isinstance(value, list):
        return texts(value, where)
    if not isinstance(value, Mapping):
        raise fail(where, value, "a variable, a list of such, or a table variable = factor")
    for name, item in flatten(value).items():
        number(item, f"{where} {name}")


def targets_by_name(value: Any, where: str) -> None:
    """Name = targets."""
    table(value, where)
    for name, item in value.items():
        targets(item, f"{where} {name}")


def one_of(*choices: str) -> Check:
    """One of some texts."""

    def check(value: Any, where: str) -> None:
        if value not in choices:
            raise ScenarioError(f"{where} {value!r} is not known; {listing(choices, str(value))}")

    return check


CHANNEL: dict[str, Check] = {
    "signal": text, "column": text, "gain": number, "offset": number, "sigma": positive,
    "quantum": at_least_zero, "roundings": positive,
    "transform": one_of("sample", "mean", "difference"), "window": positive, "unit": text,
    "shift": number, "optional": flag, "by": text,
}  # fmt: skip
INPUT: dict[str, Check] = {
    "column": text, "columns": either("a column or a list of columns", text, texts),
    "gain": number, "unit": text, "quantum": positive, "sigma": at_least_zero,
    "interpolation": one_of("hold", "linear", "slope", "window"),
}  # fmt: skip
COLUMN: dict[str, Check] = {
    "source": text, "time": text, "late": number, "scale": number, "offset": number, "unit": text,
    "from": text, "lowpass": at_least_zero, "derivative": flag, "hold": flag, "gap": positive,
    "limit": positive, "ends": list_of(text, 2),
    "unwrap": either("true, false or a number greater than 0", flag, positive),
    "quaternion": list_of(text, 4), "fresh": flag, "despike": flag,
    "missing": number,
}  # fmt: skip
PARAMETER: dict[str, Check] = {
    "name": text, "unit": text, "nominal": said, "min": number, "max": number,
    "span": at_least_zero, "targets": targets, "prior": positive, "description": text,
    "per_run": flag, "late": flag,
}  # fmt: skip
RUN: dict[str, Check] = {
    "name": text, "prefix": text, "rows": flag, "interval": positive, "each": text, "where": table,
    "window": positive, "samples": list_of(positive, 2),
}  # fmt: skip
"""Entries of a run that say how its log is taken apart; others are what a mapping asks for."""
SEARCH: dict[str, Check] = {"options": table, "parameters": constants}
CHECKS: dict[str, Check] = {"allow": texts}


def _tables(keys: Mapping[str, Check], needed: Iterable[str], plain: Check | None = None) -> Check:
    """Name = table of these keys, or something plainer."""

    def check(value: Any, where: str) -> None:
        table(value, where)
        for name, entry in value.items():
            place = f"{where} {name}"
            if plain is not None and not isinstance(entry, Mapping):
                plain(entry, place)
            else:
                strict(entry, keys, place, needed)

    return check


def _list(keys: Mapping[str, Check], needed: Iterable[str]) -> Check:
    """A list of tables of these keys."""

    def check(value: Any, where: str) -> None:
        if not isinstance(value, list):
            begin = where.rpartition(" ")[2]
            raise fail(where, value, f"a list of tables, each begun with [[{begin}]]")
        for entry in value:
            name = entry.get("name") if isinstance(entry, Mapping) else None
            strict(entry, keys, f"{where} {name}" if name else where, needed)

    return check


def _table_of(keys: Mapping[str, Check]) -> Check:
    return lambda value, where: strict(value, keys, where, ())


MAPPING: dict[str, Check] = {
    "description": text, "origin": text, "rig": text, "system": text, "base": text,
    "further": texts, "diagnosed": flag,
    "step": positive, "algorithm": text, "options": table, "period": positive, "tick": positive,
    "search_step": positive, "search": _table_of(SEARCH), "lead": at_least_zero,
    "time": text, "resample": positive, "gap": positive, "only": table,
    "relative": list_of(list_of(text, 3)), "variants": table_of(text), "without": texts,
    "parameters": constants, "sheet": targets_by_name, "fixed": targets_by_name,
    "starts": targets_by_name, "readings": targets_by_name, "inputs": _tables(INPUT, (), text),
    "columns": _tables(COLUMN, ()), "channels": _tables(CHANNEL, ("signal",)),
    "parameter": _list(PARAMETER, ("name", "nominal", "targets")),
    "nuisance": _list(PARAMETER, ("name", "nominal", "targets")),
    "run": anything,  # see `logs.runs_of`
    "checks": _table_of(CHECKS),
}  # fmt: skip
"""Kind of the value of each key."""
NEEDED = ("step", "channels")


def strict(value: Any, keys: Mapping[str, Check], where: str, needed: Iterable[str]) -> None:
    """A table with some of these keys, and all of the needed ones.

    Raises:
        ScenarioError: with the key, and the nearest known ones.
    """
    table(value, where)
    for key, item in value.items():
        if key not in keys:
            raise ScenarioError(f"{where}: has no key {key!r}; {listing(keys, key, limit=40)}")
        keys[key](item, f"{where}: {key}")
    for key in needed:
        if key not in value:
            raise ScenarioError(f"{where}: lacks {key!r}; {listing(value, key)}")


def check_mapping(content: Mapping[str, Any], path: Path) -> None:
    """Refuse what a mapping cannot have.

    Raises:
        ScenarioError: with file, key and the way out.
    """
    for key in content:
        if key not in MAPPING and any(key in known_options(name) for name in names()):
            raise ScenarioError(
                f"{path}: {key!r} is an option of the algorithm; write options.{key} = "
                f"{content[key]!r} as in a scenario.toml"
            )
    strict(content, MAPPING, str(path), NEEDED)
    if not content["channels"]:
        raise ScenarioError(f"{path}: [channels] is empty: nothing measured would be compared")
