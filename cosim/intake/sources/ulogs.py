"""Logs of PX4 (`.ulg`), by the library `pyulog`: each message a topic on its own time stamps.

Units are those of PX4's message definitions (px4/msg, release 1.15) for the messages of `_UNITS`;
others are guessed by name. Attitudes `q[0..3]` (w, x, y, z) become roll, pitch and yaw.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...data.cells import integers
from ...data.logs import Log
from ...errors import InputError, ScenarioError, listing
from ...reading.limits import DATA
from ..topic import Source, Topic
from .messages import LONGEST, PARTS, beside_clock, turned

Vector = NDArray[np.float64]
ENDS = (".ulg", ".ulog")
_HEAD = 16
"""[bytes] Magic, version and time before the first message; each is its length in two bytes, its
kind in one, and as much content (ULog file format)."""
_UNITS = {
    "vehicle_local_position": {"x": "m", "y": "m", "z": "m", "vx": "m/s", "vy": "m/s", "vz": "m/s",
                               "ax": "m/s2", "ay": "m/s2", "az": "m/s2", "heading": "rad"},
    "vehicle_angular_velocity": {"xyz_1": "rad/s", "xyz_2": "rad/s", "xyz_3": "rad/s"},
    "vehicle_acceleration": {"xyz_1": "m/s2", "xyz_2": "m/s2", "xyz_3": "m/s2"},
    "sensor_combined": {f"{name}_{i}": unit for name, unit in
                        (("gyro_rad", "rad/s"), ("accelerometer_m_s2", "m/s2"))
                        for i in (1, 2, 3)},
    "wheel_encoders": {"wheel_speed_1": "rad/s", "wheel_speed_2": "rad/s",
                       "wheel_angle_1": "rad", "wheel_angle_2": "rad"},
    "battery_status": {"voltage_v": "V", "current_a": "A"},
}  # fmt: skip


def read(path: Path, topics: tuple[str, ...]) -> Source:
    """Read a log of PX4.

    Raises:
        InputError: the library is not installed.
        ScenarioError: it is missing, damaged, too large, or has no such topic.
    """
    if not path.is_file():
        raise ScenarioError(f"{path}: there is no such file")
    try:
        from pyulog import ULog
    except ImportError:
        raise InputError(
            f"{path}: logs of PX4 are read by the library pyulog, which is not installed; "
            "pip install pyulog"
        ) from None
    if excess := DATA.excess(4 * path.stat().st_size):
        raise ScenarioError(f"{path}: {excess}")
    try:
        with redirect_stdout(StringIO()):  # it prints what is said below
            log = ULog(str(path))
        parts = {_name(item): item for item in log.data_list}
        told = _damage(path, log)
    except Exception as error:  # of a parser that does not expect damaged files
        text = str(error).splitlines() or [type(error).__name__]
        raise ScenarioError(f"{path}: is no whole log of PX4 ({text[0][:200]})") from error
    for name in topics:
        if name not in parts:
            raise ScenarioError(f"{path}: --topic {name}: {listing(parts, name, limit=30)}")
    left = {name: "not asked for" for name in parts if topics and name not in topics}
    made = tuple(_topic(name, item, told) for name, item in parts.items() if name not in left)
    return Source(path, "ulog", made, plain=False, left=left)


def _name(item: Any) -> str:
    return f"{item.name}_{item.multi_id}" if item.multi_id else str(item.name)


def _damage(path: Path, log: Any) -> list[str]:
    """What the file lacks, which its messages do not show."""
    told = []
    if log.file_corruption:
        told.append("the file is damaged: messages that could not be read are left out")
    elif rest := _rest(path.read_bytes()):
        told.append(
            f"the file ends {rest} bytes into a message: it was cut, or its machine lost its power"
        )
    if log.dropouts:
        longest = max(item.duration for item in log.dropouts)
        told.append(
            f"the logger lost messages {len(log.dropouts)} times, for {longest:g} ms at the longest"
        )
    return told


def _rest(content: bytes) -> int:
    """Bytes of a message that the end of the file cuts, 0 if it ends with one."""
    at, size = _HEAD, len(content)
    while at < size:
        begin = at
        at += 3 + (content[at] | content[at + 1] << 8) if at + 3 <= size else 3
        if at > size:
            return size - begin
    return 0


def _topic(name: str, item: Any, told: Sequence[str]) -> Topic:
    clock, origin = integers(np.asarray(item.data["timestamp"]).tolist())
    columns: dict[str, Vector] = {}
    for field, values in item.data.items():
        stem, bracket, index = str(field).partition("[")
        if field == "timestamp" or (bracket and int(index.rstrip("]")) >= LONGEST):
            continue
        short = f"{stem}_{int(index.rstrip(']')) + 1}" if bracket else stem
        columns[short] = np.asarray(values, dtype=np.float64)
    units = dict(_UNITS.get(str(item.name), {}))
    if all(f"q_{i}" in columns for i in (1, 2, 3, 4)):
        for part, i in zip(PARTS, (2, 3, 4, 1), strict=True):
            columns[part] = columns.pop(f"q_{i}")
    columns, notes = turned(columns, units)
    columns, said = beside_clock(columns, units)
    log = Log(
        name, {"time": clock, **columns},
        units={"time": "us", **{n: u for n, u in units.items() if n in columns}},
        origins={"time": origin} if origin else {},
    )  # fmt: skip
    return Topic(
        name, "PX4 message", log, clock="time",
        notes=("times count from the start", *told, *notes, *said),
    )  # fmt: skip
