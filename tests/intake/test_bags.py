"""Bags of ROS 1 and 2 as topics: standard messages, units, angles, stamps; and imported."""

from __future__ import annotations

import sqlite3
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim.calibrate import read_problem
from cosim.errors import InputError, ScenarioError
from cosim.installation.builder import default_provider
from cosim.intake.example import RADIUS, SYSTEM, TRACK, drive, stamp, write_csv
from cosim.intake.importing import Wishes, import_logs
from cosim.intake.inspect import inspect
from cosim.intake.topic import Topic

pytest.importorskip("rosbags", reason="reads and writes bags: pip install rosbags")
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
ONE = get_typestore(Stores.ROS1_NOETIC)
T = STORE.types
Vector3, Point, Quaternion = (
    T[f"geometry_msgs/msg/{name}"] for name in ("Vector3", "Point", "Quaternion")
)
Message = tuple[int, str, Any]
"""Time of recording [ns], topic, message."""


def header(time: int, frame: str = "map") -> Any:
    return T["std_msgs/msg/Header"](
        T["builtin_interfaces/msg/Time"](time // 10**9, time % 10**9), frame
    )


def turned(yaw: float) -> Any:
    return Quaternion(0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2))


def pose(x: float, y: float, yaw: float) -> Any:
    return T["geometry_msgs/msg/Pose"](Point(x, y, 0.0), turned(yaw))


def twist(v: float, w: float) -> Any:
    return T["geometry_msgs/msg/Twist"](Vector3(v, 0.0, 0.0), Vector3(0.0, 0.0, w))


def accel(a: float, b: float) -> Any:
    return T["geometry_msgs/msg/Accel"](Vector3(a, 0.0, 0.0), Vector3(0.0, 0.0, b))


def write(path: Path, sent: list[Message], plugin: str = "MCAP") -> Path:
    with rosbag2.Writer(
        path, version=9, storage_plugin=rosbag2.StoragePlugin[plugin]
    ) as writer:  # fmt: skip
        known: dict[str, Any] = {}
        for time, topic, message in sorted(sent, key=lambda item: item[0]):
            kind = message.__msgtype__
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(known[topic], time, STORE.serialize_cdr(message, kind))
    return path


def topics(path: Path, *wanted: str) -> dict[str, Topic]:
    return {t.topic.name: t.topic for t in inspect(path, wanted).topics}


TIMES = [stamp(0.02 * i) for i in range(60)]
YAW = np.linspace(2.0, 5.0, 60)
"""Passes half a turn."""


def test_a_field_called_time_is_a_column_beside_the_clock(tmp_path: Path) -> None:
    """Seconds since the controller began, in messages with headers and without, and as a time."""
    from rosbags.typesys import get_types_from_msg

    text = "float64 time\nfloat64 speed\n"
    STORE.register(get_types_from_msg(text, "own/msg/Plain"))
    text = f"std_msgs/Header header\nbuiltin_interfaces/Time {text.partition(' ')[2]}"
    STORE.register(get_types_from_msg(text, "own/msg/Stamped"))
    sent: list[Message] = []
    for i, time in enumerate(TIMES):
        moment = T["builtin_interfaces/msg/Time"](12 + i, 0)
        sent.append((time, "/plain", T["own/msg/Plain"](12.0 + i, 1.0)))
        sent.append((time + 1, "/stamped", T["own/msg/Stamped"](header(time), moment, 2.0)))
    found = inspect(write(tmp_path / "bag", sent)).topics
    for report in found:
        assert report.clock.interval == pytest.approx(0.02, rel=1e-9)  # whole nanoseconds
        assert report.clock.began().startswith("2025-11-25")
        # nanoseconds times 1e-9: rounding
        assert report.topic.log["time_field"] == pytest.approx(12.0 + np.arange(60.0), abs=1e-12)
        assert any("the field time" in note for note in report.topic.notes)
    units = {report.topic.name: report.topic.log.units for report in found}
    assert units["/stamped"]["time_field"] == "s" and "time_field" not in units["/plain"]


