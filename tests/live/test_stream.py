"""A twin beside a stream: same residual as in logs, stated false alarms, nothing lost unsaid."""

from __future__ import annotations

import json
import random
import shutil
import socket
import subprocess
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.machine import Machine
from cosim.calibrate import Simulator, read_problem
from cosim.errors import InputError, ScenarioError, UnknownNameError
from cosim.live.alarm import FIRST, Alarms
from cosim.live.folder import Folder
from cosim.live.lateness import Lateness
from cosim.live.messages import read_message
from cosim.live.reading import Reading, read_reading
from cosim.live.sources import Source
from cosim.live.watch import Settings, Watch
from tests.live.disc import INTERVAL, commands, rig

BROKER = shutil.which("mosquitto") or shutil.which("/usr/sbin/mosquitto")
ENTRIES = {"angle_0": 0.25}
EFFECT: dict[str, Any] = {
    "variant": {"load": "+coulomb"},
    "values": {"load.coulomb.tau_c": 0.0},
}


@pytest.fixture(scope="module")
def reading(tmp_path_factory: pytest.TempPathFactory) -> Reading:
    return rig(tmp_path_factory.mktemp("rig") / "disc")


def lines(reading: Reading, count: int, seed: int = 0, **how: Any) -> list[bytes]:
    machine = Machine(reading, commands(count), ENTRIES, seed=seed, **how)
    return [line for block in machine.lines() for line in block]


class Followed:
    """A watch that has gone through lines as fast as possible, and what it said."""

    def __init__(self, reading: Reading, given: list[bytes], folder: Folder | None = None,
                 **settings: Any) -> None:  # fmt: skip
        self.events: list[dict[str, Any]] = []
        watch = Watch(reading, Settings(pace=0.0, **settings), self.events.append, folder)
        for first in range(0, len(given), 500):
            if not watch.take([(0.0, line) for line in given[first : first + 500]]):
                break
        watch.finish()
        self.summary = watch.summary()

    def of(self, kind: str) -> list[dict[str, Any]]:
        return [event for event in self.events if event.get("event") == kind]

    @property
    def reports(self) -> list[dict[str, Any]]:
        return [event for event in self.events if "residual" in event]


# -- residuals -------------------------------------------------------------------------------------


def test_the_residual_of_a_stream_is_that_of_its_log(reading, tmp_path: Path) -> None:
    folder = Folder(tmp_path / "kept", reading)
    given = [*lines(reading, 700, seed=3), *lines(reading, 500, seed=4, clock=100.0)]
    followed = Followed(reading, given, folder, report=1e9)
    problem = read_problem(tmp_path / "kept")
    assert [run.purpose for run in problem.runs] == ["identification", "validation"]
    assert [len(run.times) for run in problem.runs] == [700, 500]
    found = dict(Simulator(problem, workers=1).residuals(problem.nominal, None))
    for report, (_, rows) in zip(followed.reports, found.items(), strict=True):
        for column, channel in enumerate(problem.channels):
            told = report["residual"][channel.name]
            last = rows[: report["samples"], column]
            # printed to 4 digits
            assert told["rms"] == pytest.approx(np.sqrt(np.mean(last**2)), rel=1e-3)
            assert told["mean"] == pytest.approx(np.mean(last), rel=1e-3, abs=1e-9)


def test_a_stream_is_not_written_over_a_data_set(reading, tmp_path: Path) -> None:
    place = tmp_path / "kept"
    Followed(reading, lines(reading, 200, seed=3), Folder(place, reading), report=1e9)
    before = {path: path.read_bytes() for path in place.rglob("*") if path.is_file()}
    with pytest.raises(InputError, match="already, which the stream would be written over"):
        Folder(place, reading)
    with pytest.raises(InputError, match=r"dataset\.toml already"):
        Folder(reading.joined.data.folder, reading)  # the one that is followed
    assert {path: path.read_bytes() for path in place.rglob("*") if path.is_file()} == before


