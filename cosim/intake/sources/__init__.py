"""Files of logs as topics: one file per kind of source."""

from __future__ import annotations

from pathlib import Path

from ...data.logs import READERS
from ...errors import ScenarioError
from ..topic import Source
from . import bags, tables, ulogs

KINDS = {
    **{suffix: tables.read for suffix in READERS},
    **{suffix: ulogs.read for suffix in ulogs.ENDS},
}
"""Reader of each end of a file's name."""


def open_source(path: Path, topics: tuple[str, ...] = (), received: bool = False) -> Source:
    """Read a log.

    Args:
        path: of a file, or of the folder of a ROS 2 bag.
        topics: only these, all if not given.
        received: of a bag, take the times of recording instead of the stamps in headers.

    Raises:
        ScenarioError: missing, of an unknown kind, or unreadable.
    """
    if bags.is_bag(path):
        return bags.read(path, topics, received)
    reader = KINDS.get(path.suffix.lower())
    if reader is None:
        what = "is a folder without metadata.yaml" if path.is_dir() else "is of no known kind"
        raise ScenarioError(
            f"{path}: {what}; logs are {', '.join((*KINDS, *bags.ENDS))} files and the folders of "
            "ROS 2 bags"
        )
    return reader(path, topics)