def test_standard_messages_are_columns_with_units(tmp_path: Path) -> None:
    sent: list[Message] = []
    for i, (time, yaw) in enumerate(zip(TIMES, YAW.tolist(), strict=True)):
        sent += [
            (time, "/pose", T["geometry_msgs/msg/PoseStamped"](header(time), pose(i, -i, yaw))),
            (time, "/odom", T["nav_msgs/msg/Odometry"](
                header(time, "odom"), "base_link",
                T["geometry_msgs/msg/PoseWithCovariance"](pose(1.0, 2.0, yaw), np.zeros(36)),
                T["geometry_msgs/msg/TwistWithCovariance"](twist(0.5, 0.1 * i), np.zeros(36)),
            )),
            (time, "/imu", T["sensor_msgs/msg/Imu"](
                header(time, "imu"), turned(yaw), np.zeros(9), Vector3(0.0, 0.0, 0.3),
                np.zeros(9), Vector3(0.0, 0.0, 9.81), np.zeros(9),
            )),
            (time, "/accel", T["geometry_msgs/msg/AccelStamped"](header(time), accel(0.5, i))),
            (time, "/plain_accel", accel(0.5, i)),
            (time, "/joints", T["sensor_msgs/msg/JointState"](
                header(time), ["left", "arm"], np.array([0.1 * i, 2.0]), np.array([5.0, 0.0]),
                np.zeros(0),
            )),
            (time, "/tf", T["tf2_msgs/msg/TFMessage"]([
                T["geometry_msgs/msg/TransformStamped"](
                    header(time, parent), child,
                    T["geometry_msgs/msg/Transform"](Vector3(i, 0.0, 0.0), turned(yaw)),
                )
                for parent, child in (("map", "odom"), ("odom", "base"))
            ])),
            (time, "/list", T["std_msgs/msg/Float64MultiArray"](
                T["std_msgs/msg/MultiArrayLayout"]([], 0), np.array([i, 2.0 * i])
            )),
        ]  # fmt: skip
    found = topics(write(tmp_path / "bag", sent))
    units = {
        name: {c: u for c, u in t.log.units.items() if c != "time"} for name, t in found.items()
    }
    angles = {"roll": "rad", "pitch": "rad", "yaw": "rad"}
    place = {"x": "m", "y": "m", "z": "m", **angles}
    assert units["/pose"] == place
    assert units["/odom"] == {
        **place, **{f"linear_{a}": "m/s" for a in "xyz"},
        **{f"angular_{a}": "rad/s" for a in "xyz"},
    }  # fmt: skip
    assert units["/imu"] == {
        **angles, **{f"angular_velocity_{a}": "rad/s" for a in "xyz"},
        **{f"linear_acceleration_{a}": "m/s2" for a in "xyz"},
    }  # fmt: skip
    assert units["/accel"] == units["/plain_accel"] == {
        **{f"linear_{a}": "m/s2" for a in "xyz"}, **{f"angular_{a}": "rad/s2" for a in "xyz"},
    }  # fmt: skip
    assert units["/joints"] == {
        "position.left": "rad", "position.arm": "rad", "velocity.left": "rad/s",
        "velocity.arm": "rad/s",
    }  # fmt: skip
    assert found["/list"].log["data_2"] == pytest.approx(2.0 * np.arange(60.0), abs=0.0)
    assert units["/tf map -> odom"] == units["/tf odom -> base"] == place
    assert found["/odom"].frames == "odom -> base_link" and found["/pose"].frames == "map"
    for name in ("/pose", "/odom", "/tf map -> odom"):
        # half angles in doubles and back
        assert found[name].log["yaw"] == pytest.approx(YAW, abs=1e-12)
    assert found["/odom"].log["angular_z"] == pytest.approx(0.1 * np.arange(60), abs=1e-12)


def test_angles_about_all_axes_follow_fixed_axes(tmp_path: Path) -> None:
    from scipy.spatial.transform import Rotation

    angles = np.random.default_rng(1).uniform(-1.4, 1.4, (60, 3))
    parts = Rotation.from_euler("xyz", angles).as_quat()
    kind = T["geometry_msgs/msg/QuaternionStamped"]
    sent = [
        (t, "/q", kind(header(t), Quaternion(*q)))
        for t, q in zip(TIMES, parts.tolist(), strict=True)
    ]
    log = topics(write(tmp_path / "bag", sent))["/q"].log
    for index, name in enumerate(("roll", "pitch", "yaw")):
        assert log[name] == pytest.approx(angles[:, index], abs=1e-9)  # arcsin near 1.4


def test_header_stamps_count_and_without_them_the_times_of_recording(tmp_path: Path) -> None:
    kind = T["geometry_msgs/msg/TwistStamped"]
    sent: list[Message] = []
    for time in TIMES:
        sent += [
            (time + 30_000_000, "/stamped", kind(header(time), twist(1.0, 0.0))),
            (time + 30_000_000, "/unset", kind(header(0), twist(1.0, 0.0))),
            (time + 30_000_000, "/plain", twist(1.0, 0.0)),
        ]
    reports = {t.topic.name: t for t in inspect(write(tmp_path / "bag", sent)).topics}
    begins = {name: round((r.clock.begin or 0.0) - 1_764_040_000, 6) for name, r in reports.items()}
    assert begins == {"/stamped": 0.0, "/unset": 0.03, "/plain": 0.03}
    notes = {name: r.topic.notes[0] for name, r in reports.items()}
    assert "headers; messages were recorded 0.03 s after" in notes["/stamped"]
    assert "has headers without a time" in notes["/unset"]
    assert "has no header" in notes["/plain"]


