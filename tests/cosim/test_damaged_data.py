"""Tables of numbers that are damaged, too large or of another kind: one sentence each."""

from __future__ import annotations

import contextlib
import json
import struct
import zipfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import loadmat, savemat

from cosim.data.logs import read_data_set, read_log
from cosim.data.matlab import read_matlab
from cosim.data.npz import read_npz
from cosim.data.recording import Recording, read_recording
from cosim.errors import ScenarioError

TIME = np.linspace(0.0, 1.0, 11)


def refused(read, path: Path) -> str:
    with pytest.raises(ScenarioError) as caught:
        read(path)
    assert str(path) in str(caught.value)
    return str(caught.value)


# -- npz -------------------------------------------------------------------------------------------


def test_npz_reads_what_numpy_writes(tmp_path: Path) -> None:
    path = tmp_path / "x.npz"
    content = {
        "time": TIME, "n": np.arange(3, dtype=np.int16), "on": np.array([True, False]),
        "big": np.arange(3, dtype=">f4"), "xy": np.asfortranarray(np.arange(6.0).reshape(3, 2)),
        "none": np.zeros(0), "word": np.array(["a", "bc"]),
    }  # fmt: skip
    for write in (np.savez, np.savez_compressed):
        write(path, **content)
        found = read_npz(path)
        assert list(found) == list(content)
        assert all(np.array_equal(found[name], content[name]) for name in content)
    log = read_log(path)
    assert set(log.columns) == {"time", "n", "on", "big", "xy_1", "xy_2", "none"}


def _archive(path: Path, content: bytes, name: str = "time.npy") -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, content)
    return path


def _npy(shape: str, values: bytes = b"", dtype: str = "<f8") -> bytes:
    head = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}".encode()
    head += b" " * (-(len(head) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head + values


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (_npy("(2,)", bytes(16))[:-3], "needs 16 bytes, but 13 are there"),
        (_npy("(-2,)"), "has the shape (-2,)"),
        (_npy("(1, -1)", bytes(8)), "has the shape (1, -1)"),
        (_npy("(1,)", bytes(8), "|O"), "holds Python objects, which could run anything"),
        (_npy("(1,)", bytes(8), "q9"), "is not a whole npz archive of numbers"),
        (_npy("(1,)", b"\xff" * 8, "<U2"), "has the character 4294967295, which is none"),
        (_npy("((((1"), "is not a whole npz archive of numbers"),
        (b"\x93NUMPY\x01\x00\xff\xff", "has a header of 65545 bytes"),
        (b"text", "its entry 'time.npy' is no array of numpy"),
    ],
)
def test_damaged_arrays(tmp_path: Path, content: bytes, message: str) -> None:
    assert message in refused(read_log, _archive(tmp_path / "x.npz", content))


def test_an_npz_that_is_no_npz(tmp_path: Path) -> None:
    path = tmp_path / "x.npz"
    np.savez(path, time=TIME)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    text = refused(read_log, path)
    assert "is not a whole npz archive of numbers (File is not a zip file); write it again" in text
    assert "is no array of numpy" in refused(read_log, _archive(path, b"", "readme.txt"))
    place = content.index(b"NUMPY") + 200  # a value changed: the checksum does not fit
    path.write_bytes(content[:place] + b"\xff" + content[place + 1 :])
    assert "Bad CRC-32" in refused(read_log, path)


def test_an_npz_larger_than_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = _archive(tmp_path / "x.npz", _npy("(1000000000000,)"))
    assert "needs 8000000000000 bytes" in refused(read_log, path)
    np.savez_compressed(path, time=np.zeros(1_000_000, np.int8))
    monkeypatch.setenv("COSIM_MAX_DATA", "7MB")  # as floating-point numbers, 8 MB
    text = refused(read_log, path)
    assert "8 MB are more than the limit of 7 MB" in text and "COSIM_MAX_DATA=8000000" in text
    monkeypatch.setenv("COSIM_MAX_DATA", "8MB")
    assert read_log(path).time.size == 1_000_000


def test_columns_of_one_name(tmp_path: Path) -> None:
    path = tmp_path / "x.npz"
    np.savez(path, x=np.zeros((3, 2)), x_1=np.zeros(3))
    assert "has two columns 'x_1'; rename one of the arrays" in refused(read_log, path)
    csv = tmp_path / "x.csv"
    csv.write_text("time,a,a\n0,1,2\n")
    assert "has two columns 'a'; rename one of them" in refused(read_log, csv)


