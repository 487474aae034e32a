"""Which column is which variable: by flags, by names and units, or asked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from cosim.errors import InputError, UnitError, UnknownNameError
from cosim.intake.given import parameters_of, runs_of, take
from cosim.intake.guess import Guess
from cosim.intake.matching import Column, Matches, Place, guess
from cosim.intake.runs import purposes
from cosim.intake.words import words


def place(name: str, unit: str, role: str, text: str = "") -> Place:
    instance, _, variable = name.partition(".")
    weights = {word: 0.5 for word in words(instance)} | {word: 1.0 for word in words(variable)}
    return Place(name, unit, role, text, weights)


PLACES = [
    place("motor.u_set", "V", "input"), place("motor.w_ref", "rad/s", "input"),
    place("base.w_l", "rad/s", "input"), place("base.w_r", "rad/s", "input"),
    place("motor.w", "rad/s", "output"), place("motor.i", "A", "output"),
    place("base.x", "m", "output"), place("base.y", "m", "output"),
    place("base.phi", "rad", "output"), place("load.w", "rad/s", "output"),
]  # fmt: skip


def column(name: str, unit: str = "", part: str = "", **more: bool) -> Column:
    return Column(part, name, Guess(unit, "its name ends with it", sure=bool(unit)), **more)


def matched(columns: list[Column]) -> tuple[dict[str, str], dict[str, str], Matches]:
    matches = Matches()
    guess(columns, PLACES, matches)
    drives = {name: m.column.source for name, m in matches.inputs.items()}
    return drives, {name: m.column.source for name, m in matches.channels.items()}, matches


def test_names_and_units_tell() -> None:
    drives, measures, _ = matched([
        column("left_rpm", "rpm", "cmd", command=True),
        column("right_rpm", "rpm", "cmd", command=True),
        column("px_mm", "mm"), column("py_mm", "mm"), column("heading_deg", "deg"),
        column("PWM_volt", "V"), column("MotSpd_rpm", "rpm"), column("I_mA", "mA"),
    ])  # fmt: skip
    assert drives == {
        "motor.u_set": "PWM_volt", "base.w_l": "cmd.left_rpm", "base.w_r": "cmd.right_rpm",
    }  # fmt: skip
    assert measures == {
        "base.x": "px_mm", "base.y": "py_mm", "base.phi": "heading_deg", "motor.w": "MotSpd_rpm",
        "motor.i": "I_mA",
    }  # fmt: skip


def test_a_column_with_a_variables_own_name_is_it() -> None:
    # "turns left" in what is said of the base's turning rate had made `w_l` a measurement of it
    turning = place("base.w_z", "rad/s", "output")
    turning = replace(turning, words={**turning.words, "left": 0.3})
    matches = Matches()
    guess([column("w_l", "rad/s"), column("w_r", "rad/s")], [*PLACES, turning], matches)
    drives = {name: m.column.source for name, m in matches.inputs.items()}
    assert drives == {"base.w_l": "w_l", "base.w_r": "w_r"} and not matches.channels
    # two of that name: neither
    drives, measures, matches = matched([column("w", "rad/s")])
    assert not drives and not measures and matches.unsure["w"] == ["motor.w", "load.w"]


def test_theta_beside_x_and_y_is_a_heading() -> None:
    _, measures, _ = matched([column("x", "m"), column("y", "m"), column("theta", "rad")])
    assert measures == {"base.x": "x", "base.y": "y", "base.phi": "theta"}


def test_a_measured_speed_drives_nothing_and_a_command_is_no_measurement() -> None:
    drives, measures, _ = matched([column("motor_speed", "rad/s")])
    assert (drives, measures) == ({}, {"motor.w": "motor_speed"})
    drives, measures, _ = matched([column("motor_speed_cmd", "rad/s")])
    assert (drives, measures) == ({"motor.w_ref": "motor_speed_cmd"}, {})


def test_what_may_be_two_things_is_not_guessed() -> None:
    drives, measures, matches = matched([column("speed", "rad/s")])
    assert (drives, measures) == ({}, {})
    assert set(matches.unsure["speed"]) == {"motor.w", "load.w"}
    # two columns for one variable
    _, measures, matches = matched([column("heading_deg", "deg"), column("yaw_rad", "rad")])
    assert measures == {}
    assert matches.unsure == {"heading_deg": ["base.phi"], "yaw_rad": ["base.phi"]}


def test_units_that_do_not_fit_and_columns_that_stand_still_are_nothing() -> None:
    assert matched([column("motor_i", "V")])[1] == {}
    assert matched([column("I_mA", "mA", moves=False)])[1] == {}


def test_the_only_command_in_a_unit_is_it() -> None:
    drives, _, _ = matched([column("linear_x", "V", "cmd_vel", command=True)])
    assert drives == {"motor.u_set": "cmd_vel.linear_x"}
    drives, _, _ = matched([column("angular_z", "rad/s", "cmd_vel", command=True)])
    assert drives == {}  # three inputs are in rad/s


def test_inputs_that_no_column_can_be_stay_at_their_start_value() -> None:
    _, _, matches = matched([column("PWM_volt", "V")])
    assert set(matches.left) == {"motor.w_ref", "base.w_l", "base.w_r"}
    assert matches.open == []
    _, _, matches = matched([column("PWM_volt", "V"), column("a", "rad/s")])
    assert {p.name for p in matches.open} == {"motor.w_ref", "base.w_l", "base.w_r"}


COLUMNS = [column("I_mA", "mA"), column("v", "", "a"), column("v", "", "b"), column("n")]


def test_flags_go_first() -> None:
    matches = take(["a.v=motor.w:rpm", "0.5=motor.w_ref"], COLUMNS, PLACES)
    assert matches.channels["motor.w"].column.unit.unit == "rpm"
    assert matches.constants == {"motor.w_ref": 0.5}


@pytest.mark.parametrize(
    ("given", "error", "said"),
    [
        ("I_mA", InputError, "write --map 'COLUMN=instance.variable[:unit]'"),
        ("I_mA=motor.j", UnknownNameError, "'motor.j' is no open input and no output"),
        ("I_m=motor.i", UnknownNameError, "did you mean 'I_mA'"),
        ("v=motor.w", UnknownNameError, "in several parts; write one of a.v, b.v"),
        (
            "I_mA=motor.w",
            UnitError,
            "the column is in 'mA' (its name ends with it), but motor.w in",
        ),
        ("n=motor.w:rmp", UnitError, "'rmp' is not a known unit"),
        ("3=motor.w", InputError, "motor.w is an output; name the column that it is"),
    ],
)
def test_wrong_flags_are_named(given: str, error: type[Exception], said: str) -> None:
    with pytest.raises(error) as caught:
        take([given], COLUMNS, PLACES)
    assert f"--map {given}" in str(caught.value) and said in str(caught.value)


def test_a_variable_is_one_column() -> None:
    with pytest.raises(InputError, match=r"motor\.w is a\.v already"):
        take(["a.v=motor.w:rpm", "b.v=motor.w:rpm"], COLUMNS, PLACES)


def test_the_last_of_several_runs_validates() -> None:
    assert list(purposes(["a", "b", "c"], []).values()) == ["identification"] * 2 + ["validation"]
    assert purposes(["a"], []) == {"a": "identification"}
    assert purposes(["a", "b"], ["a"]) == {"a": "validation", "b": "identification"}
    with pytest.raises(InputError, match=r"--validation x: there is no such run; there is a, b"):
        purposes(["a", "b"], ["x"])
    with pytest.raises(InputError, match="leave one that is fitted"):
        purposes(["a"], ["a"])


def test_runs_and_parameters_of_the_command_line() -> None:
    assert runs_of(["a=x.csv,y.csv"]) == {"a": [Path("x.csv"), Path("y.csv")]}
    assert parameters_of(["b.r", "b.t=2", "b.k=0:-1:1"]) == {
        "b.r": (), "b.t": (2.0,), "b.k": (0.0, -1.0, 1.0),
    }  # fmt: skip
    for wrong in ("a", "=x", "a="):
        with pytest.raises(InputError, match="write --run NAME=FILE"):
            runs_of([wrong])
    for wrong in ("b.r=x", "b.r=1:2"):
        with pytest.raises(InputError, match=r"write instance\.name"):
            parameters_of([wrong])
