"""Logs of PX4 and MATLAB files of version 7.3."""

from __future__ import annotations

import struct
import sys
from pathlib import Path

import numpy as np
import pytest

from cosim.data.logs import read_log
from cosim.errors import InputError, ScenarioError
from cosim.intake.inspect import inspect


def ulog(path: Path) -> Path:
    """A log of PX4, byte by byte (ULog file format, version 1)."""

    def block(kind: str, content: bytes) -> bytes:
        return struct.pack("<HB", len(content), ord(kind)) + content

    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    out += block("F", b"vehicle_attitude:uint64_t timestamp;float[4] q;")
    out += block("F", b"wheel_encoders:uint64_t timestamp;float[2] wheel_speed;float time;")
    out += block("A", struct.pack("<BH", 0, 0) + b"vehicle_attitude")
    out += block("A", struct.pack("<BH", 0, 1) + b"wheel_encoders")
    for i in range(200):
        half = 0.02 * i
        out += block("D", struct.pack("<HQ4f", 0, 10_000 * i, np.cos(half), 0, 0, np.sin(half)))
        out += block("D", struct.pack("<HQ3f", 1, 10_000 * i + 300, i, -i, 3 * i))
    path.write_bytes(out)
    return path


def test_px4(tmp_path: Path) -> None:
    pytest.importorskip("pyulog", reason="reads logs of PX4: pip install pyulog")
    report = inspect(ulog(tmp_path / "x.ulg"))
    topics = {t.topic.name: t for t in report.topics}
    attitude, wheels = topics["vehicle_attitude"], topics["wheel_encoders"]
    assert attitude.topic.log["yaw"] == pytest.approx(0.04 * np.arange(200), abs=1e-6)  # float32
    assert attitude.clock.interval == pytest.approx(0.01, rel=1e-9)
    assert wheels.topic.log["wheel_speed_2"] == pytest.approx(-np.arange(200.0), abs=0.0)
    assert wheels.topic.log.units["wheel_speed_1"] == "rad/s"
    assert wheels.clock.interval == pytest.approx(0.01, rel=1e-9)  # not the field of that name
    assert wheels.topic.log["time_field"] == pytest.approx(3.0 * np.arange(200), abs=0.0)
    with pytest.raises(ScenarioError, match="--topic wheels: "):
        inspect(tmp_path / "x.ulg", ["wheels"])
    (tmp_path / "y.ulg").write_bytes(b"ULog")
    with pytest.raises(ScenarioError, match=r"y\.ulg: is no whole log of PX4"):
        inspect(tmp_path / "y.ulg")


def test_a_log_of_px4_that_was_cut_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pyulog", reason="reads logs of PX4: pip install pyulog")
    whole = ulog(tmp_path / "x.ulg").read_bytes()

    def notes(content: bytes) -> list[str]:
        (tmp_path / "y.ulg").write_bytes(content)
        topic = inspect(tmp_path / "y.ulg").topics[0]
        return [f.text for f in topic.findings if f.kind == "reading"]

    assert notes(whole) == ["times count from the start"]
    assert "the file ends 20 bytes into a message: it was cut" in notes(whole[:-5])[1]
    assert "the file ends 2 bytes into a message" in notes(whole[:-23])[1]
    assert len(notes(whole[:-25])) == 1
    lost = struct.pack("<HBH", 2, ord("O"), 250)
    assert "the logger lost messages 1 times, for 250 ms" in notes(whole + lost)[1]
    spoilt = bytearray(whole)
    spoilt[-25:] = struct.pack("<HBH", 22, ord("D"), 777) + bytes(20)
    assert "the file is damaged" in notes(bytes(spoilt))[1]
    assert capsys.readouterr().out == ""


def test_px4_without_its_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyulog", None)
    with pytest.raises(InputError, match="not installed; pip install pyulog"):
        inspect(ulog(tmp_path / "x.ulg"))


def matlab73(path: Path) -> Path:
    """A file as MATLAB writes it: its head in a block of 512 bytes, matrices turned over."""
    h5py = pytest.importorskip("h5py", reason="writes what is to be read")

    def put(group: object, name: str, values: np.ndarray, kind: bytes = b"double") -> None:
        stored = group.create_dataset(name, data=np.atleast_2d(values.T), compression="gzip")  # type: ignore[attr-defined]
        stored.attrs["MATLAB_class"] = np.bytes_(kind)

    time = np.linspace(0.0, 10.0, 1001)
    with h5py.File(path, "w", userblock_size=512) as file:
        put(file, "t", time)
        put(file.create_group("motor"), "speed_rpm", 100 * np.sin(time))
        put(file, "q", np.stack([time, time**2], axis=1))
        put(file, "title", np.array([104, 105], dtype="u2"), b"char")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return path


def test_matlab_7_3(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pyfive", reason="reads MATLAB 7.3: pip install pyfive")
    path = matlab73(tmp_path / "x.mat")
    log = read_log(path)
    time = np.linspace(0.0, 10.0, 1001)
    assert set(log.columns) == {"t", "motor.speed_rpm", "q_1", "q_2"}
    assert np.array_equal(log["motor.speed_rpm"], 100 * np.sin(time))
    assert np.array_equal(log["q_2"], time**2)
    content = path.read_bytes()
    for damaged in (content[:700], content[:2000] + bytes(len(content) - 2000)):
        path.write_bytes(damaged)
        with pytest.raises(ScenarioError, match=r"x\.mat: is no whole MATLAB file of version 7\.3"):
            read_log(path)
    path.write_bytes(content)
    monkeypatch.setenv("COSIM_MAX_DATA", "15000")
    with pytest.raises(ScenarioError, match="COSIM_MAX_DATA"):
        read_log(path)


def test_matlab_7_3_without_its_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyfive", None)
    path = tmp_path / "x.mat"
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF\r\n\x1a\n")
    with pytest.raises(InputError, match="pip install pyfive, or save it with -v7"):
        read_log(path)