def test_five_clean_minutes_are_noise_and_raise_no_alarm(reading) -> None:
    followed = Followed(reading, lines(reading, 30000))
    assert followed.of("alarm") == []
    # 4 sigma of a root mean square over 30000 values
    for value in followed.summary["residual_rms"].values():
        assert value == pytest.approx(1.0, abs=4.0 / np.sqrt(2 * 30000))


def test_an_effect_switched_on_raises_an_alarm_soon_and_none_before(reading) -> None:
    given = lines(reading, 12000, change={60.0: {"load.coulomb.tau_c": 0.005}}, **EFFECT)
    alarms = Followed(reading, given).of("alarm")
    assert min(alarm["t"] for alarm in alarms) > 60.0
    # the angle is off by 60 sigma after 5 s of it: 0.005 N.m of 0.4 N.m
    assert min(alarm["t"] for alarm in alarms) < 65.0


def test_the_same_effect_at_strength_zero_raises_none(reading) -> None:
    assert Followed(reading, lines(reading, 12000, **EFFECT)).of("alarm") == []


def test_alarms_wait_until_a_run_has_settled(reading) -> None:
    given = lines(reading, 1000, change={0.0: {"load.coulomb.tau_c": 0.3}}, **EFFECT)
    alarms = Followed(reading, given, settle=5.0).of("alarm")
    assert alarms
    assert min(alarm["t"] for alarm in alarms) >= 5.0


# -- alarms ----------------------------------------------------------------------------------------


def test_false_alarms_come_as_often_as_stated() -> None:
    alarms = Alarms(["a", "b"], 0.1, rate=20.0)
    noise = np.random.default_rng(5)
    hours, found = 50, 0
    for hour in range(hours):
        rows = noise.standard_normal((36000, 2))
        found += len(alarms.take(3600.0 * hour + 0.1 * np.arange(36000), rows))
    # 1000 expected; an extreme window often is one in the next length, too: 4 sigma of pairs
    assert abs(found - 20.0 * hours) < 4.0 * np.sqrt(2.0 * 20.0 * hours)
    assert sum(
        threshold * 2 * 2 * 3600 / (0.1 * n)
        for threshold, n in zip(alarms.thresholds, alarms.lengths, strict=True)
    ) == pytest.approx(20.0)


@pytest.mark.parametrize(("shift", "longest"), [(3.0, 2 * FIRST), (0.3, 4096)])
def test_strong_shifts_are_found_at_once_and_weak_ones_later(shift, longest) -> None:
    alarms = Alarms(["a"], 1.0, rate=0.01)
    rows = np.random.default_rng(6).standard_normal((8192, 1)) + shift
    first = alarms.take(np.arange(8192.0), rows)[0]
    assert first.kind == "mean"
    assert first.t <= longest


@pytest.mark.parametrize("kind", ["mean", "energy"])
def test_what_the_margin_allows_raises_no_alarm_and_what_is_beyond_does(kind) -> None:
    noise = np.random.default_rng(8).standard_normal((65536, 1))
    signs = 1.0 if kind == "mean" else np.resize([1.0, -1.0], (65536, 1))
    for off, expected in ((0.3, False), (0.6, True)):
        alarms = Alarms(["a"], 1.0, rate=0.01, margin=0.3)
        found = alarms.take(np.arange(65536.0), noise + off * signs)
        assert bool(found) is expected
        assert (kind in {alarm.kind for alarm in found}) is expected


def test_a_gap_is_no_number_in_an_alarm() -> None:
    whole, gaps = Alarms(["a"], 1.0, rate=1.0), Alarms(["a"], 1.0, rate=1.0)
    rows = np.random.default_rng(7).standard_normal((4096, 1))
    rows[::3] = np.nan
    assert gaps.take(np.arange(4096.0), rows) == []
    assert gaps.take(np.arange(4096.0), np.full((4096, 1), np.nan)) == []
    assert whole.take(np.arange(4096.0), np.nan_to_num(rows, nan=9.0)) != []


# -- order -----------------------------------------------------------------------------------------


