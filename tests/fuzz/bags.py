"""Small good bags, from which the fuzzers start; none where the library that writes them lacks."""

from __future__ import annotations

import importlib.util
import json
import tempfile
from functools import lru_cache
from pathlib import Path

from cosim.intake.inspect import inspect

THERE = importlib.util.find_spec("rosbags") is not None


def inspected(path: Path) -> None:
    """Read a log as `cosim data inspect --json` does."""
    json.dumps(inspect(path).to_dict(), allow_nan=False)


@lru_cache(maxsize=None)
def bag(plugin: str) -> bytes:
    """The file in a ROS 2 bag."""
    from cosim.intake.example import drive, write_bag

    with tempfile.TemporaryDirectory() as folder:
        path = write_bag(drive(1, duration=1.0), Path(folder) / "bag", plugin)
        (file,) = [item for item in path.iterdir() if item.suffix in (".mcap", ".db3")]
        return file.read_bytes()


@lru_cache(maxsize=None)
def bag1() -> bytes:
    """A bag of ROS 1."""
    from rosbags import rosbag1
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    kind = store.types["geometry_msgs/msg/Point"]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.bag"
        with rosbag1.Writer(path) as writer:
            connection = writer.add_connection("/p", kind.__msgtype__, typestore=store)
            for i in range(30):
                message = kind(0.1 * i, 0.2, -i)
                content = store.serialize_ros1(message, kind.__msgtype__)
                writer.write(connection, 10**18 + 10**7 * i, content)
        return path.read_bytes()