def test_times_of_recording_can_be_wished(tmp_path: Path) -> None:
    kind = T["geometry_msgs/msg/TwistStamped"]
    path = write(tmp_path / "bag", [(t + 10**9, "/a", kind(header(t), twist(1, 0))) for t in TIMES])
    for received, begin in ((False, 0.0), (True, 1.0)):
        clock = inspect(path, received=received).topics[0].clock
        assert (clock.begin or 0.0) - 1_764_040_000 == pytest.approx(begin, abs=1e-6)


def test_simulated_time_beside_times_of_recording_is_refused(tmp_path: Path) -> None:
    """It begins at 0, and commands without a header have none."""
    kind = T["geometry_msgs/msg/PoseStamped"]
    sent: list[Message] = [(t, "/cmd_vel", twist(0.1 * (i % 7), 0.1 * (i % 5)))
                           for i, t in enumerate(TIMES)]  # fmt: skip
    sent += [(t, "/pose", kind(header(t - TIMES[0]), pose(0.1 * i, 0.1, 0.01 * i)))
             for i, t in enumerate(TIMES)]  # fmt: skip
    bag = write(tmp_path / "bag", sent)
    assert inspect(bag, ["/pose"]).topics[0].clock.begin is None
    wishes = Wishes("mrclam_create")
    with pytest.raises(InputError, match=r"cmd_vel counts from 1970 and that of pose does .*--rec"):
        import_logs({"a": [bag]}, {"a": "identification"}, wishes, tmp_path / "set",
                    default_provider())  # fmt: skip


def test_joints_may_come_and_go_and_topics_be_short(tmp_path: Path) -> None:
    kind = T["sensor_msgs/msg/JointState"]
    sent: list[Message] = [(TIMES[0], "/once", twist(1.0, 0.0))]
    for i, time in enumerate(TIMES):
        names = ["a", "b"] if i % 2 else ["b"]
        state = kind(header(time), names, np.full(len(names), float(i)), np.zeros(0), np.zeros(0))
        sent.append((time, "/joints", state))
    found = {t.topic.name: t for t in inspect(write(tmp_path / "bag", sent)).topics}
    log = found["/joints"].topic.log
    assert np.array_equal(np.isnan(log["position.a"]), np.arange(60) % 2 == 0)
    assert np.array_equal(log["position.b"], np.arange(60.0))
    assert found["/once"].clock.interval == 0.0


def test_what_comes_twice_or_out_of_order_is_put_right_and_said(tmp_path: Path) -> None:
    kind = T["geometry_msgs/msg/PoseStamped"]
    times = [*TIMES[:20], TIMES[19], TIMES[21], TIMES[20], *TIMES[22:]]
    sent = [(TIMES[0] + 10**7 * i, "/pose", kind(header(t), pose(t - TIMES[0], 0.0, 0.0)))
            for i, t in enumerate(times)]  # fmt: skip
    report = inspect(write(tmp_path / "bag", sent)).topics[0]
    assert np.diff(report.topic.log["time"]) == pytest.approx(2e7, abs=0.0)
    assert report.topic.log["x"] == pytest.approx(np.array(TIMES) - TIMES[0], abs=0.0)
    assert "1 messages with a stamp that was there already are left out" in report.topic.notes[-1]
    assert "1 out of order" in report.topic.notes[-1]