# -- MATLAB ----------------------------------------------------------------------------------------

MATRIX = {
    "time": TIME, "row": np.arange(3.0)[None, :], "xy": np.arange(6.0).reshape(3, 2),
    "n": np.array([1, 2, 300], np.int16), "single": np.array([1.5, 2.5], np.float32),
    "a_long_name": np.arange(2.0), "word": "text", "z": np.array([1j]), "s": {"a": 1.0},
}  # fmt: skip


@pytest.mark.parametrize("packed", [False, True])
def test_matlab_reads_what_scipy_reads(tmp_path: Path, packed: bool) -> None:
    path = tmp_path / "x.mat"
    savemat(path, MATRIX, do_compression=packed)
    found, theirs = read_matlab(path), loadmat(path, squeeze_me=True)
    assert found.pop("s.a") == theirs["s"]["a"]
    assert list(found) == [name for name in MATRIX if name not in ("word", "z", "s")]
    for name, values in found.items():
        assert np.array_equal(values, theirs[name]) and values.dtype == theirs[name].dtype
    assert {"time", "row", "xy_1", "xy_2", "n"} <= set(read_log(path).columns)


def test_matlab_version_4(tmp_path: Path) -> None:
    path = tmp_path / "x.mat"
    savemat(path, {"time": TIME, "xy": MATRIX["xy"], "t": "text"}, format="4")
    found = read_matlab(path)
    assert np.array_equal(found["time"], TIME) and np.array_equal(found["xy"], MATRIX["xy"])
    assert "t" not in found
    assert "'t' (text)" in read_log(path).notes[0]


@pytest.mark.parametrize("packed", [False, True])
def test_matlab_structures_are_columns_and_what_is_left_out_is_named(
    tmp_path: Path, packed: bool
) -> None:
    path = tmp_path / "x.mat"
    array = np.zeros(2, dtype=[("a", "O")])
    array["a"] = [1.0, 2.0]
    log = {"time": TIME, "pose": {"x": TIME**2, "none": np.zeros(0)}, "note": "hello"}
    content = {"log": log, "runs": array, "who": "me", "c": 1j * TIME,
               "cell": np.array([1.0, "a"], dtype=object), "u": TIME}  # fmt: skip
    savemat(path, content, do_compression=packed, oned_as="column")
    found = read_log(path)
    assert [name for name, values in found.columns.items() if values.size] == [
        "log.time", "log.pose.x", "u",
    ]  # fmt: skip
    assert np.array_equal(found["log.pose.x"], TIME**2)
    for said in ("'log.note' (text)", "'runs' (an array of structures)", "'who' (text)",
                 "'c' (complex)", "'cell' (a cell)"):  # fmt: skip
        assert said in found.notes[0]
    whole = path.read_bytes()
    for place in range(128, len(whole), 5):  # damage of any kind is refused in a sentence
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x35]) + whole[place + 1 :])
        with contextlib.suppress(ScenarioError):
            read_log(path)


@pytest.mark.parametrize("packed", [False, True])
def test_a_matlab_file_that_is_cut(tmp_path: Path, packed: bool) -> None:
    path = tmp_path / "x.mat"
    savemat(path, {"time": TIME, "xy": MATRIX["xy"]}, do_compression=packed)
    whole = path.read_bytes()
    for length in range(0, len(whole), 7):
        path.write_bytes(whole[:length])
        if length == 0 or whole[:length] == whole[:128]:
            continue  # nothing in it
        try:
            assert set(read_matlab(path)) <= {"time", "xy"}  # the cut lies between variables
        except ScenarioError as error:
            assert "is not a whole MATLAB file of version 7 or older" in str(error)
            assert "save it again with -v7" in str(error)


def test_matlab_sizes_that_do_not_fit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "x.mat"
    savemat(path, {"time": TIME})
    content = path.read_bytes()
    place = content.index(struct.pack("<ii", 1, 11))
    path.write_bytes(content[:place] + struct.pack("<ii", 2**31 - 1, 11) + content[place + 8 :])
    assert "variable 'time' has 11 values for 2147483647 x 11" in refused(read_log, path)
    savemat(path, {"time": np.zeros(1_000_000)}, do_compression=True)
    monkeypatch.setenv("COSIM_MAX_DATA", "1MB")
    text = refused(read_log, path)
    assert "more than the limit of 1 MB" in text and "COSIM_MAX_DATA" in text


