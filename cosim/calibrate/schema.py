"""The keys of a `dataset.toml` and the kinds of their values; anything else is an error."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from ..errors import ScenarioError, listing
from ..files import flatten

Check = Callable[[Any, str], None]


def _fail(where: str, value: Any, wanted: str) -> ScenarioError:
    return ScenarioError(f"{where} is {value!r}; it must be {wanted}")


def text(value: Any, where: str) -> None:
    """A text."""
    if not isinstance(value, str):
        raise _fail(where, value, "a text in quotes")


def number(value: Any, where: str) -> None:
    """A finite number."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise _fail(where, value, "a number")


def positive(value: Any, where: str) -> None:
    """A number above 0."""
    number(value, where)
    if not value > 0.0:
        raise _fail(where, value, "greater than 0")


def at_least_zero(value: Any, where: str) -> None:
    """A number that is not negative."""
    number(value, where)
    if value < 0.0:
        raise _fail(where, value, "0 or more")


def flag(value: Any, where: str) -> None:
    """True or false."""
    if not isinstance(value, bool):
        raise _fail(where, value, "true or false")


def table(value: Any, where: str) -> None:
    """A table."""
    if not isinstance(value, Mapping):
        raise _fail(where, value, "a table")


def texts(value: Any, where: str) -> None:
    """A list of texts."""
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise _fail(where, value, "a list of texts")


def number_or_text(value: Any, where: str) -> None:
    """A number, or where to find one."""
    if not isinstance(value, str):
        number(value, where)


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
    table(value, where)
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


def unwrap(value: Any, where: str) -> None:
    """True, or where a counter begins anew."""
    if not isinstance(value, bool):
        positive(value, where)


def several(size: int, check: Check) -> Check:
    """A list of so many."""

    def checked(value: Any, where: str) -> None:
        if not isinstance(value, list) or len(value) != size:
            raise _fail(where, value, f"a list of {size}")
        for item in value:
            check(item, where)

    return checked


def columns_of(value: Any, where: str) -> None:
    """Column names, one by one or as a range."""
    if not isinstance(value, str):
        texts(value, where)


CHANNEL: dict[str, Check] = {
    "signal": text, "column": text, "gain": number, "offset": number, "sigma": positive,
    "quantum": at_least_zero, "roundings": positive,
    "transform": one_of("sample", "mean", "difference"), "window": positive, "unit": text,
    "shift": number, "optional": flag,
}  # fmt: skip
INPUT: dict[str, Check] = {
    "column": text, "columns": columns_of, "gain": number, "unit": text, "quantum": positive,
    "interpolation": one_of("hold", "linear", "slope", "window"),
}  # fmt: skip
COLUMN: dict[str, Check] = {
    "source": text, "time": text, "late": number, "scale": number, "offset": number, "unit": text,
    "from": text, "lowpass": at_least_zero, "derivative": flag, "hold": flag, "gap": positive,
    "limit": positive, "ends": several(2, text), "unwrap": unwrap,
    "quaternion": several(4, text), "fresh": flag, "despike": flag,
}  # fmt: skip
PARAMETER: dict[str, Check] = {
    "name": text, "unit": text, "nominal": number_or_text, "min": number, "max": number,
    "span": at_least_zero, "targets": targets, "prior": positive, "description": text,
    "per_run": flag, "late": flag,
}  # fmt: skip
RUN: dict[str, Check] = {
    "name": text, "prefix": text, "rows": flag, "interval": positive, "each": text, "where": table,
    "window": positive, "samples": several(2, positive),
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
                keyed(entry, keys, place, needed)

    return check


def _list(keys: Mapping[str, Check], needed: Iterable[str]) -> Check:
    """A list of tables of these keys."""

    def check(value: Any, where: str) -> None:
        if not isinstance(value, list):
            raise _fail(
                where, value, f"a list of tables; begin each with [[{where.rpartition(' ')[2]}]]"
            )
        for entry in value:
            name = entry.get("name") if isinstance(entry, Mapping) else None
            keyed(entry, keys, f"{where} {name}" if name else where, needed)

    return check


def _relative(value: Any, where: str) -> None:
    if not isinstance(value, list):
        raise _fail(where, value, "a list of poses, each [x, y, yaw]")
    for item in value:
        several(3, text)(item, where)


def _table_of(keys: Mapping[str, Check]) -> Check:
    return lambda value, where: keyed(value, keys, where, ())


MAPPING: dict[str, Check] = {
    "description": text, "rig": text, "system": text, "base": text, "further": texts,
    "step": positive, "algorithm": text, "period": positive, "ticks": flag,
    "search_step": positive, "search": _table_of(SEARCH), "lead": at_least_zero,
    "time": text, "resample": positive, "gap": positive, "relative": _relative, "only": table,
    "parameters": constants, "sheet": targets_by_name, "fixed": targets_by_name,
    "starts": targets_by_name, "inputs": _tables(INPUT, (), text),
    "columns": _tables(COLUMN, ()), "channels": _tables(CHANNEL, ("signal",)),
    "parameter": _list(PARAMETER, ("name", "nominal", "targets")),
    "nuisance": _list(PARAMETER, ("name", "nominal", "targets")),
    "run": lambda value, where: None,  # see `logs.runs_of`
    "checks": _table_of(CHECKS),
}  # fmt: skip
"""Kind of the value of each key."""
NEEDED = ("step", "channels")


def keyed(value: Any, keys: Mapping[str, Check], where: str, needed: Iterable[str]) -> None:
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
    keyed(content, MAPPING, str(path), NEEDED)
    if not content["channels"]:
        raise ScenarioError(f"{path}: [channels] is empty: nothing measured would be compared")
