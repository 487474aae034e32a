"""ROS 1 bags, ROS 2 bags (sqlite3 and MCAP) and single MCAP files, by the library `rosbags`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...data.cells import integers
from ...data.logs import Log
from ...errors import InputError, ScenarioError, listing
from ...reading.limits import DATA
from ..topic import Source, Topic
from . import messages

Vector = NDArray[np.float64]
STAMPED = 0.9
"""Share of headers that must have a time for these to count: simulated time begins at 0."""
FRAMES = 8
"""Frames that are a topic each; a field with more of them is used for something else."""
ENDS = (".bag", ".mcap", ".db3")


@dataclass
class _Collected:
    """Rows of a topic."""

    kind: str
    received: list[int] = field(default_factory=list)
    stamps: list[int] = field(default_factory=list)
    frames: list[str] = field(default_factory=list)
    rows: list[messages.Row] = field(default_factory=list)
    units: dict[messages.Path, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def within(self, frames: str) -> _Collected:
        """The rows in some frames."""
        mine = [place for place, named in enumerate(self.frames) if named == frames]

        def only(items: list[Any]) -> list[Any]:
            return [items[place] for place in mine]

        note = (
            f"{len(mine)} of {len(self.rows)} messages of this topic are in "
            f"{frames or 'no frame'}; those in other frames are a topic of their own"
        )
        return _Collected(
            self.kind, only(self.received), only(self.stamps), only(self.frames), only(self.rows),
            self.units, [note],
        )  # fmt: skip


def is_bag(path: Path) -> bool:
    """Whether a path is a bag: by its end, or a folder with `metadata.yaml`."""
    return path.suffix.lower() in ENDS or (path / "metadata.yaml").is_file()


def read(path: Path, topics: tuple[str, ...], recorded: bool = False) -> Source:
    """Read a bag; each topic that holds numbers becomes one, or one for each of its frames.

    Args:
        path: of the file or the folder.
        topics: only these, all if not given.
        recorded: take the times of recording instead of the stamps in headers.

    Raises:
        InputError: the library is not installed.
        ScenarioError: it is missing, damaged, too large, or has no such topic.
    """
    if not path.exists():
        raise ScenarioError(f"{path}: there is no such file")
    try:
        import rosbags.highlevel  # noqa: F401
    except ImportError:
        raise InputError(
            f"{path}: bags are read by the library rosbags, which is not installed; "
            "pip install rosbags"
        ) from None
    left: dict[str, str] = {}
    found: dict[str, _Collected] = {}
    try:
        for name, kind, received, message in _messages(path, topics, left):
            for tail, part in messages.parts(message, kind):
                own = found.setdefault(name + tail, _Collected(kind))
                own.frames.append(messages.frames(part))
                own.received.append(received)
                own.stamps.append(messages.stamp(part))
                own.rows.append(messages.numbers(part, kind, own.units))
            _check_size(path, found)
    except ScenarioError:
        raise
    except Exception as error:  # of the library and of those below it: files can be anything
        text = str(error).splitlines() or [type(error).__name__]
        raise ScenarioError(
            f"{path}: is no whole bag of ROS 1 or 2 ({text[0][:200]}); try `ros2 bag reindex`, or "
            "record it again"
        ) from error
    made = []
    for name, own in _by_frames(found):
        if strange := [t for t in own.received if not isinstance(t, int)]:
            raise ScenarioError(
                f"{path}: a message of {name} was recorded at {strange[0]!r}, which is no time; "
                "record the bag again"
            )
        if any(own.rows):
            made.append(_topic(name, own, recorded))
        else:
            left[name] = f"{own.kind} holds no numbers"
    return Source(path, "ROS bag", tuple(made), plain=False, left=left)


def _messages(
    path: Path, topics: tuple[str, ...], left: dict[str, str]
) -> Iterator[tuple[str, str, int, Any]]:
    """Topic, type, time of receiving [ns] and message, of the topics that are wanted."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    # bags of old releases do not say what their types are
    store = get_typestore(Stores.ROS2_HUMBLE)
    with AnyReader([path], default_typestore=store) as reader:
        names = sorted({c.topic for c in reader.connections})
        for name in topics:
            if name not in names:
                raise ScenarioError(f"{path}: --topic {name}: {listing(names, name, limit=30)}")
        chosen = []
        for connection in reader.connections:
            if topics and connection.topic not in topics:
                left[connection.topic] = "not asked for"
            elif connection.msgtype in messages.HEAVY:
                left[connection.topic] = f"{connection.msgtype} holds no signals"
            else:
                chosen.append(connection)
        if not chosen:
            return
        for connection, received, raw in reader.messages(connections=chosen):
            message = reader.deserialize(raw, connection.msgtype)
            yield connection.topic, connection.msgtype, received, message