def test_late_doubled_and_missing_samples_are_counted(reading) -> None:
    given = lines(reading, 1000)
    given.insert(500, given[300])  # doubled
    late = given.pop(200)
    given.insert(260, late)  # later than 0.1 s
    del given[700:702]  # missing
    given.insert(50, b"{nonsense")
    summary = Followed(reading, given, wait=0.1).summary
    assert {key: summary[key] for key in ("late", "doubled", "missing", "unreadable")} == {
        "late": 1, "doubled": 1, "missing": 3, "unreadable": 1,
    }  # fmt: skip
    assert summary["samples"] == 997


@pytest.mark.parametrize(
    ("line", "why"),
    [
        (b"{nonsense", "is no JSON"),
        (b"[1]", "is no JSON object"),
        (b'{"torque": 1}', "has no 'time', the clock"),
        (b'{"time": "now"}', "time is 'now', no number"),
        (b'{"time": NaN}', "time is nan"),
        (b'{"time": 1, "w": {}}', "w is {}, no number"),
        (b'{"time": 1, "n": 1.5}', "n is 1.5, no whole number"),
        (b'{"time": 1, "w": 1' + 400 * b"0" + b"}", "w is too large"),
        (b"[" * 100000, "is no JSON"),
        (b'{"time": 1, "w": "\xff"}', "is no JSON|no number"),
    ],
)
def test_a_line_that_is_no_message_says_why(line, why) -> None:
    with pytest.raises(ValueError, match=why):
        read_message(line)


def test_messages_carry_gaps_lists_and_numbers() -> None:
    sample = read_message(b'{"n": 7, "t": 0.5, "q": [0.1, null], "on": true}', "t")
    assert (sample.time, sample.number) == (0.5, 7)
    assert sample.values["q_1"] == 0.1
    assert np.isnan(sample.values["q_2"])
    assert sample.values["on"] == 1.0


def test_samples_out_of_order_within_the_wait_change_nothing(reading) -> None:
    given = lines(reading, 1000)
    shuffled, order = given[:1], random.Random(1)
    for first in range(1, len(given), 5):
        part = given[first : first + 5]
        order.shuffle(part)
        shuffled += part
    plain, mixed = Followed(reading, given), Followed(reading, shuffled, wait=0.1)
    assert mixed.summary["residual_rms"] == plain.summary["residual_rms"]
    assert mixed.summary["late"] == 0


def test_without_wait_the_same_disorder_loses_samples(reading) -> None:
    given = lines(reading, 100)
    given[50], given[52] = given[52], given[50]
    assert Followed(reading, given).summary["late"] == 2


@pytest.mark.parametrize("clock", [0.0, -100.0])
def test_reports_come_as_often_where_a_clock_begins_before_0(reading, clock: float) -> None:
    reports = Followed(reading, lines(reading, 2000, clock=clock), report=1.0).reports
    assert len(reports) == len(Followed(reading, lines(reading, 2000), report=1.0).reports) > 2


def test_missing_samples_are_counted_by_their_numbers(reading) -> None:
    given = []
    for number, line in enumerate(lines(reading, 300)):
        given.append(json.dumps({"n": number, **json.loads(line)}).encode() if number else line)
    del given[100:103]
    assert Followed(reading, given).summary["missing"] == 3


def test_a_long_gap_ends_a_run_and_the_next_needs_its_begin(reading) -> None:
    given = lines(reading, 1000)
    del given[400:420]
    followed = Followed(reading, given)
    (gap,) = followed.of("gap")
    assert gap["length_s"] == pytest.approx(21 * INTERVAL)
    assert "angle_0" in followed.of("waiting")[0]["why"]
    assert followed.summary["ignored"] == 1000 - 420 + 1
    again = [*given[:400], given[0], *given[400:]]
    assert len(Followed(reading, again).of("run")) == 2


