"""Units and clocks of columns, from names and sizes."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.data.logs import Log
from cosim.intake.clock import find_clock
from cosim.intake.guess import guess_time, guess_unit, turn_of, unit_in_name
from cosim.intake.topic import Topic

RAMP = np.linspace(-1.0, 1.0, 500)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("MotSpd_rpm", "rpm"), ("I_mA", "mA"), ("stamp_ms", "ms"), ("px_mm", "mm"),
        ("heading_deg", "deg"), ("PWM_volt", "V"), ("v_m_s", "m/s"), ("w_rad_per_s", "rad/s"),
        ("acc_x_m_s2", "m/s2"), ("tau_Nm", "N.m"), ("u_V", "V"), ("speedRpm", "rpm"),
        ("yaw_rate_dps", "deg/s"), ("t_s", "s"), ("temp_degC", "degC"), ("duty_pct", "%"),
        ("speed", ""), ("columns", ""), ("alarms", ""), ("phase_a", ""), ("frame_id", ""),
        ("Rpm", ""), ("items", ""), ("v", ""),
    ],
)  # fmt: skip
def test_the_end_of_a_name_is_a_unit(name: str, unit: str) -> None:
    assert unit_in_name(name) == unit


@pytest.mark.parametrize(
    ("name", "values", "unit"),
    [
        ("current", 8.0 * RAMP, "A"), ("current", 8000.0 * RAMP, "mA"), ("voltage", 24 * RAMP, "V"),
        ("yaw", 3.1 * RAMP, "rad"), ("yaw", 179.0 * RAMP, "deg"), ("yaw", 20.0 * RAMP, ""),
        ("pos_x", 3.0 * RAMP, "m"), ("pos_x", 3000.0 * RAMP, "mm"), ("speed", 3.0 * RAMP, ""),
        ("accel_z", 9.81 + 0.1 * RAMP, "m/s2"), ("accel_z", 1.0 + 0.01 * RAMP, ""),
        ("whatever", RAMP, ""), ("q", RAMP, ""), ("theta", RAMP, "rad"), ("tick_u32", RAMP, ""),
        ("u", RAMP, "V"), ("i1", RAMP, "A"),
    ],
)  # fmt: skip
def test_sizes_tell_a_unit_or_that_they_do_not(name: str, values: np.ndarray, unit: str) -> None:
    guess = guess_unit(name, values)
    assert (guess.unit, guess.sure) == (unit, False)
    assert guess.reason
    assert guess_unit(name, values, said="kg").unit == "kg"  # what the log says goes first


@pytest.mark.parametrize(("unit", "turn"), [("rad", 2 * np.pi), ("deg", 360.0)])
def test_jumps_by_a_turn_tell_an_angle(unit: str, turn: float) -> None:
    angle = turn * np.linspace(0.0, 3.2, 2000)
    wrapped = (angle + turn / 2) % turn - turn / 2
    assert turn_of(wrapped) == (unit, turn, 3)
    assert guess_unit("a", wrapped).unit == unit
    # what counts on, steps of another size, and noise of that size are none
    jumps = np.repeat([-3.0, 3.0, -2.0, 2.9], 500) * turn / 6.0
    for other in (angle, jumps, np.where(wrapped > 0, 0.5 * turn, 0.0),
                  np.random.default_rng(1).uniform(-turn / 2, turn / 2, 2000)):  # fmt: skip
        assert turn_of(other) == ("", 0.0, 0)


@pytest.mark.parametrize(
    ("name", "first", "step", "unit"),
    [
        ("t", 0.0, 0.004, "s"), ("t", 0.0, 4.0, "ms"), ("t", 0.0, 4000.0, "us"),
        ("t_ms", 0.0, 0.004, "ms"), ("stamp", 1.7e9, 0.01, "s"), ("stamp", 1.7e12, 10.0, "ms"),
        ("stamp", 1.7e15, 1e4, "us"), ("stamp", 1.7e18, 1e7, "ns"), ("t", 0.0, 1e-7, ""),
    ],
)  # fmt: skip
def test_unit_of_a_clock(name: str, first: float, step: float, unit: str) -> None:
    assert guess_time(name, first + step * np.arange(100)).unit == unit


@pytest.mark.parametrize(
    ("name", "first", "step", "unit"),
    [
        ("t", 1.8e13, 2e7, "ns"), ("micros", 1.5e8, 2e4, "us"), ("micros", 2e9, 2e4, "us"),
        ("millis", 1.08e8, 20.0, "ms"), ("t", 9e8, 2e7, "ns"), ("t", 2e12, 2e7, "ns"),
        ("stamp_ns", 5e12, 2e7, "ns"), ("stamp_ns", 2e12, 2e7, "ns"),
    ],
)  # fmt: skip
def test_what_counts_since_boot_is_no_time_since_1970(
    name: str, first: float, step: float, unit: str
) -> None:
    clock = find_clock(_topic(**{name: first + step * np.arange(1000)}))
    assert (clock.unit.unit, clock.began()) == (unit, "")
    # factor of the unit times the step, in doubles
    assert clock.interval == pytest.approx(step * {"ns": 1e-9, "us": 1e-6, "ms": 1e-3}[unit])


@pytest.mark.parametrize(("first", "step"), [(1.7e9, 10.0), (1.7e12, 6e4), (1.7e18, 3.6e12)])
def test_slow_logs_have_times_since_1970(first: float, step: float) -> None:
    assert find_clock(_topic(t=first + step * np.arange(100))).began().startswith("2023-11")


def _topic(**columns: np.ndarray) -> Topic:
    return Topic("x", "CSV", Log("x", columns))


def test_a_clock_is_found_by_name_or_as_the_first_that_rises_evenly() -> None:
    even, walk = 0.01 * np.arange(200), np.cumsum(np.random.default_rng(2).exponential(1.0, 200))
    assert find_clock(_topic(a=even, time=walk)).column == "time"
    assert find_clock(_topic(a=even, b=walk)).column == "a"
    assert find_clock(_topic(a=walk, b=even)).column == ""
    assert find_clock(_topic(time=RAMP[::-1], b=RAMP[::-1])).column == ""


def test_a_clock_knows_rate_jitter_gaps_and_what_stands_still() -> None:
    times = 0.01 * np.arange(300.0)
    plain = find_clock(_topic(t=times))
    assert plain.interval == pytest.approx(0.01, rel=1e-9)  # rounding
    assert (plain.jitter < 1e-9, plain.gaps, plain.same, plain.back) == (True, (), 0, 0)
    odd = times.copy()
    odd[100:] += 0.5
    odd[200] = odd[199]
    odd[250] -= 0.02
    found = find_clock(_topic(t=odd))
    assert [gap[1] for gap in found.gaps] == pytest.approx([0.51])
    assert (found.same, found.back) == (1, 1)
    noisy = find_clock(_topic(t=times + np.random.default_rng(3).uniform(0, 0.005, 300)))
    # the difference of two uniform values of width h / 2 has the deviation h / 2 / sqrt(6)
    assert noisy.jitter == pytest.approx(0.5 / np.sqrt(6.0), rel=0.15)
    assert noisy.began() == "" and find_clock(_topic(t=1.7e9 + times)).began().startswith("2023-11")
