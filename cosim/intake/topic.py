"""Topic: columns that came on one clock, as all sources give them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ..data.logs import Log


@dataclass(frozen=True)
class Topic:
    """Columns on one clock.

    Attributes:
        name: in its source, e.g. `/odom`; of a plain table the file's name without its end.
        kind: of the file or the message, e.g. `CSV` or `nav_msgs/msg/Odometry`.
        log: the columns, with the units that the source itself states.
        clock: name of the column of times where the source says so, "" else.
        frames: of positions and directions, e.g. `odom -> base_link`; "" where unknown.
        notes: what was assumed in reading.
        made: columns that are the yaw of a quaternion -> its columns x, y, z, w.
    """

    name: str
    kind: str
    log: Log
    clock: str = ""
    frames: str = ""
    notes: tuple[str, ...] = ()
    made: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Source:
    """A file of a log.

    Attributes:
        path: of the file, or of the folder of a ROS 2 bag.
        kind: of the file.
        topics: that hold columns.
        plain: whether it is one table, which a mapping reads as it is.
        left: topics without columns, by name: why.
    """

    path: Path
    kind: str
    topics: tuple[Topic, ...]
    plain: bool = True
    left: dict[str, str] = field(default_factory=dict)