def test_a_run_that_starts_from_its_first_sample_needs_no_begin(tmp_path: Path) -> None:
    rig(tmp_path / "disc")
    path = tmp_path / "disc" / "dataset.toml"
    first = """
[[nuisance]]
name = "angle_0"
unit = "rad"
nominal = "first:phi"
span = 0.1
per_run = true
targets = "load.angle"
[[nuisance]]
name = "speed_0"
unit = "rad/s"
nominal = 0.0
span = 0.1
per_run = true
targets = "load.speed"
"""
    stated = '[starts]\nangle_0 = "load.angle"\n'
    assert stated in path.read_text()
    path.write_text(path.read_text().replace(stated, "") + first)
    reading = read_reading(tmp_path / "disc")
    given = [json.dumps({"time": 0.01 * k, "torque": 0.0, "w": 0.0, "phi": 0.7}).encode()
             for k in range(50)]  # fmt: skip
    followed = Followed(reading, given)
    (begun,) = followed.of("run")
    assert begun["starts"] == {"load.angle": 0.7, "load.speed": 0.0}
    assert followed.summary["residual_rms"]["phi"] == 0.0


def test_a_column_that_never_comes_is_no_perfect_channel(reading) -> None:
    given = [
        json.dumps({k: v for k, v in json.loads(line).items() if k != "phi"}).encode()
        for line in lines(reading, 100)
    ]
    summary = Followed(reading, given).summary
    assert summary["not_compared"] == ["phi"] and summary["residual_rms"]["phi"] is None
    assert summary["residual_rms"]["w"] is not None
    assert Followed(reading, lines(reading, 100)).summary["not_compared"] == []


def test_a_stream_without_the_begin_of_a_run_says_what_it_needs(reading) -> None:
    followed = Followed(reading, lines(reading, 100)[1:])
    assert followed.summary["ignored"] == 100
    assert followed.of("run") == []


# -- addresses -------------------------------------------------------------------------------------


def follow(reading: Reading, address: str, send: Any, **settings: Any) -> dict[str, Any]:
    """Follow an address that a thread sends to."""
    source = Source(address)
    thread = threading.Thread(target=send)
    thread.start()
    events: list[dict[str, Any]] = []
    summary = Watch(reading, Settings(idle=5.0, **settings), events.append).follow(source)
    thread.join()
    return summary


def free_port(kind: int) -> int:
    with socket.socket(socket.AF_INET, kind) as peer:
        peer.bind(("127.0.0.1", 0))
        return int(peer.getsockname()[1])


def check(summary: dict[str, Any], count: int) -> None:
    assert summary["samples"] == count
    assert summary["missing"] == summary["late"] == summary["doubled"] == 0
    assert summary["lateness_s"]["max"] < 5.0
    for value in summary["residual_rms"].values():
        assert value == pytest.approx(1.0, abs=4.0 / np.sqrt(2 * count))  # 4 sigma


def test_a_tcp_client_sends_to_us(reading) -> None:
    port = free_port(socket.SOCK_STREAM)

    def send() -> None:
        with socket.create_connection(("127.0.0.1", port)) as peer:
            content = b"\n".join([*lines(reading, 300), b'{"end": true}']) + b"\n"
            for first in range(0, len(content), 777):  # lines are cut anywhere
                peer.sendall(content[first : first + 777])

    check(follow(reading, f"tcp://:{port}", send), 300)


def test_we_take_from_a_tcp_server_until_it_closes(reading) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def send() -> None:
            with server.accept()[0] as peer:
                peer.sendall(b"\n".join(lines(reading, 300)))

        port = server.getsockname()[1]
        check(follow(reading, f"tcp://127.0.0.1:{port}", send), 300)


def test_datagrams(reading) -> None:
    port = free_port(socket.SOCK_DGRAM)

    def send() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
            for line in [*lines(reading, 300), b'{"end": true}']:
                peer.sendto(line, ("127.0.0.1", port))
                time.sleep(1e-4)

    check(follow(reading, f"udp://127.0.0.1:{port}", send, wait=0.05), 300)


