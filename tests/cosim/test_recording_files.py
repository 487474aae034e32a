"""Recordings: other forms, files, and that no half-written file is left."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cosim.data.comparison import Reference, compare
from cosim.data.logs import read_data_set, read_log
from cosim.data.recording import Recording, read_recording
from cosim.errors import InputError, ScenarioError, UnitError, UnknownNameError, ValueRangeError
from cosim.files import atomic
from cosim.master.master import Master
from tests.cosim.bench import bench


@pytest.fixture
def recording(provider) -> Recording:
    return Master(bench(provider), step=1e-3).run(0.02, inputs={"motor.w_ref": 5.0})


def test_pandas(recording: Recording) -> None:
    frame = recording.to_pandas()
    assert frame.index.name == "time" and len(frame) == 21
    np.testing.assert_array_equal(frame["load.w"], recording["load.w"])
    assert frame.attrs["units"]["load.w"] == "rad/s"


def test_parquet_keeps_every_bit_and_the_provenance(recording: Recording, tmp_path: Path) -> None:
    path = recording.write_parquet(tmp_path / "deep" / "run.parquet")
    back = read_recording(path)
    np.testing.assert_array_equal(back.values, recording.values)
    np.testing.assert_array_equal(back.time, recording.time)
    assert back.units == recording.units
    assert back.bond_energy == recording.bond_energy
    gearbox = back.provenance["instances"]["gearbox"]
    assert gearbox["reference"] == "gearbox.lab_bench/ratio" and len(gearbox["sha256"]) == 64
    assert back.provenance["algorithm"] == "jacobi"
    assert next(iter(pd.read_parquet(path).columns)) == "time"


def test_csv_keeps_every_bit_and_names_units(recording: Recording, tmp_path: Path) -> None:
    path = recording.write_csv(tmp_path / "run.csv")
    with path.open() as handle:
        heads = next(csv.reader(handle))
    assert heads[0] == "time [s]" and "load.w [rad/s]" in heads
    log = read_log(path)
    np.testing.assert_array_equal(log["load.w"], recording["load.w"])
    assert log.units["load.w"] == "rad/s"


def test_plot(recording: Recording, tmp_path: Path) -> None:
    path = tmp_path / "plot.png"
    figure = recording.plot(["load.w", "motor.i"], path)
    assert [axis.get_ylabel() for axis in figure.axes] == ["angular speed [rad/s]", "current [A]"]
    assert path.read_bytes().startswith(b"\x89PNG")


def test_unknown_signal(recording: Recording) -> None:
    with pytest.raises(UnknownNameError, match=r"no signal 'load.ww' was recorded; did you mean"):
        recording["load.ww"]


def test_vector_signals() -> None:
    recording = Recording(
        np.arange(2.0), np.arange(6.0).reshape(2, 3), ("a.q[1]", "a.q[2]", "a.x"), {}
    )
    np.testing.assert_array_equal(recording["a.q"], [[0.0, 1.0], [3.0, 4.0]])
    np.testing.assert_array_equal(recording["a.x"], [2.0, 5.0])


def test_a_failing_write_leaves_nothing(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    with pytest.raises(RuntimeError, match=r"disk"), atomic(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError("disk")
    assert list(tmp_path.iterdir()) == []


def test_a_failing_write_keeps_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text("old")
    with pytest.raises(RuntimeError), atomic(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


def test_a_folder_that_cannot_be_made(tmp_path: Path, recording: Recording) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"cannot be written .* choose another folder"):
        recording.write_csv(tmp_path / "file" / "run.csv")


# -- comparison ------------------------------------------------------------------------------------


def straight() -> Recording:
    time = np.linspace(0.0, 1.0, 11)
    return Recording(time, 2.0 * time[:, None], ("a.x",), {"a.x": "m"})


def test_comparison_on_the_grid_of_the_reference() -> None:
    times = np.array([-0.5, 0.05, 0.55, 0.75, 2.0])
    values = np.array([0.0, 100.0, 1100.0, np.nan, 0.0]) + 300.0
    found = compare(straight(), Reference(("a.x",), times, values[:, None], "mm", "log:x"))
    # 0.1 m and 1.1 m against 0.4 m and 1.4 m; outside and gaps are left out
    assert found.count == 2 and found.unit == "m"
    assert found.rms == pytest.approx(0.3, rel=1e-12) and found.max == pytest.approx(0.3, rel=1e-12)


def test_comparison_of_a_path_takes_the_distance() -> None:
    time = np.linspace(0.0, 1.0, 11)
    path = Recording(time, np.column_stack([time, 0.0 * time]), ("x", "y"), {"x": "m", "y": "m"})
    away = np.array([[0.5 + 0.3, 0.4], [1.0, 0.5]])
    found = compare(path, Reference(("x", "y"), np.array([0.5, 1.0]), away, "m", "log"))
    np.testing.assert_allclose(found.differences, [0.5, 0.5], rtol=1e-12)
    mixed = Recording(time, path.values, ("x", "y"), {"x": "m", "y": "rad"})
    with pytest.raises(UnitError, match=r"the distance of x, y: their units are m, rad"):
        compare(mixed, Reference(("x", "y"), np.array([0.5, 1.0]), away, "m", "log"))


def test_comparison_refuses() -> None:
    times = np.array([0.5])
    with pytest.raises(UnitError, match=r"cannot compare a.x with log: unit 's' .* does not"):
        compare(straight(), Reference(("a.x",), times, times[:, None], "s", "log"))
    with pytest.raises(ValueRangeError, match=r"no sample lies within the recording"):
        compare(straight(), Reference(("a.x",), times + 5.0, times[:, None], "m", "log"))


# -- measured data ---------------------------------------------------------------------------------


def test_csv_log_with_units_gaps_and_text(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,v [mm/s],note\n0,1.5,start\n1,,\n2,2.5,end\n")
    log = read_log(path)
    assert log.units["v"] == "mm/s" and list(log.columns) == ["time", "v"]
    np.testing.assert_array_equal(log["v"], [1.5, np.nan, 2.5])
    with pytest.raises(UnknownNameError, match=r"log.csv: has no column 'w'"):
        log["w"]


@pytest.mark.parametrize("name", ["x.parquet", "x.npz", "x.csv", "x.txt"])
def test_broken_logs(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    with pytest.raises(ScenarioError, match=r"there is no such file"):
        read_log(path)
    path.write_bytes(b"")
    with pytest.raises(ScenarioError, match=name):
        read_log(path)


def test_data_set(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(
        '[[signal]]\nname = "speed"\nunit = "rad/s"\nnoise_sigma = 0.1\n'
    )
    folder = tmp_path / "RIG-1"
    folder.mkdir()
    (folder / "set.toml").write_text(
        'rig = "rig"\nset = "RIG-1"\nsheet = "rig.toml"\n'
        '[[run]]\nname = "A"\nfile = "a.csv"\npurpose = "validation"\nangle = 0.5\n'
    )
    (folder / "a.csv").write_text("time,speed\n0,1\n1,2\n")
    data = read_data_set(folder)
    log = data.log("A")
    assert (log.units["speed"], log.noise["speed"], log.values["angle"]) == ("rad/s", 0.1, 0.5)
    with pytest.raises(UnknownNameError, match=r"data set RIG-1: there is A as run"):
        data.log("B")
    (tmp_path / "rig.toml").unlink()
    with pytest.raises(ScenarioError, match=r"the rig sheet 'rig.toml' is not here"):
        read_data_set(folder)