def _check_size(path: Path, found: dict[str, _Collected]) -> None:
    rows = sum(len(own.rows) for own in found.values())
    if rows % 10_000:
        return
    values = sum(len(own.rows) * len(own.rows[0]) for own in found.values() if own.rows)
    if excess := DATA.excess(32 * values):
        raise ScenarioError(f"{path}: {excess}; or read fewer topics with --topic")


def _by_frames(found: dict[str, _Collected]) -> Iterator[tuple[str, _Collected]]:
    """Topics by name; one whose messages are in several frames is several."""
    for name, own in found.items():
        frames = dict.fromkeys(own.frames)
        if len(frames) == 1:
            yield name, own
        elif len(frames) > FRAMES:
            own.notes.append(f"its messages name {len(frames)} frames, {own.frames[0]!r} first")
            own.frames = [""]
            yield name, own
        else:
            for one in frames:
                yield f"{name} {one}".strip(), own.within(one)


def _columns(own: _Collected) -> tuple[dict[str, Vector], dict[str, str]]:
    """Columns and their units by name."""
    names = messages.names(path for row in own.rows for path in row)
    table = {
        name: np.array([row.get(path, np.nan) for row in own.rows], dtype=np.float64)
        for path, name in names.items()
    }
    return table, {names[path]: unit for path, unit in own.units.items() if path in names}


def _ordered(
    times: list[int], columns: dict[str, Vector], notes: list[str]
) -> tuple[list[int], dict[str, Vector]]:
    """Rows in the order of their times; of several at one time, the first value of each column."""
    stamps = np.array(times, dtype=np.int64)
    known, first, places = np.unique(stamps, return_index=True, return_inverse=True)
    again = stamps.size - first.size
    mixed = int(np.count_nonzero(np.diff(stamps) < 0))
    if not again:
        ordered = {name: values[first] for name, values in columns.items()}
    else:
        ordered, used = {}, np.zeros(stamps.size, dtype=bool)
        for name, values in columns.items():
            good = np.flatnonzero(np.isfinite(values))
            own, place = np.unique(places[good], return_index=True)
            ordered[name] = np.full(known.size, np.nan)
            ordered[name][own] = values[good[place]]
            used[good[place]] = True
        used[first] = False
        joined = int(np.count_nonzero(used))
        again -= joined
        if joined:
            notes.append(
                f"{joined} messages with a stamp that was there already hold columns that the "
                "first did not, and are put together with it"
            )
    if again or mixed:
        notes.append(
            f"{again} messages with a stamp that was there already are left out, {mixed} out of "
            "order are put where they belong"
        )
    return known.tolist(), ordered


def _topic(name: str, own: _Collected, recorded: bool) -> Topic:
    (columns, units), notes = _columns(own), own.notes
    stamps, received = np.array(own.stamps, dtype=np.int64), np.array(own.received, dtype=np.int64)
    if recorded:
        times = own.received
        notes.append("times are those at which messages were recorded, as wished")
    elif stamps.size and float(np.mean(stamps > 0)) > STAMPED:
        later = (received - stamps) * 1e-9
        times = own.stamps
        notes.append(
            f"times are those of the headers; messages were recorded {np.median(later):.4g} s "
            f"after them ({np.min(later):.4g} to {np.max(later):.4g} s)"
        )
    else:
        times = own.received
        what = "has no header" if np.all(stamps < 0) else "has headers without a time"
        notes.append(f"{what}: times are those at which messages were recorded")
    times, columns = _ordered(times, columns, notes)
    columns, off = messages.turned(columns, units)
    columns, said = messages.beside_clock(columns, units)
    clock, origin = integers(times)
    log = Log(
        name, {"time": clock, **columns},
        units={"time": "ns", **{n: u for n, u in units.items() if n in columns}},
        origins={"time": origin} if origin else {},
    )  # fmt: skip
    told = (*notes, *off, *said)
    return Topic(name, own.kind, log, clock="time", frames=own.frames[0], notes=told)
