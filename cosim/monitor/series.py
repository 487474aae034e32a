"""Reads the logs of one machine with their dates.

A folder is one data set whose runs have dates, or it holds one data set per visit, as
`cosim twin --out` leaves them. Dates come from the first of these that all runs have:

    date      of the run in `set.toml` or `dataset.toml`, else of the whole `set.toml`
    name      an ISO date in the file's name, else in that of the data set's folder
    time      at which the file was last changed, which a copy may have lost

Runs of the same date are one log.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any

from ..calibrate.joining import Joined
from ..calibrate.mapping import read_joined
from ..calibrate.problem import Problem
from ..errors import ScenarioError
from ..files import read_toml
from ..installation.builder import default_provider
from ..system.provider import Provider

LEAST = 6
"""Logs of a series: with fewer, no step between them can be told from their scatter."""
SOURCES = ("date of the runs", "names of the files", "times at which the files were changed")
_ISO = re.compile(
    r"(?<!\d)((?:19|20)\d{2})(-?)(\d{2})\2(\d{2})"
    r"(?:[T _-]+(\d{2})[-:_h]?(\d{2})(?:[-:_m]?(\d{2}))?)?(?!\d)"
)


@dataclass(frozen=True)
class DatedLog:
    """The runs of one date.

    Attributes:
        name: of its first run.
        date: when it was taken, UTC where a zone is known.
        runs: names of the problem's runs.
    """

    name: str
    date: datetime
    runs: tuple[str, ...]


@dataclass(frozen=True)
class Series:
    """Logs of one machine.

    Attributes:
        name: of the folder.
        problem: the model, its parameters and all runs.
        logs: by date.
        dated: one of `SOURCES`.
        left_out: how many more there are, which cannot be used.
    """

    name: str
    problem: Problem
    logs: tuple[DatedLog, ...]
    dated: str
    left_out: int = 0


def read_series(
    folder: Path | str,
    provider: Provider | None = None,
    *,
    mapping: Path | str | None = None,
    system: str | None = None,
) -> Series:
    """Read a folder of logs.

    Args:
        folder: a data set whose runs have dates, or a folder of data sets.
        provider: where variants come from; builds them if not given.
        mapping: as of `read_problem`.
        system: as of `read_problem`.

    Raises:
        ScenarioError, UnknownNameError: a file or a name in it is wrong, a date is, or there are
            too few logs.
    """
    provider = default_provider() if provider is None else provider
    place = Path(folder)
    sets = _sets(place)
    if not sets:
        parts = [_part(place, read_joined(place, provider, mapping=mapping, system=system))]
    else:
        parts = [
            _part(one, read_joined(one, provider, mapping=mapping, system=system), one.name)
            for one in sets
        ]
    first = parts[0].problem
    for part in parts[1:]:
        _same(first, part.problem, parts[0].place, part.place)
    problem = first.changed(
        runs=[run for part in parts for run in part.problem.runs],
        parameters=[
            *(p for p in first.parameters if not p.run),
            *(p for part in parts for p in part.problem.parameters if p.run),
        ],
        late=[p for part in parts for p in part.problem.late],
        further=(),
    )  # fmt: skip
    logs, dated = _dated(parts)
    if len(logs) < LEAST:
        raise ScenarioError(
            f"{place}: has {len(logs)} logs of different dates ({dated}), and it takes {LEAST} to "
            "tell a change from their scatter"
        )
    return Series(place.resolve().name, problem, logs, dated)


def _sets(place: Path) -> list[Path]:
    """Data sets below a folder that is none itself."""
    if not place.is_dir() or (place / "set.toml").is_file():
        return []
    mapping = place / "dataset.toml"
    if mapping.is_file() and "run" in read_toml(mapping):
        return []
    return sorted(
        one
        for one in place.iterdir()
        if one.is_dir() and any((one / name).is_file() for name in ("set.toml", "dataset.toml"))
    )


@dataclass(frozen=True)
class _Part:
    """One data set: where, its problem, and per run its entries and files."""

    place: Path
    problem: Problem
    entries: Mapping[str, tuple[Any, Path]]


def _part(place: Path, read: tuple[Joined, Problem], prefix: str = "") -> _Part:
    joined, problem = read
    folder = joined.data.folder
    described = folder / "set.toml"
    common = read_toml(described).get("date") if described.is_file() else None
    if prefix:
        problem = _renamed(problem, prefix)
    entries = {}
    for run in problem.runs:
        logged = joined.data.runs[str(run.values["name"])]
        entries[run.name] = (run.values.get("date", common), next(iter(logged.files.values())))
    return _Part(folder, problem, entries)


def _renamed(problem: Problem, prefix: str) -> Problem:
    """The problem with names of runs that no other data set has."""

    def own(name: str) -> str:
        return f"{prefix}/{name}"

    return problem.changed(
        runs=[replace(run, name=own(run.name)) for run in problem.runs],
        **{
            key: [
                replace(p, run=own(p.run), name=p.name.removesuffix(p.run) + own(p.run))
                if p.run else p
                for p in getattr(problem, key)
            ]
            for key in ("parameters", "late")
        },
    )  # fmt: skip


def _same(first: Problem, other: Problem, place: Path, another: Path) -> None:
    """Refuse data sets that do not describe the same machine alike."""
    pairs = (
        ("the system", first.file.path.name, other.file.path.name),
        ("channels", [c.name for c in first.channels], [c.name for c in other.channels]),
        ("parameters", [p.name for p in first.parameters if not p.run],
         [p.name for p in other.parameters if not p.run]),
        ("the communication step", first.step, other.step),
    )  # fmt: skip
    for what, here, there in pairs:
        if here != there:
            raise ScenarioError(
                f"{another}: {what} is {there}, but {here} in {place}; logs of one machine need "
                "one mapping: give it with --mapping"
            )


def _dated(parts: Sequence[_Part]) -> tuple[tuple[DatedLog, ...], str]:
    """The logs in order of their dates, and where these come from."""
    runs = [
        (part, run.name, *part.entries[run.name]) for part in parts for run in part.problem.runs
    ]
    given = [name for _, name, value, _ in runs if value is not None]
    whole = len(parts) > 1
    if given and len(given) < len(runs):
        lacking = next(name for _, name, value, _ in runs if value is None)
        raise ScenarioError(
            f"{parts[0].place}: run {lacking!r} has no date, but {given[0]!r} has; give each run "
            "one, e.g. date = 2025-03-14"
        )
    found: dict[str, datetime] = {}
    if given:
        dated = SOURCES[0]
        found = {name: read_date(value, f"{p.place}: run {name}") for p, name, value, _ in runs}
    else:
        named = {
            name: date_in(file.name) or (date_in(part.place.name) if whole else None)
            for part, name, _, file in runs
        }
        dated = SOURCES[1]
        found = {name: when for name, when in named.items() if when is not None}
        if len(found) < len(runs):
            dated = SOURCES[2]
            found = {
                name: datetime.fromtimestamp(file.stat().st_mtime, UTC).replace(
                    tzinfo=None, microsecond=0
                )
                for _, name, _, file in runs
            }  # fmt: skip
    groups: dict[tuple[datetime, str], list[str]] = {}
    for part, name, _, _ in runs:
        when = found[name]
        if whole and dated == SOURCES[2]:  # one visit is one log, however long copying took
            when = min(found[run.name] for run in part.problem.runs)
        groups.setdefault((when, str(part.place) if whole else ""), []).append(name)
    logs = [DatedLog(names[0], when, tuple(names)) for (when, _), names in sorted(groups.items())]
    return tuple(logs), dated


def read_date(value: Any, where: str) -> datetime:
    """A date of TOML, or an ISO text.

    Raises:
        ScenarioError: it is none.
    """
    if isinstance(value, str):
        try:
            value = datetime.fromisoformat(value)
        except ValueError:
            raise ScenarioError(
                f"{where}: date {value!r} is no ISO date; write 2025-03-14 or 2025-03-14T09:30"
            ) from None
    if isinstance(value, datetime):
        return value if value.tzinfo is None else value.astimezone(UTC).replace(tzinfo=None)
    if isinstance(value, date):
        return datetime(value.year, value.month, value.day)
    raise ScenarioError(f"{where}: date {value!r} is no date; write 2025-03-14 or 2025-03-14T09:30")


def date_in(name: str) -> datetime | None:
    """The ISO date in a name, with the time of day if it follows; None without one."""
    for match in _ISO.finditer(name):
        year, _, month, day, *clock = match.groups()
        hour, minute, second = (int(part or 0) for part in clock)
        if hour > 23 or minute > 59 or second > 59:  # a number of its own
            hour = minute = second = 0
        try:
            return datetime(int(year), int(month), int(day)) + timedelta(
                hours=hour, minutes=minute, seconds=second
            )
        except ValueError:  # digits that are no date
            continue
    return None
