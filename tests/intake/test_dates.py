"""Clocks that are dates, times of day or two columns, and what stands before a table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.data.logs import read_log
from cosim.errors import ScenarioError
from cosim.intake.inspect import inspect

EPOCH = 1740823199_980000000
"""[ns] 2025-03-01T09:59:59.98Z."""


def log(folder: Path, text: str) -> Path:
    path = folder / "a.csv"
    path.write_text(text)
    return path


def table(head: str, stamps: list[str]) -> str:
    return head + "\n" + "".join(f"{stamp},{i}.5\n" for i, stamp in enumerate(stamps))


def counted(path: Path, column: str) -> list[int]:
    found = read_log(path)
    origin = found.origins.get(column, 0)
    assert found.units[column] == "ns"
    return [int(value) + origin for value in found[column]]


@pytest.mark.parametrize(
    ("stamps", "note"),
    [
        (["2025-03-01T09:59:59.98Z", "2025-03-01T10:00:00.000Z"], "since 1970"),
        (["2025-03-01 09:59:59.980", "2025-03-01 10:00:00"], "UTC is taken, since no zone"),
        (["2025/03/01 10:59:59,98+01:00", "2025/03/01 05:00:00-0500"], "since 1970"),
        (["2025-03-01T09:59:59.980000000 UTC", "2025-03-01T10:00Z"], "since 1970"),
    ],
)
def test_dates_count_from_1970(tmp_path: Path, stamps: list[str], note: str) -> None:
    stamps = [f'"{stamp}"' if "," in stamp else stamp for stamp in stamps]
    path = log(tmp_path, table("stamp,v", stamps))
    assert counted(path, "stamp") == [EPOCH, EPOCH + 20_000_000]
    assert note in read_log(path).notes[0]
    assert inspect(path).topics[0].clock.began().startswith("2025-03-01 09:59:59.980")


def test_nanoseconds_stay_exact_and_missing_times_are_gaps(tmp_path: Path) -> None:
    stamps = ["2025-03-01T10:00:00.123456789Z", "", "2025-03-01T10:00:00.123456791Z"]
    found = read_log(log(tmp_path, table("stamp,v", stamps)))
    assert np.isnan(found["stamp"][1])
    assert found["stamp"][2] - found["stamp"][0] == 2.0
    assert found.gaps["stamp"].empty == 1


def test_times_of_day_go_on_over_midnight(tmp_path: Path) -> None:
    stamps = ["23:59:59.5", "23:59:59.9", "00:00:00.3", "00:00:00.7"]
    found = counted(log(tmp_path, table("time,v", stamps)), "time")
    assert np.diff(found).tolist() == [400_000_000] * 3
    assert found[0] == 86_399_500_000_000


@pytest.mark.parametrize(
    "stamps",
    [
        ["2025-02-30T10:00:00Z", "2025-02-30T10:00:01Z"], ["2025-03-01T10:00:00Z", "later"],
        ["01/03/2025 10:00:00", "01/03/2025 10:00:01"], ["10.00.00", "10.00.01"],
        ["9999-12-31T00:00:00Z", "9999-12-31T00:00:01Z"], ["10:75:00", "10:76:00"],
    ],
)  # fmt: skip
def test_what_is_no_time_or_may_be_two_stays_text(tmp_path: Path, stamps: list[str]) -> None:
    found = read_log(log(tmp_path, table("stamp,v", stamps)))
    with pytest.raises(ScenarioError, match="'stamp' holds text"):
        found["stamp"]


@pytest.mark.parametrize("stamp", ["01.03.2025 10:00:00,02", "3/1/2025 10:00:00.02", "10:00:00 PM"])
def test_dates_that_may_mean_several_times_have_advice(tmp_path: Path, stamp: str) -> None:
    path = log(tmp_path, table("stamp,v", [f'"{stamp}"'] * 3))
    text = "may mean several times: write 2025-03-01T13:00:00.020, or seconds"
    with pytest.raises(ScenarioError, match=text):
        read_log(path)["stamp"]
    assert text in str(inspect(path).topics[0].findings)
    other = log(tmp_path, table("stamp,v", ["left", "right", "left"]))
    with pytest.raises(ScenarioError, match="name another column"):
        read_log(other)["stamp"]


def test_a_clock_in_two_columns_is_one(tmp_path: Path) -> None:
    rows = [f"{1740823200 + i // 50},{i % 50 * 20_000_000},{i}.5\n" for i in range(200)]
    head = "header.stamp.secs,header.stamp.nsecs,v\n"
    path = log(tmp_path, head + "".join(rows))
    found = counted(path, "header.stamp")
    assert found == [1740823200_000000000 + 20_000_000 * i for i in range(200)]
    clock = inspect(path).topics[0].clock
    assert (clock.column, clock.interval) == ("header.stamp", pytest.approx(0.02, rel=1e-12))
    assert clock.back == 0


def test_dates_and_times_of_day_in_two_columns_are_one_clock(tmp_path: Path) -> None:
    stamps = ["2025-02-28,23:59:59.98", "2025-03-01,0:00:00.00", ",0:00:00.02"]
    path = log(tmp_path, table("Date,Time,v", stamps))
    found = read_log(path)
    assert "columns 'Date' and 'Time' are one clock 'Time'" in found.notes[0]
    assert list(found.columns) == ["Time", "v"] and np.isnan(found["Time"][2])
    assert found["Time"][1] - found["Time"][0] == 20_000_000.0
    assert inspect(path).topics[0].clock.began().startswith("2025-02-28 23:59:59.98")


@pytest.mark.parametrize("rows", [["2025-03-01,left", "2025-03-01,right"], ["left,9:00:00"] * 2])
def test_a_date_or_a_time_beside_other_texts_stays_alone(tmp_path: Path, rows: list[str]) -> None:
    found = read_log(log(tmp_path, table("a,b,v", rows)))
    assert not any("one clock" in note for note in found.notes)


@pytest.mark.parametrize(
    "rows", ["1.5,3,0\n2.5,4,1\n", "1,2000000000,0\n2,0,1\n", "1,-5,0\n2,3,1\n"]
)
def test_two_columns_that_are_no_clock_stay_two(tmp_path: Path, rows: str) -> None:
    found = read_log(log(tmp_path, "t.secs,t.nsecs,v\n" + rows))
    assert list(found.columns) == ["t.secs", "t.nsecs", "v"]


NUMBERS = "".join(f"{0.1 * i:.1f},{i},{2 * i}\n" for i in range(20))


@pytest.mark.parametrize(
    ("before", "units"),
    [
        ("Scope 7\nSerial: 1234\nRate,100 Hz\n\n", ""), ("Scope 7,,\nRate,100,\n,,\n", ""),
        ("Scope 7\nsaved 2025-03-01\n", "s,V,rad/s\n"), ("Rate,100\n", ""),
    ],
)  # fmt: skip
def test_lines_before_the_head_are_left_out(tmp_path: Path, before: str, units: str) -> None:
    found = read_log(log(tmp_path, f"{before}time,u,y\n{units}{NUMBERS}"))
    assert list(found.columns) == ["time", "u", "y"]
    assert found["y"] == pytest.approx(2.0 * np.arange(20), abs=0.0)
    assert found.units["u"] == ("V" if units else "")
    left = len([line for line in before.splitlines() if line.strip()])
    assert f"before the head of the table is left out ({left} lines" in found.notes[0]


@pytest.mark.parametrize(
    "head", ["time,u,y\n", "time,u,y\ns,V,rad/s\n", "time,u,y\nN/A,N/A,N/A\n", "time,u,\nnone,,\n"]
)
def test_a_head_in_the_first_line_is_the_head(tmp_path: Path, head: str) -> None:
    found = read_log(log(tmp_path, head + NUMBERS))
    assert list(found.columns)[:2] == ["time", "u"]
    assert not found.notes


def test_a_cell_of_thousands_of_characters_is_cut_in_texts(tmp_path: Path) -> None:
    found = read_log(log(tmp_path, "time,u\n0,1\n1," + "9" * 5000 + "\n2,3\n"))
    assert "'9999" in str(found.gaps["u"]) and len(str(found.gaps["u"])) < 150


def test_a_folder_with_the_name_of_a_log_is_none(tmp_path: Path) -> None:
    (tmp_path / "a.csv").mkdir()
    with pytest.raises(ScenarioError, match=r"a\.csv: is a folder, not a log"):
        read_log(tmp_path / "a.csv")
