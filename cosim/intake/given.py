"""What the command line says: `--map COLUMN=VARIABLE[:UNIT]`, `--parameter`, `--run`, `--late`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import isfinite
from pathlib import Path

from ..errors import InputError, UnitError, UnknownNameError, listing
from ..spec.units import parse
from .guess import Guess
from .matching import Column, Match, Matches, Place, fits


def take(given: Sequence[str], columns: Sequence[Column], places: Sequence[Place]) -> Matches:
    """What `--map` says.

    Raises:
        InputError, UnknownNameError, UnitError: it does not fit the logs or the system.
    """
    matches = Matches()
    for text in given:
        source, equals, target = text.rpartition("=")
        if not equals or not source or not target:
            raise InputError(f"--map {text}: write --map 'COLUMN=instance.variable[:unit]'")
        name, _, unit = target.partition(":")
        place = next((p for p in places if p.name == name.strip()), None)
        if place is None:
            names = [p.name for p in places]
            raise UnknownNameError(
                f"--map {text}: {name!r} is no open input and no output of the system; "
                f"{listing(names, name, limit=30)}"
            )
        number = _number(source)
        if number is not None and source not in [c.source for c in columns]:
            if place.role != "input":
                raise InputError(f"--map {text}: {name} is an output; name the column that it is")
            matches.constants[place.name] = number
            continue
        column = find_column(source.strip(), columns, f"--map {text}")
        if unit:
            try:
                parse(unit)
            except UnitError as error:
                raise UnitError(f"--map {text}: {error}") from None
            column = replace(column, unit=Guess(unit, "given with --map", sure=True))
        if not fits(column.unit.unit, place):
            raise UnitError(
                f"--map {text}: the column is in {column.unit.unit!r} ({column.unit.reason}), but "
                f"{place.name} in {place.unit!r}; give the right unit after a colon, or choose "
                "another variable (what needs a factor goes into [columns] by hand)"
            )
        if place.role != "input" and not column.moves:
            raise InputError(
                f"--map {text}: the column never changes, so it measures nothing; leave it out"
            )
        into = matches.inputs if place.role == "input" else matches.channels
        if place.name in into:
            raise InputError(
                f"--map {text}: {place.name} is {into[place.name].column.source} already; "
                "give it one column"
            )
        into[place.name] = Match(column, place, "given with --map")
    return matches


def find_column(name: str, columns: Sequence[Column], where: str) -> Column:
    """A column by its source, or by its name alone where only one part has it.

    Raises:
        UnknownNameError: there is none, or several.
    """
    found = [c for c in columns if c.source == name] or [c for c in columns if c.name == name]
    if len(found) == 1:
        return found[0]
    if found:
        names = ", ".join(c.source for c in found)
        raise UnknownNameError(f"{where}: {name!r} is in several parts; write one of {names}")
    raise UnknownNameError(
        f"{where}: there is no column {name!r}; {listing([c.source for c in columns], name)}"
    )


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def runs_of(given: Sequence[str]) -> dict[str, list[Path]]:
    """What `--run NAME=FILE,FILE` says.

    Raises:
        InputError: it is not of that form.
    """
    found: dict[str, list[Path]] = {}
    for text in given:
        name, equals, files = text.partition("=")
        if not equals or not name or not files:
            raise InputError(f"--run {text}: write --run NAME=FILE, or NAME=FILE,FILE")
        if name in found:
            raise InputError(
                f"--run {text}: run {name!r} is there twice; give all its files at once"
            )
        found[name] = [Path(item) for item in files.split(",") if item]
    return found


def late_of(given: Sequence[str]) -> dict[str, float]:
    """What `--late PART=SECONDS` says [s].

    Raises:
        InputError: it is not of that form.
    """
    found: dict[str, float] = {}
    for text in given:
        part, _, rest = text.partition("=")
        number = _number(rest)
        if not part or number is None or not isfinite(number):
            raise InputError(
                f"--late {text}: write --late PART=SECONDS, e.g. --late pose=0.3 for a camera "
                "whose times are 0.3 s late"
            )
        found[part.strip()] = number
    return found


def parameters_of(given: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """What `--parameter NAME[=NOMINAL[:MIN:MAX]]` says.

    Raises:
        InputError: it is not of that form.
    """
    found: dict[str, tuple[float, ...]] = {}
    for text in given:
        name, _, rest = text.partition("=")
        try:
            numbers = tuple(float(item) for item in rest.split(":") if rest)
        except ValueError:
            numbers = ()
        if (rest and len(numbers) not in (1, 3)) or not name:
            raise InputError(
                f"--parameter {text}: write instance.name, instance.name=NOMINAL or "
                "instance.name=NOMINAL:MIN:MAX"
            )
        found[name.strip()] = numbers
    return found
