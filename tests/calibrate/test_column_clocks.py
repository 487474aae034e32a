"""Columns are brought together by the right clock, in seconds, with what was measured kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.calibrate.test_log_habits import SIZE, SPEED, STEP, TIMES, TORQUE, read, written

SINCE_1970 = 1_764_040_000
SMOOTH = np.sin(6.0 * TIMES)
IN_MS = 'time = { source = "t", scale = 1e-3 }\n'


def test_the_named_clock_counts_though_a_column_is_called_time(tmp_path: Path) -> None:
    heads = "time [s],stamp [s],tau [N.m],w [rad/s]"
    log = written(heads, ",", 3.0 + 1.1 * TIMES, TIMES, TORQUE, SPEED)
    run = read(tmp_path, log, TOP='time = "stamp"').run("one")
    np.testing.assert_allclose(run.times, TIMES, rtol=0, atol=1e-9)


def test_a_derivative_is_in_time_where_columns_scale_the_clock(tmp_path: Path) -> None:
    log = written("t,tau,angle", ",", 1e3 * TIMES, TORQUE, SMOOTH)
    columns = IN_MS + 'w = { source = "angle", from = "rad", unit = "rad/s", derivative = true }'
    run = read(tmp_path, log, TOP='time = "t"', COLUMNS=columns).run("one")
    # central differences miss by 6^3 h^2 / 6 within the log
    error = run.data[1:-1, 0] - 6.0 * np.cos(6.0 * TIMES[1:-1])
    assert np.max(np.abs(error)) < 6.0**3 * STEP**2 / 6.0 * 1.01


def test_a_cutoff_is_in_hertz_where_columns_scale_the_clock(tmp_path: Path) -> None:
    slow, fast = np.sin(2.0 * np.pi * TIMES), np.sin(2.0 * np.pi * 30.0 * TIMES)
    log = written("t,tau,w", ",", 1e3 * TIMES, TORQUE, slow + fast)
    columns = IN_MS + "w = { lowpass = 10.0 }"
    run = read(tmp_path, log, TOP='time = "t"', COLUMNS=columns).run("one")
    # twice fifth order: 30 Hz keeps 3^-10, 1 Hz is whole; the ends ring
    assert np.max(np.abs(run.data[50:-50, 0] - slow[50:-50])) < 1e-3


def test_a_grid_is_in_seconds_where_columns_scale_the_clock(tmp_path: Path) -> None:
    log = written("t,tau,w", ",", 1e3 * TIMES, TORQUE, SPEED)
    columns = IN_MS + "tau = { hold = true }\nw = {}"
    run = read(tmp_path, log, TOP='time = "t"\nresample = 0.02', COLUMNS=columns).run("one")
    np.testing.assert_allclose(run.times, TIMES[::2], rtol=0, atol=1e-9)


@pytest.mark.parametrize("told", [IN_MS, 'time = { source = "t", from = "ms", unit = "s" }\n'])
def test_lateness_and_gaps_are_in_seconds_where_columns_scale_the_clock(
    tmp_path: Path, told: str
) -> None:
    cells = np.where((TIMES > 1.0) & (TIMES < 1.05), np.nan, SMOOTH)
    log = written("t,tau,w", ",", 1e3 * TIMES, TORQUE, cells)
    columns = told + "w = { late = 0.1, gap = 0.2 }"
    run = read(tmp_path, log, TOP='time = "t"', COLUMNS=columns).run("one")
    seen = np.isfinite(run.data[:, 0])
    assert np.flatnonzero(~seen).tolist() == list(range(SIZE - 10, SIZE))
    # on a line over 0.05 s: 6^2 0.05^2 / 8 and little more
    assert np.max(np.abs(run.data[seen, 0] - np.sin(6.0 * (TIMES + 0.1))[seen])) < 0.015


def test_clocks_of_columns_are_in_the_unit_of_a_main_one_that_columns_scale(tmp_path: Path) -> None:
    log = written("t,tau,w,seen", ",", 1e3 * TIMES, TORQUE, SPEED, 1e3 * TIMES)
    columns = IN_MS + 'w = { time = "seen" }'
    run = read(tmp_path, log, TOP='time = "t"', COLUMNS=columns).run("one")
    np.testing.assert_allclose(run.data[:, 0], SPEED, rtol=0, atol=1e-9)


@pytest.mark.parametrize("main", ["s", "ns"])
def test_seconds_and_nanoseconds_since_1970_stand_beside_each_other(
    tmp_path: Path, main: str
) -> None:
    fine = [f"{SINCE_1970 * 10**9 + k * 10**7}" for k in range(SIZE)]
    plain = [f"{SINCE_1970 + time:.2f}" for time in TIMES]
    first, second = (plain, fine) if main == "s" else (fine, plain)
    rows = [f"{a},{tau:.9g},{w:.9g},{b}"
            for a, tau, w, b in zip(first, TORQUE, SPEED, second, strict=True)]  # fmt: skip
    log = "\n".join(["time,tau,w,seen", *rows]) + "\n"
    run = read(tmp_path, log, COLUMNS='w = { time = "seen" }').run("one")
    # seconds since 1970 keep 2.4e-7 s of 0.01 s, over steps of the noise of up to 0.05 rad/s
    np.testing.assert_allclose(run.data[:, 0], SPEED, rtol=0, atol=1e-4)


def test_a_row_without_a_main_time_keeps_its_sample_on_another_clock(tmp_path: Path) -> None:
    rows = written("time,tau,w,seen", ",", TIMES, TORQUE, SPEED, TIMES + 0.5 * STEP).splitlines()
    rows[51] = rows[51][rows[51].index(",") :]
    run = read(tmp_path, "\n".join(rows), COLUMNS='w = { time = "seen" }').run("one")
    assert run.times.size == SIZE - 1
    between = 0.5 * (SPEED[1:] + SPEED[:-1])
    np.testing.assert_allclose(run.data[1:, 0], np.delete(between, 49), rtol=0, atol=1e-6)


def test_what_was_measured_stays_beside_gaps_that_are_too_long(tmp_path: Path) -> None:
    cells = np.where(np.arange(SIZE) % 10 == 0, SPEED, np.nan)
    log = written("time,tau,w", ",", TIMES, TORQUE, cells)
    run = read(tmp_path, log, COLUMNS="w = { gap = 0.05 }").run("one")
    np.testing.assert_allclose(run.data[:, 0], cells, rtol=1e-9)
    bridged = read(tmp_path, log, COLUMNS="w = { gap = 0.15 }").run("one")
    assert np.isfinite(bridged.data[: SIZE - 9, 0]).all()


def driving(folder: Path, heads: str, column: str, *columns: np.ndarray) -> np.ndarray:
    """What drives the disc at the samples, of a column that is held on a clock of its own."""
    log = written(f"time,w,{heads},seen", ",", TIMES, SPEED, *columns, TIMES)
    made = f'tau = {{ {column}, time = "seen", hold = true }}'
    table = read(folder, log, COLUMNS=made).run("one").inputs["load.tau"]
    return np.asarray(table.at(TIMES))


def test_a_held_input_is_filtered_on_a_clock_of_its_own_too(tmp_path: Path) -> None:
    column = 'source = "q", from = "N.m.s", unit = "N.m", derivative = true'
    found = driving(tmp_path, "q", column, SMOOTH)
    np.testing.assert_allclose(found, np.gradient(SMOOTH, TIMES), rtol=0, atol=1e-6)
    rough = SMOOTH + 0.5 * np.sin(2.0 * np.pi * 40.0 * TIMES)
    found = driving(tmp_path, "q", 'source = "q", lowpass = 10.0', rough)
    assert np.max(np.abs(found - SMOOTH)[50:-50]) < 1e-3


def test_a_held_input_of_a_quaternion_turns_on_a_clock_of_its_own_too(tmp_path: Path) -> None:
    none = np.zeros(SIZE)
    column = 'quaternion = ["qx", "qy", "qz", "qw"], unit = "N.m", scale = 2.0'
    parts = (none, none, np.sin(0.5 * SMOOTH), np.cos(0.5 * SMOOTH))
    found = driving(tmp_path, "qx,qy,qz,qw", column, *parts)
    np.testing.assert_allclose(found, 2.0 * SMOOTH, rtol=0, atol=1e-9)