# -- Parquet and recordings ------------------------------------------------------------------------


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    values = np.column_stack([TIME, TIME**2])
    whole = Recording(TIME, values, ("a.x", "a.y"), {"a.x": "m"}, {"system": "s"}, {"b": 1.0})
    return whole.write_parquet(tmp_path / "r.parquet")


def _with(path: Path, meta: object = None, **columns: pa.Array) -> None:
    table = pq.read_table(path)
    for name, column in columns.items():
        table = table.append_column(name, column)
    if meta is not None:
        table = table.replace_schema_metadata({b"cosim": json.dumps(meta).encode()})
    pq.write_table(table, path)


def test_a_recording_that_is_cut(recording: Path) -> None:
    content = recording.read_bytes()
    recording.write_bytes(content[:-20])
    text = refused(read_recording, recording)
    assert "is not a whole Parquet file (" in text and text.endswith("write it again")
    recording.write_bytes(content[:4] + b"\xff" * 200 + content[204:])
    assert "is not a whole Parquet file (" in refused(read_recording, recording)


@pytest.mark.parametrize(
    ("meta", "message"),
    [
        ([], "what it says about itself lacks units"),
        ({"units": {}}, "what it says about itself lacks provenance"),
        ({"units": {"a": 1}, "provenance": {}, "bond_energy_J": {}, "error": ""},
         "its units are no texts, or its energies no numbers"),
        ({"units": {}, "provenance": {}, "bond_energy_J": {"b": "1"}, "error": ""},
         "its units are no texts, or its energies no numbers"),
    ],
)  # fmt: skip
def test_a_recording_that_says_other_things(recording: Path, meta: object, message: str) -> None:
    _with(recording, meta)
    assert f"{message}; record it again" in refused(read_recording, recording)


def test_a_recording_with_other_columns(recording: Path) -> None:
    _with(recording, on=pa.array([True] * TIME.size))
    text = refused(read_recording, recording)
    assert "column 'on' is of type bool with 0 gaps; a recording has double, int64, " in text


def test_a_recording_with_gaps(recording: Path) -> None:
    _with(recording, gap=pa.array([None] * TIME.size, pa.float64()))
    text = refused(read_recording, recording)
    assert "column 'gap' is of type double with 11 gaps" in text and "record it again" in text


def test_parquet_columns_of_one_name(tmp_path: Path) -> None:
    path = tmp_path / "x.parquet"
    pq.write_table(pa.table([pa.array(TIME), pa.array(TIME)], names=["time", "time"]), path)
    assert "has two columns 'time'; rename one of them" in refused(read_log, path)


def test_parquet_larger_than_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "x.parquet"
    pq.write_table(pa.table({"time": np.zeros(1_000_000)}), path)
    assert path.stat().st_size < 5000
    monkeypatch.setenv("COSIM_MAX_DATA", "7MB")
    for read in (read_log, read_recording):
        text = refused(read, path)
        assert "8 MB are more than the limit of 7 MB" in text and "COSIM_MAX_DATA=8000000" in text


# -- text ------------------------------------------------------------------------------------------


def test_a_table_that_is_no_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "x.csv"
    path.write_text("time,a\n0,1\n" + '1,"' + "x" * 200_000)
    assert "is not a table of text (field larger than field limit" in refused(read_log, path)
    path.write_text("time,a\n0,1\n")
    monkeypatch.setenv("COSIM_MAX_DATA", "40")
    assert "COSIM_MAX_DATA" in refused(read_log, path)


@pytest.mark.parametrize(
    "text",
    ["run = 5", "run = [5]", '[[run]]\nname = ["a"]\nfile = "b"', "sheet = 5", "a = " + "[" * 9999],
)
def test_a_set_of_another_form(tmp_path: Path, text: str) -> None:
    (tmp_path / "set.toml").write_text(text)
    with pytest.raises(ScenarioError, match=r"set\.toml"):
        read_data_set(tmp_path)