def test_vectors_in_fields_that_only_wrap_keep_what_tells_them_apart(tmp_path: Path) -> None:
    from rosbags.typesys import get_types_from_msg

    vector = "geometry_msgs/Vector3"
    text = f"{vector} position\n{vector} orientation\ngeometry_msgs/Twist twist\n"
    STORE.register(get_types_from_msg(text + "geometry_msgs/Accel accel\n", "own/msg/State"))
    sent = [
        (t, "/state", T["own/msg/State"](
            Vector3(10.0 + i, 0.0, 0.0), Vector3(0.01 * i, 0.2, 0.3), twist(2.0, 0.0),
            accel(3.0, 0.0)
        )) for i, t in enumerate(TIMES)
    ]  # fmt: skip
    (report,) = inspect(write(tmp_path / "bag", sent)).topics
    log, units = report.topic.log, {c.name: c.unit for c in report.columns}
    assert np.array_equal(log["position_x"], 10.0 + np.arange(60.0))
    assert log["orientation_x"] == pytest.approx(0.01 * np.arange(60.0), abs=0.0)
    assert (units["position_x"].unit, units["position_x"].sure) == ("m", True)
    assert (units["orientation_x"].unit, units["orientation_x"].sure) == ("rad", False)
    assert (log["twist_linear_x"][0], log["accel_linear_x"][0]) == (2.0, 3.0)
    assert (units["twist_linear_x"].unit, units["accel_linear_x"].unit) == ("m/s", "m/s2")


def test_poses_in_two_frames_are_two_topics(tmp_path: Path) -> None:
    kind = T["geometry_msgs/msg/PoseStamped"]
    sent = [(t, "/pose", kind(header(t, "odom" if i % 3 else "map"), pose(i % 3, 0.0, 0.0)))
            for i, t in enumerate(TIMES)]  # fmt: skip
    found = topics(write(tmp_path / "bag", sent), "/pose")
    assert {name: (t.frames, t.log["x"].size) for name, t in found.items()} == {
        "/pose map": ("map", 20), "/pose odom": ("odom", 40),
    }  # fmt: skip
    assert not found["/pose map"].log["x"].any() and found["/pose odom"].log["x"].all()
    assert any("20 of 60 messages" in note for note in found["/pose map"].notes)


def test_a_frame_that_is_none_of_place_leaves_a_topic_whole(tmp_path: Path) -> None:
    kind = T["geometry_msgs/msg/PoseStamped"]
    sent = [(t, "/pose", kind(header(t, f"shot_{i}"), pose(i, 0.0, 0.0)))
            for i, t in enumerate(TIMES)]  # fmt: skip
    found = topics(write(tmp_path / "bag", sent))
    assert list(found) == ["/pose"] and found["/pose"].log["x"].size == 60
    assert any("name 60 frames, 'shot_0' first" in note for note in found["/pose"].notes)


def test_joints_of_two_publishers_with_one_stamp_are_put_together(tmp_path: Path) -> None:
    kind = T["sensor_msgs/msg/JointState"]
    none = np.zeros(0)
    sent: list[Message] = []
    for i, time in enumerate(TIMES):
        for j, name in enumerate(("arm", "gripper")):
            state = kind(header(time), [name], np.array([i + 100.0 * j]), none, none)
            sent.append((time + j, "/joints", state))
    again = kind(header(TIMES[-1]), ["arm"], np.ones(1), none, none)
    sent.append((TIMES[-1] + 9, "/joints", again))
    found = topics(write(tmp_path / "bag", sent))["/joints"]
    assert np.array_equal(found.log["position.arm"], np.arange(60.0))
    assert np.array_equal(found.log["position.gripper"], 100.0 + np.arange(60.0))
    assert any(note.startswith("60 messages with a stamp that was") for note in found.notes)
    assert any(note.startswith("1 messages with a stamp that was") for note in found.notes)


def test_what_holds_no_signals_is_left_out_and_named(tmp_path: Path) -> None:
    text = T["std_msgs/msg/String"]("hello")
    empty = T["std_msgs/msg/Empty"]()
    path = write(tmp_path / "bag", [(TIMES[0], "/text", text), (TIMES[0], "/empty", empty)])
    report = inspect(path)
    assert report.topics == ()
    assert set(report.source.left) == {"/text", "/empty"}


def test_single_topics_can_be_read(tmp_path: Path) -> None:
    path = write(tmp_path / "bag", [(t, f"/{n}", twist(1, 0)) for t in TIMES for n in "ab"])
    assert list(topics(path, "/a")) == ["/a"]
    with pytest.raises(ScenarioError, match=r"--topic /c: there is /a, /b"):
        topics(path, "/c")


@pytest.mark.parametrize("plugin", ["MCAP", "SQLITE3"])
def test_files_of_a_bag_alone_are_the_same(tmp_path: Path, plugin: str) -> None:
    whole = write(tmp_path / "bag", [(t, "/a", twist(t / 1e18, 0)) for t in TIMES], plugin)
    (alone,) = [p for p in whole.iterdir() if p.suffix in (".mcap", ".db3")]
    one, other = topics(whole)["/a"].log, topics(alone)["/a"].log
    assert np.array_equal(one["linear_x"], other["linear_x"])
    assert np.array_equal(one["time"], other["time"])


