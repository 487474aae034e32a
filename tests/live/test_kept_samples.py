"""What is kept of a stream can be read again, however it came and ended."""

from __future__ import annotations

import json
import socket
import struct
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.machine import Machine
from cosim.calibrate import read_problem
from cosim.errors import UnknownNameError
from cosim.live.folder import Folder
from cosim.live.reading import Reading
from cosim.live.sources import Source
from cosim.live.watch import Settings, Watch
from tests.live.disc import commands, rig

COUNT = 300


@pytest.fixture(scope="module")
def reading(tmp_path_factory: pytest.TempPathFactory) -> Reading:
    return rig(tmp_path_factory.mktemp("rig") / "disc")


def samples(reading: Reading) -> list[dict[str, Any]]:
    machine = Machine(reading, commands(COUNT), {"angle_0": 0.25})
    return [json.loads(line) for block in machine.lines() for line in block]


def text(rows: list[dict[str, Any]]) -> bytes:
    return b"".join(json.dumps(row).encode() + b"\n" for row in rows)


def watch(reading: Reading, kept: Path, **how: Any) -> Watch:
    return Watch(reading, Settings(pace=0.0, **how), lambda event: None, Folder(kept, reading))


def test_a_column_that_begins_late_is_kept(reading: Reading, tmp_path: Path) -> None:
    rows = samples(reading)
    del rows[1]["phi"]
    (tmp_path / "log.jsonl").write_bytes(text(rows))
    watch(reading, tmp_path / "kept").follow(Source(str(tmp_path / "log.jsonl")))
    (run,) = read_problem(tmp_path / "kept").runs
    assert np.isnan(run.data).sum(axis=0).tolist() == [0, 1]


def test_entries_of_a_run_may_be_null(reading: Reading, tmp_path: Path) -> None:
    rows = samples(reading)
    rows[0]["run"] |= {"operator": None, "weights": [1.0, None], "worn": {"since": None, "by": 2}}
    (tmp_path / "log.jsonl").write_bytes(text(rows))
    watch(reading, tmp_path / "kept").follow(Source(str(tmp_path / "log.jsonl")))
    (run,) = read_problem(tmp_path / "kept").runs
    assert "operator" not in run.values
    assert run.values["worn"] == {"by": 2}


def test_a_client_that_breaks_off_is_followed_by_the_next(reading: Reading, tmp_path: Path) -> None:
    with socket.socket() as peer:
        peer.bind(("127.0.0.1", 0))
        port = int(peer.getsockname()[1])
    rows = samples(reading)
    follower = watch(reading, tmp_path / "kept", idle=5.0)
    source, served = Source(f"tcp://:{port}"), threading.Event()

    def send() -> None:
        with socket.create_connection(("127.0.0.1", port)) as peer:
            peer.sendall(text(rows[:200]))
            served.wait(5.0)
            peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        with socket.create_connection(("127.0.0.1", port)) as peer:
            peer.sendall(text([*rows[200:], {"end": True}]))

    thread = threading.Thread(target=send)
    thread.start()
    threading.Timer(0.5, served.set).start()  # what is sent has come by then
    assert follower.follow(source)["samples"] == COUNT
    thread.join()


def test_what_came_before_an_error_is_kept(reading: Reading, tmp_path: Path) -> None:
    wrong = [{"run": {"angle_0": 0.25}}, {"time": 0.0, "speed": 1.0}]
    (tmp_path / "log.jsonl").write_bytes(text([*samples(reading), *wrong]))
    with pytest.raises(UnknownNameError, match="no column 'torque'"):
        watch(reading, tmp_path / "kept").follow(Source(str(tmp_path / "log.jsonl")))
    (run,) = read_problem(tmp_path / "kept").runs
    assert len(run.times) == COUNT
    (tmp_path / "log.jsonl").write_bytes(text(wrong))
    with pytest.raises(UnknownNameError, match="no column 'torque'"):
        watch(reading, tmp_path / "nothing").follow(Source(str(tmp_path / "log.jsonl")))
    assert not list((tmp_path / "nothing").glob("*.toml"))