@pytest.mark.slow
@pytest.mark.skipif(BROKER is None, reason="no mosquitto on this machine")
def test_a_broker(reading, tmp_path: Path) -> None:
    mqtt = pytest.importorskip("paho.mqtt.client")
    port = free_port(socket.SOCK_STREAM)
    (tmp_path / "broker.conf").write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\n")
    broker = subprocess.Popen(
        [str(BROKER), "-c", str(tmp_path / "broker.conf")], stderr=subprocess.DEVNULL
    )
    try:
        for _ in range(100):
            try:
                socket.create_connection(("127.0.0.1", port)).close()
                break
            except OSError:
                time.sleep(0.05)

        def send() -> None:
            time.sleep(0.5)  # the subscription is sent in a thread of its own
            client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
            client.connect("127.0.0.1", port)
            client.loop_start()
            for line in [*lines(reading, 300), b'{"end": true}']:
                client.publish("rig/disc", line, qos=1).wait_for_publish(5.0)
            client.disconnect()
            client.loop_stop()

        check(follow(reading, f"mqtt://127.0.0.1:{port}/rig/%23", send), 300)
    finally:
        broker.terminate()
        broker.wait()


def test_a_recorded_stream_is_played_at_its_pace(reading, tmp_path: Path) -> None:
    (tmp_path / "log.jsonl").write_bytes(b"\n".join(lines(reading, 200)))
    begun = time.monotonic()
    source = Source(str(tmp_path / "log.jsonl"))
    summary = Watch(reading, Settings(pace=4.0), lambda event: None).follow(source)
    assert time.monotonic() - begun >= 199 * INTERVAL / 4.0
    check(summary, 200)


def test_a_stream_may_end_after_a_time(reading, tmp_path: Path) -> None:
    (tmp_path / "log.jsonl").write_bytes(b"\n".join(lines(reading, 200)))
    source = Source(str(tmp_path / "log.jsonl"))
    summary = Watch(reading, Settings(pace=0.0, duration=1.0), lambda event: None).follow(source)
    assert summary["samples"] == 101


def test_quantiles_of_lateness_are_those_of_the_durations() -> None:
    values = np.random.default_rng(2).lognormal(-6.0, 1.0, 20000)
    lateness = Lateness()
    for value in values.tolist():
        lateness.add(value)
    for part in (0.5, 0.99):
        # a bin is 2.3 % wide
        assert lateness.quantile(part) == pytest.approx(np.quantile(values, part), rel=0.025)


# -- mistakes --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("address", "text"),
    [
        ("http://x/y", "'mqtt' as kind of address|tcp, udp, mqtt"),
        ("tcp://127.0.0.1", "has no port"),
        ("mqtt://127.0.0.1", "lacks a host or a topic|needs paho-mqtt"),
        ("nothing.jsonl", "there is no such file"),
        ("tcp://127.0.0.1:9", "refused"),
    ],
)
def test_a_wrong_address_is_refused(address, text) -> None:
    with pytest.raises(InputError, match=text):
        Source(address)


def test_a_stream_without_what_drives_the_model_is_refused(reading) -> None:
    given = [line.replace(b"torque", b"torqe") for line in lines(reading, 50)]
    with pytest.raises(UnknownNameError, match=r"'torque', which drives load\.tau.*'torqe'"):
        Followed(reading, given)


def test_a_mapping_that_looks_ahead_is_refused(reading, tmp_path: Path) -> None:
    rig(tmp_path / "disc")
    path = tmp_path / "disc" / "dataset.toml"
    path.write_text(path.read_text() + "[columns]\nw = { lowpass = 10.0 }\n")
    with pytest.raises(ScenarioError, match="column w has lowpass, which a stream cannot follow"):
        read_reading(tmp_path / "disc")


def test_a_scenario_is_followed_by_the_set_that_it_is_compared_with() -> None:
    """Of the two that lie in its `data`."""
    assert read_reading("motor_bench").problem.name == "MB-12"


def test_an_unknown_set_is_refused_with_near_names() -> None:
    with pytest.raises(UnknownNameError, match="'motor_bench'"):
        read_reading("motor_bensch")


def test_wrong_settings_are_refused() -> None:
    with pytest.raises(InputError, match="rate of a stream is 0"):
        Settings(rate=0.0)
    with pytest.raises(InputError, match="pace of a stream is -1"):
        Settings(pace=-1.0)