def test_a_bag_of_ros_1(tmp_path: Path) -> None:
    path = tmp_path / "one.bag"
    kind = ONE.types["geometry_msgs/msg/PointStamped"]
    with rosbag1.Writer(path) as writer:
        connection = writer.add_connection("/p", kind.__msgtype__, typestore=ONE)
        for i, time in enumerate(TIMES):
            head = ONE.types["std_msgs/msg/Header"](
                i, ONE.types["builtin_interfaces/msg/Time"](time // 10**9, time % 10**9), "map"
            )
            message = kind(head, ONE.types["geometry_msgs/msg/Point"](0.5 * i, 0.0, 0.0))
            writer.write(connection, time, ONE.serialize_ros1(message, kind.__msgtype__))
    log = topics(path)["/p"].log
    assert log["x"] == pytest.approx(0.5 * np.arange(60), abs=0.0)
    assert (log.units["x"], log.units["time"]) == ("m", "ns")


@pytest.mark.parametrize("name", ["x.mcap", "x.bag", "x.db3"])
def test_damaged_bags_are_refused_by_name(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    for content in (b"", b"\x89MCAP0\r\n" + bytes(200), b"#ROSBAG V2.0\n" + bytes(99), bytes(500)):
        path.write_bytes(content)
        with pytest.raises(ScenarioError) as caught:
            inspect(path)
        assert str(path) in str(caught.value)
    with pytest.raises(ScenarioError, match="there is no such file"):
        inspect(tmp_path / f"other_{name}")


def test_a_message_without_a_time_is_named(tmp_path: Path) -> None:
    kind = T["geometry_msgs/msg/PoseStamped"]
    sent = [(t, "/pose", kind(header(t), pose(0.0, 0.0, 0.0))) for t in TIMES]
    (path,) = write(tmp_path / "bag", sent, "SQLITE3").glob("*.db3")
    with sqlite3.connect(path) as base:
        base.execute("UPDATE messages SET timestamp = X'FF' WHERE id = 3")
    base.close()
    with pytest.raises(ScenarioError, match=r"a message of /pose was recorded at b'\\xff', which"):
        inspect(path)


def test_without_the_library_the_way_out_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path / "bag", [(TIMES[0], "/a", twist(1.0, 0.0))])
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    with pytest.raises(InputError, match="not installed; pip install rosbags"):
        inspect(path)


@pytest.mark.parametrize("plugin", ["MCAP", "SQLITE3"])
def test_a_bag_is_imported_as_the_same_run_in_csv_is(tmp_path: Path, plugin: str) -> None:
    run = drive(2, late=0.1)
    array = T["std_msgs/msg/Float64MultiArray"]
    layout = T["std_msgs/msg/MultiArrayLayout"]([], 0)
    sent: list[Message] = [
        (stamp(t), "/wheel_cmd", array(layout, np.array(speeds)))
        for t, *speeds in zip(run.commanded, run.left, run.right, strict=True)
    ]
    sent += [
        (stamp(t), "/mocap", T["geometry_msgs/msg/PoseStamped"](header(stamp(t)), pose(*row)))
        for t, row in zip(run.stamped, run.pose.tolist(), strict=True)
    ]
    bag = write(tmp_path / "a", sent, plugin)
    (tmp_path / "robot.toml").write_text(SYSTEM)
    wishes = Wishes(
        str(tmp_path / "robot.toml"),
        ["wheel_cmd.data_1=base.w_l:rad/s", "wheel_cmd.data_2=base.w_r:rad/s"],
        {"base.r": (RADIUS,), "base.track": (TRACK,)},
    )
    files, purpose = {"a": [bag]}, {"a": "identification"}
    done = import_logs(files, purpose, wishes, tmp_path / "set", default_provider())
    assert {n: m.column.source for n, m in done.matches.channels.items()} == {
        "base.x": "mocap.x", "base.y": "mocap.y", "base.phi": "mocap.yaw",
    }  # fmt: skip
    files = {"a": write_csv(run, "a", tmp_path)}
    wishes = Wishes(wishes.system, (), wishes.parameters)
    import_logs(files, purpose, wishes, tmp_path / "csv", default_provider())
    one, other = (read_problem(tmp_path / name).runs[0] for name in ("set", "csv"))
    assert np.array_equal(one.times, other.times)
    # the table has tenths of a millimetre and hundredths of a degree
    assert np.nanmax(np.abs(one.data - other.data)) < 1e-4
    for name in ("base.w_l", "base.w_r"):
        assert one.inputs[name].at(one.times) == pytest.approx(other.inputs[name].at(other.times))
