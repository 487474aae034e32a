"""Dates and times of day as columns of text, and clocks in two columns: as nanoseconds.

2025-03-01T10:00:00.020Z    since 1970; without a zone UTC is taken
10:00:00.020                since midnight; a step back by more than half a day is the next one
2025-03-01, 10:00:00.020    a column of dates beside one of times of day: one clock, as the first
stamp.secs, stamp.nsecs     one clock `stamp`, as messages of ROS have it in two parts
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from .cells import EXACT, MISSING

Vector = NDArray[np.float64]
_MOMENT = re.compile(
    r"(?P<date>\d{4}[-/]\d\d[-/]\d\d)[T ]+(?P<time>\d\d:\d\d(?::\d\d(?:[.,]\d{1,9})?)?)"
    r" ?(?P<zone>Z|UTC|[+-]\d\d:?\d\d)?"
)
"""ISO 8601, with a blank for its T, and with slashes, as long as the year comes first."""
_OF_DAY = re.compile(r"(?P<time>\d{1,2}:\d\d:\d\d(?:[.,]\d{1,9})?)")
_DATE = re.compile(r"\d{4}[-/]\d\d[-/]\d\d")
YEARS = (1678, 2261)
"""Whole ones that 64 bits of nanoseconds since 1970 reach."""
_LIKE = re.compile(
    r"\d{1,2}[./-]\d{1,2}[./-]\d{2,4}[T ,]+\d{1,2}:\d\d.*|.*\d{1,2}:\d\d(:\d\d\S*)? ?[AaPp][Mm].*"
)
"""Dates that may have the day or the month first, and hours of half a day."""
_HALF_DAY = 43200 * 10**9
"""[ns]"""
_PARTS = {
    ("secs", "nsecs"): 1, ("sec", "nanosec"): 1, ("sec", "nsec"): 1, ("seconds", "nanoseconds"): 1,
    ("secs", "usecs"): 1000, ("sec", "usec"): 1000,
}  # fmt: skip
"""Ends of the names of two columns that are one clock, and the unit of the second one [ns]."""
_SECOND = 10**9
"""[ns]"""


def nanoseconds(cells: Sequence[str]) -> tuple[list[int | None], str] | None:
    """What cells count, None for missing ones, and what was assumed; None if they are no times.

    Every cell must be one, but for those that say that they are missing.
    """
    texts = [_bare(cell) for cell in cells]
    said = [text for text in texts if text.lower() not in MISSING]
    if not said:
        return None
    for pattern, reader in ((_MOMENT, _moments), (_OF_DAY, _of_day)):
        if not pattern.fullmatch(said[0]):
            continue
        found = [pattern.fullmatch(text) for text in said]
        if all(found):
            try:
                counts, note = reader([match for match in found if match])
            except ValueError:  # the 30th of February, minute 75, year 9999
                return None
            each = iter(counts)
            whole = [None if text.lower() in MISSING else next(each) for text in texts]
            return whole, note
    return None


def advice(example: str) -> str:
    """What to do with a cell that looks like a time and is not read as one, "" of any other."""
    if not _LIKE.fullmatch(example.strip()):
        return ""
    return "it may mean several times: write 2025-03-01T13:00:00.020, or seconds"


def _moments(found: list[re.Match[str]]) -> tuple[list[int], str]:
    if not all(YEARS[0] <= int(m["date"][:4]) <= YEARS[1] for m in found):
        raise ValueError("a year that 64 bits of nanoseconds do not reach")
    texts = [f"{m['date'].replace('/', '-')}T{m['time'].replace(',', '.')}" for m in found]
    counts = np.array(texts, dtype="datetime64[ns]").astype(np.int64)
    zones = [_zone(m["zone"]) for m in found]
    note = "dates and times, counted in ns since 1970"
    if not all(m["zone"] for m in found):
        note += "; UTC is taken, since no zone is said"
    return [int(count) - zone for count, zone in zip(counts, zones, strict=True)], note


def _zone(text: str | None) -> int:
    """What a zone's clock is ahead of UTC [ns]."""
    if not text or text in ("Z", "UTC"):
        return 0
    minutes = 60 * int(text[1:3]) + int(text[-2:])
    return (1 if text[0] == "+" else -1) * 60 * minutes * _SECOND


def _of_day(found: list[re.Match[str]]) -> tuple[list[int], str]:
    counts: list[int] = []
    days = 0
    for match in found:
        hours, minutes, seconds = match["time"].replace(",", ".").split(":")
        if int(minutes) > 59 or float(seconds) >= 60.0:
            raise ValueError("minutes and seconds end at 60")
        whole, _, part = seconds.partition(".")
        count = (3600 * int(hours) + 60 * int(minutes) + int(whole)) * _SECOND
        count += int(part.ljust(9, "0")) if part else 0
        if counts and counts[-1] - count - days * 2 * _HALF_DAY > _HALF_DAY:
            days += 1
        counts.append(count + days * 2 * _HALF_DAY)
    return counts, "times of day, counted in ns since midnight"


def beside(columns: Mapping[str, Sequence[str]]) -> tuple[str, str, list[str]] | None:
    """Dates and times of day in two columns: names of both, and their cells as moments.

    None unless there is one column of each; a row lacks its moment if it lacks one of both.
    """
    days = [name for name, cells in columns.items() if _all(_DATE, cells)]
    times = [name for name, cells in columns.items() if _all(_OF_DAY, cells)]
    if len(days) != 1 or len(times) != 1:
        return None
    both = [
        "" if {day.lower(), time.lower()} & MISSING else f"{day} {'0' * (time[1] == ':')}{time}"
        for day, time in zip(*(map(_bare, columns[n]) for n in (*days, *times)), strict=True)
    ]
    return days[0], times[0], both


def _bare(cell: str) -> str:
    return cell.strip().strip('"').strip()


def _all(pattern: re.Pattern[str], cells: Sequence[str]) -> bool:
    """Whether cells are of a pattern, but for those that say that they are missing."""
    said = [text for text in map(_bare, cells) if text.lower() not in MISSING]
    return bool(said) and all(map(pattern.fullmatch, said))


def in_two_parts(columns: Mapping[str, Vector]) -> dict[str, tuple[str, list[int]]]:
    """Clocks in two columns: name -> the first of them, and what it counts [ns].

    Both hold whole numbers, the second one less than a second.
    """
    found: dict[str, tuple[str, list[int]]] = {}
    for name, coarse in columns.items():
        for (first, second), unit in _PARTS.items():
            fine = columns.get(name.removesuffix(first) + second)
            if not name.endswith(first) or fine is None or coarse.shape != fine.shape:
                continue
            stem = name.removesuffix(first).rstrip("._/ ") or "stamp"
            if stem in columns or stem in found or not _whole(coarse, fine, _SECOND // unit):
                continue
            pairs = zip(coarse.tolist(), fine.tolist(), strict=True)
            found[stem] = (name, [int(s) * _SECOND + int(f) * unit for s, f in pairs])
    return found


def _whole(coarse: Vector, fine: Vector, most: int) -> bool:
    both = np.stack([coarse, fine])
    return bool(
        np.isfinite(both).all() and (both == np.rint(both)).all() and fine.size
        and (fine >= 0.0).all() and (fine < most).all() and np.abs(coarse).max() < EXACT
    )  # fmt: skip
