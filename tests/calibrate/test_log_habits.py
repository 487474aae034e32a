"""Logs as people write them: what is read right, and what is refused in one sentence."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cosim.calibrate import Problem, read_problem
from cosim.calibrate.checks.examine import examine
from cosim.calibrate.checks.finding import Finding
from cosim.data.logs import read_log
from cosim.errors import InputError, ScenarioError, UnitError, UnknownNameError, ValueRangeError
from tests.problems import simulator

STEP, SIZE, J, B = 0.01, 300, 0.5, 1.0
TIMES = np.arange(SIZE) * STEP
TORQUE = np.repeat(np.random.default_rng(1).uniform(-3.0, 3.0, SIZE // 30), 30)
MAPPING = """
system = "system.toml"
step = 0.01
algorithm = "gauss_seidel"
TOP
[columns]
COLUMNS
[inputs]
"load.tau" = INPUT
[channels]
w = { signal = "load.w", sigma = 0.01 CHANNEL }
[[parameter]]
name = "b"
unit = "N.m.s/rad"
nominal = 0.9
min = 0.5
max = 2.0
targets = "load.b"
[[run]]
name = "one"
file = "one.csv"
purpose = "identification"
RUN
"""


def speed() -> np.ndarray:
    """J dw/dt = tau - b w from rest, with the torque held between samples."""
    w, keep = np.zeros(SIZE), np.exp(-B * STEP / J)
    for k in range(SIZE - 1):
        w[k + 1] = keep * w[k] + (1.0 - keep) * TORQUE[k] / B
    return w + 0.01 * np.random.default_rng(2).normal(size=SIZE)


SPEED = speed()


def written(heads: str = "time,tau,w", separator: str = ",", *columns: np.ndarray) -> str:
    rows = np.column_stack(columns or (TIMES, TORQUE, SPEED))
    cells = [separator.join(f"{value:.13g}" for value in row) for row in rows]
    return "\n".join([heads.replace(",", separator), *cells]) + "\n"


def read(folder: Path, log: str | bytes, **parts: str) -> Problem:
    """The problem that a log and parts of the mapping make."""
    text = MAPPING
    for key, usual in {
        "TOP": "",
        "COLUMNS": "",
        "INPUT": '"tau"',
        "CHANNEL": "",
        "RUN": "",
    }.items():
        text = text.replace(key, parts.get(key, usual))
    (folder / "dataset.toml").write_text(text)
    (folder / "system.toml").write_text(
        'description = "Load."\nconnections = []\n[instances]\nload = "inertia/disc"\n'
        f'[parameters]\n"load.J" = {J}\n'
    )
    raw = log if isinstance(log, bytes) else log.encode()
    (folder / "one.csv").write_bytes(raw)
    return read_problem(folder)


def same(problem: Problem) -> None:
    """Whether it is the log, to the nine digits that were written."""
    run = problem.run("one")
    np.testing.assert_allclose(run.times, TIMES, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.data[:, 0], SPEED, rtol=1e-8, atol=1e-9)
    torque = np.asarray(run.inputs["load.tau"].at(run.times))
    np.testing.assert_allclose(torque, TORQUE, rtol=1e-8)


@pytest.mark.parametrize(
    "write",
    [
        lambda: written(separator=";"),
        lambda: written(separator=";").replace(".", ","),
        lambda: written(separator="\t"),
        lambda: written(separator="\t").replace(".", ","),
        lambda: written().encode("utf-16"),
        lambda: written().encode("utf-8-sig"),
        lambda: "# " + written(),
        lambda: written("time,tau,w\ns,N.m,rad/s"),
        lambda: written("time [s],tau [Nm],w [°/s]", ",", TIMES, TORQUE, np.degrees(SPEED)).encode(
            "latin-1"
        ),
        lambda: written("time [ms],tau [N.cm],w [rpm]", ";", 1e3 * TIMES, 1e2 * TORQUE,
                        SPEED * 30.0 / np.pi).replace(".0000", ".00"),
        lambda: '"time","tau","w"\n' + written().partition("\n")[2],
        lambda: "\n\n" + written().replace(",", ", "),
        lambda: written().replace("-", "\u2212"),
        lambda: "".join(
            ",".join(f'"{cell}"' for cell in row.replace(".", ",").split(";")) + "\n"
            for row in written(separator=";").splitlines()),  # decimal commas in quotes
    ],
)  # fmt: skip
def test_other_clothes(tmp_path: Path, write: Callable[[], str | bytes]) -> None:
    log = write()
    heads = log if isinstance(log, str) else log.decode("utf-16" if b"\0" in log else "latin-1")
    channel = ', unit = "rad/s"' if "rpm" in heads or "°" in heads else ""
    for name in ("tau", "w"):
        heads = heads.replace(f"{name} [", name + "[")
    same(read(tmp_path, log, CHANNEL=channel))


def test_nanoseconds_since_1970_are_exact(tmp_path: Path) -> None:
    begin = 1_764_040_000_000_000_000
    rows = [f"{begin + 10_000_000 * k},{TORQUE[k]:.9g},{SPEED[k]:.9g}" for k in range(SIZE)]
    log = "time,tau,w\n" + "\n".join(rows) + "\n"
    run = read(tmp_path, log).run("one")
    # 15 digits are left of 1e15 ns, a tenth of a nanosecond
    np.testing.assert_allclose(run.times, TIMES, rtol=0, atol=1e-9)


def test_a_clock_in_a_unit_that_nothing_tells_takes_no_memory(tmp_path: Path) -> None:
    """Nanoseconds since a computer began, taken as seconds: 3e11 steps."""
    log = written("time,tau,w", ",", 1e9 * TIMES, TORQUE, SPEED)
    problem = read(tmp_path, log)
    with pytest.raises(ValueRangeError, match=r"one: its samples are 1e\+07 s apart, so it takes"):
        simulator(problem).simulate(problem.nominal, "one")


def test_cells_without_a_number_are_gaps_and_counted(tmp_path: Path) -> None:
    rows = written().splitlines()
    for row, cell in ((101, "N/A"), (102, ""), (150, "NaN"), (160, "#REF!")):
        time, torque, _ = rows[row].split(",")
        rows[row] = f"{time},{torque},{cell}"
    problem = read(tmp_path, "\n".join(rows))
    lost = np.flatnonzero(~np.isfinite(problem.run("one").data[:, 0]))
    assert lost.tolist() == [100, 101, 149, 159]
    said = [f for f in problem.source.findings if f.kind == "gaps"]
    assert [(f.severity, f.column) for f in said] == [("warning", "w")]
    assert "4 of 300 cells hold no number (the first 'N/A' in row 101)" in said[0].text


def cells_of(*cells: str, separator: str = ";", time: Callable[[int], str] = str) -> str:
    """A log whose column w is these cells again and again."""
    rows = [f"{time(k)}{separator}1{separator}{cells[k % len(cells)]}" for k in range(90)]
    return "\n".join([f"time{separator}tau{separator}w", *rows]) + "\n"


@pytest.mark.parametrize(
    ("log", "message"),
    [
        (cells_of("998", "1,002"), "'w' has the cell '1,002', which may mean 1002 or 1.002"),
        (cells_of("998.5", "1,002"), "'w' has the cells '1,002' and '998.5'; write numbers with"),
        (cells_of("998,5", "1.002,5"), "has the cell '1.002,5'; write numbers without separators"),
        (cells_of("998", '"1,002.5"', separator=","), "'w' has the cell '1,002.5'; write numbers"),
        (cells_of("998,5", "1\u202f002,5"), r"has the cell '1\u202f002,5'; write numbers without"),
        (cells_of("998", "999", "1.02 rad/s"), "'w' has the cell '1.02 rad/s' among numbers; "),
        (cells_of("998", "999", "1.02", time=lambda k: f"{1000 + 10 * k:,}"), "'1,000', which"),
        (cells_of("998", "1.234", time=lambda k: f"0,{k:02}"), "may mean 1234 or, beside the"),
        (cells_of("998", "999", "1.234.567"), "'w' has the cell '1.234.567'; write numbers"),
    ],
)
def test_numbers_that_may_mean_others(tmp_path: Path, log: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=re.escape(message)):
        read(tmp_path, log)


@pytest.mark.parametrize(
    "cells", [("998", "1,25"), ("0,998", "1,002"), ("998", "999 #"), ("1", "2")]
)
def test_numbers_that_can_mean_one_thing_only(tmp_path: Path, cells: tuple[str, ...]) -> None:
    (tmp_path / "log.csv").write_text(cells_of(*cells, *["1"] * 8), encoding="utf-8")
    wanted = [float(cell.replace(",", ".").rstrip(" #")) for cell in cells]
    found = read_log(tmp_path / "log.csv")["w"][:2]
    assert [w for w, f in zip(wanted, found, strict=True) if np.isfinite(f)] == [
        f for f in found if np.isfinite(f)]  # fmt: skip


@pytest.mark.parametrize("cells", [("0.998", "1.234"), ("998.5", "1.234"), ("1.2345", "1.234")])
def test_points_beside_decimal_commas_that_separate_no_thousands(
    tmp_path: Path, cells: tuple[str, ...]
) -> None:
    log = cells_of(*cells, time=lambda k: f"0,{k:02}")
    (tmp_path / "log.csv").write_text(log, encoding="utf-8")
    assert read_log(tmp_path / "log.csv")["w"][:2].tolist() == [float(cell) for cell in cells]


def test_an_unclear_column_that_nobody_uses(tmp_path: Path) -> None:
    rows = written().splitlines()
    log = "\n".join([rows[0] + ",id", *(f'{row},"{k},0.5"' if k % 2 else f"{row},{k}"
                                        for k, row in enumerate(rows[1:]))])  # fmt: skip
    same(read(tmp_path, log))


def test_text_that_is_numbers_in_parquet_is_numbers(tmp_path: Path) -> None:
    read(tmp_path, written())
    table = pd.DataFrame({"time": TIMES, "tau": TORQUE, "w": [f"{x:.9g}" for x in SPEED]})
    table.to_parquet(tmp_path / "one.parquet")
    text = (tmp_path / "dataset.toml").read_text().replace("one.csv", "one.parquet")
    (tmp_path / "dataset.toml").write_text(text)
    same(read_problem(tmp_path))


@pytest.mark.parametrize(
    ("log", "message"),
    [
        (lambda: "", "is empty"),
        (lambda: "time,tau,w\n", "its clock 'time' has no values; the log has no rows"),
        (lambda: written().partition("\n")[2], "the first row must name the columns"),
        (lambda: written("time,tau,tau"), "has two columns 'tau'"),
        (lambda: written("time,tau,v"), "channel w: "),
        (lambda: written("time,tau,W"), "has no column 'w'; did you mean 'W'?"),
        (lambda: "time,tau,w\n" + "".join(f"{k},1,on\n" for k in range(90)),
         "column 'w' holds text: 90 of 90 cells"),
        (lambda: written().replace(",", ",1,").replace("time,1,tau,1,w", "time,tau,w"),
         "has 5 cells, but the head names 3 columns"),
        (lambda: written() + "9,1,2,\n9.1,1,2,,4\n", "row 302 has 5 cells"),
        (lambda: b"time,tau,w\n0,1,2\0,\n", "is no text"),
    ],
)  # fmt: skip
def test_what_is_not_read_is_refused(
    tmp_path: Path, log: Callable[[], str | bytes], message: str
) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        read(tmp_path, log())


def test_times_that_go_back_or_stand_still(tmp_path: Path) -> None:
    back = np.where(TIMES > 2.0, TIMES - 0.5, TIMES)
    with pytest.raises(ScenarioError, match=r"clock 'time' goes back by 0.49.* after row 201"):
        read(tmp_path, written("time,tau,w", ",", back, TORQUE, SPEED))
    rows = written().splitlines()
    with pytest.raises(ScenarioError, match=r"stands still after row 5"):
        read(tmp_path, "\n".join([*rows[:6], rows[5], *rows[6:]]))
    with pytest.raises(ScenarioError, match=r"stands still after row 1, and so in 299 places"):
        read(tmp_path, written("time,tau,w", ",", np.full(TIMES.size, 0.5), TORQUE, SPEED))


@pytest.mark.parametrize("jump", [0.8, 1.7e9])
def test_a_gap_in_the_inputs_ends_the_run(tmp_path: Path, jump: float) -> None:
    later = np.where(TIMES > 1.995, TIMES + jump, TIMES)
    problem = read(tmp_path, written("time,tau,w", ",", later, TORQUE, SPEED))
    assert problem.run("one").times[-1] == pytest.approx(1.99)
    said = [f for f in problem.source.findings if f.kind == "gap"]
    assert "33% of it is not used" in said[0].text and said[0].severity == "warning"
    if jump < 1.0:  # bridged on demand
        whole = read(tmp_path, (tmp_path / "one.csv").read_text(), TOP="gap = 1.0")
        assert whole.run("one").times.size == SIZE
    else:
        with pytest.raises(ScenarioError, match=r"clock 'time' jumps by 1.7e.09 after row 200"):
            read(tmp_path, (tmp_path / "one.csv").read_text(), TOP="resample = 0.01")


def test_units_are_converted_and_not_labels(tmp_path: Path) -> None:
    plain = read(tmp_path, written())
    rpm = SPEED * 30.0 / np.pi
    log = written("time,tau,w", ",", TIMES, TORQUE, rpm)
    # the column is in the channel's unit, and so is what the model gives
    of_channel = read(tmp_path, log, CHANNEL=', unit = "rpm"')
    theta = plain.nominal
    expected = simulator(plain).simulate(theta, "one") * 30.0 / np.pi
    np.testing.assert_allclose(simulator(of_channel).simulate(theta, "one"), expected, rtol=1e-12)
    np.testing.assert_allclose(of_channel.run("one").data[:, 0], rpm, rtol=1e-8)
    same(read(tmp_path, log, COLUMNS='w = { from = "rpm", unit = "rad/s" }'))
    rounded = read(tmp_path, log, COLUMNS='w = { from = "rpm", unit = "rad/s", scale = 0.10472 }')
    np.testing.assert_allclose(rounded.run("one").data[:, 0], SPEED, rtol=3e-6)  # as it was given
    turned = read(tmp_path, log, COLUMNS='w = { from = "rpm", unit = "rad/s", scale = -1 }')
    np.testing.assert_allclose(turned.run("one").data[:, 0], -SPEED, rtol=1e-8)
    with pytest.raises(UnitError, match=r"'rpm' becomes 'rad/s' by 0.10472, and scale = 0.5 may"):
        read(tmp_path, log, COLUMNS='w = { from = "rpm", unit = "rad/s", scale = 0.5 }')
    with pytest.raises(UnitError, match=r"input load.tau.* 'A' .* does not convert into 'N.m'"):
        read(tmp_path, log, COLUMNS='tau = { unit = "A" }')
    read(tmp_path, log, COLUMNS='tau = { unit = "A" }', INPUT='{ column = "tau", gain = 0.1 }')
    with pytest.raises(UnitError, match=r"channel w: 'rad/s' .* does not convert into 'A'"):
        read(tmp_path, log, CHANNEL=', unit = "A"')


def test_an_angle_is_unwrapped_in_its_own_unit(tmp_path: Path) -> None:
    angle = 200.0 * TIMES
    log = written("time,tau,w", ",", TIMES, TORQUE, np.mod(angle, 360.0))
    text = 'a = { source = "w", from = "deg", unit = "rad", unwrap = true }'
    problem = read(tmp_path, log, COLUMNS=text, INPUT='{ column = "a", gain = 1.0 }')
    told = np.asarray(problem.run("one").inputs["load.tau"].at(TIMES))
    np.testing.assert_allclose(told, np.radians(angle), atol=1e-7)
    with pytest.raises(ScenarioError, match=r"unwrap = true takes a turn of 6.28319, but"):
        read(tmp_path, log, COLUMNS='a = { source = "w", unwrap = true }', INPUT='"a"')


def test_a_count_begins_anew_where_its_values_may(tmp_path: Path) -> None:
    """Eight bits begin anew at 256: at 255 the count would lose one per turn, without a word."""
    count = 7.0 * np.arange(SIZE)
    log = written("time,tau,w", ",", TIMES, TORQUE, np.mod(count, 256.0))
    entry = 'a = {{ source = "w", unwrap = {} }}'
    problem = read(tmp_path, log, COLUMNS=entry.format(256), INPUT='"a"')
    np.testing.assert_allclose(problem.run("one").inputs["load.tau"].at(TIMES), count, atol=1e-6)
    with pytest.raises(ScenarioError, match=r"unwrap = 255 .* span 255; counts from 0 to 255 beg"):
        read(tmp_path, log, COLUMNS=entry.format(255), INPUT='"a"')
    with pytest.raises(ScenarioError, match=r"unwrap = 128 .* but its values span 255$"):
        read(tmp_path, log, COLUMNS=entry.format(128), INPUT='"a"')


def test_quaternions_of_any_one_length(tmp_path: Path) -> None:
    yaw = 0.3 * TIMES
    sign = np.where(np.arange(SIZE) % 7 < 3, -1.0, 1.0)  # the same turn
    parts = [0.0 * yaw, 0.0 * yaw, sign * np.sin(yaw / 2), sign * np.cos(yaw / 2)]
    heads, entry = "time,tau,w,x,y,z,q", 'a = { quaternion = ["x", "y", "z", "q"], unwrap = true }'
    for size in (1.0, 1.02, 16384.0):
        log = written(heads, ",", TIMES, TORQUE, SPEED, *(size * p for p in parts))
        problem = read(tmp_path, log, COLUMNS=entry, INPUT='{ column = "a", gain = 1.0 }')
        told = np.asarray(problem.run("one").inputs["load.tau"].at(TIMES))
        np.testing.assert_allclose(told, yaw, atol=1e-7)
    parts[0] = 0.01 * np.arange(SIZE)
    with pytest.raises(ScenarioError, match=r"quaternions of lengths 1 to 3\.\d+; they must be 1"):
        read(tmp_path, written(heads, ",", TIMES, TORQUE, SPEED, *parts), COLUMNS=entry)


def test_two_files_of_a_run_are_joined_on_their_own_clocks(tmp_path: Path) -> None:
    begin = 1_764_040_000_000_000_000
    rows = [f"{begin + 10_000_000 * k},{TORQUE[k]:.9g}" for k in range(SIZE)]
    (tmp_path / "command.csv").write_text("stamp,tau\n" + "\n".join(rows) + "\n")
    own = 0.1 + np.arange(0.005, TIMES[-1], 0.004)  # this clock is 0.1 s late
    seen = np.interp(own - 0.1, TIMES, SPEED)
    rows = [f"{begin + round(1e9 * t)},{v:.12g}" for t, v in zip(own, seen, strict=True)]
    (tmp_path / "sensor.csv").write_text("stamp,w\n" + "\n".join(rows) + "\n")
    mapping = 'files = { command = "command.csv", sensor = "sensor.csv" }'
    read(tmp_path, written())
    text = (tmp_path / "dataset.toml").read_text().replace('file = "one.csv"', mapping)
    text = text.replace("[columns]", '[columns]\ntau = { source = "command.tau" }\n'
                        'w = { source = "sensor.w", late = 0.1 }')  # fmt: skip
    (tmp_path / "dataset.toml").write_text('time = "command.stamp"\n' + text)
    run = read_problem(tmp_path).run("one")
    np.testing.assert_allclose(run.times, TIMES, atol=1e-9)
    good = np.isfinite(run.data[:, 0])
    assert np.count_nonzero(~good) == 2  # before its first and after its last sample
    # between samples 4 ms apart, noise of 0.01 on a line between neighbours 10 ms apart
    assert np.max(np.abs(run.data[good, 0] - SPEED[good])) < 0.02


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"TOP": 'algoritm = "jacobi"'}, "has no key 'algoritm'; did you mean 'algorithm'?"),
        ({"CHANNEL": ", sigmma = 1.0"}, "w: has no key 'sigmma'; did you mean 'sigma' or 'sig"),
        ({"CHANNEL": ', transform = "means"'}, "transform 'means' is not known; did you mean"),
        ({"INPUT": '{ column = "tau", interpolation = "lin" }'}, "'lin' is not known; did you"),
        ({"TOP": "period = -1.0"}, "period must be greater than 0, not -1.0"),
        ({"TOP": 'diagnosed = "yes"'}, "diagnosed must be true or false, not 'yes'"),
        ({"TOP": "lead = true"}, "lead must be a number, not True"),
        ({"TOP": '[checks]\nallow = ["spike"]'}, "'spike' is no kind of finding; did you"),
        ({"TOP": '[checks]\nallow = ["short"]'}, "'short' (too few samples) stops any fit"),
        ({"TOP": "only = { flor = 1 }"}, "only: no run has 'flor'"),
        ({"TOP": '[parameters]\n"load.J" = "big"'}, "load.J must be a number, not 'big'"),
        ({"CHANNEL": ', unit = "rdd/s"'}, "unit 'rdd/s': 'rdd' is not a known unit"),
        ({"RUN": 'sampels = [1, 100]'}, "run 'one': has 'sampels'; did you mean 'samples'?"),
    ],
)  # fmt: skip
def test_misspelt_keys_and_values_have_near_names(
    tmp_path: Path, parts: dict[str, str], message: str
) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        read(tmp_path, written(), **parts)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('purpose = "identification"', 'purpose = "valid"',
         "its purpose 'valid' is not known; did you mean 'validation'?"),
        ('purpose = "identification"', 'purpos = "identification"', "did you mean 'purpose'?"),
        ('file = "one.csv"', 'file = "won.csv"', "there is no such file; in its folder did"),
        ('signal = "load.w"', 'signal = "load.v"', "channel w: "),
        ('targets = "load.b"', "targets = 3", "parameter b: targets must be a variable, a list of"),
    ],
)  # fmt: skip
def test_faults_of_runs_and_signals(tmp_path: Path, old: str, new: str, message: str) -> None:
    read(tmp_path, written())
    path = tmp_path / "dataset.toml"
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(InputError, match=re.escape(message)):
        read_problem(tmp_path)


def test_a_vector_among_the_constants_sets_its_elements(tmp_path: Path) -> None:
    problem = read(tmp_path, written(), TOP='[parameters]\n"load.x" = [1.0, 2.0]')
    assert problem.constants == {"load.x[1]": 1.0, "load.x[2]": 2.0}
    with pytest.raises(UnknownNameError, match=r"load"):
        simulator(problem).simulate(problem.nominal, "one")


def kinds(findings: list[Finding], severity: str = "error") -> set[str]:
    return {f.kind for f in findings if f.severity == severity}


def test_steps_and_starts_that_do_not_fit_are_named(tmp_path: Path) -> None:
    assert not kinds(examine(simulator(read(tmp_path, written()))))
    problem = read(tmp_path, written()).changed(step=0.004)
    found = examine(simulator(problem))
    assert kinds(found) == {"step"}
    assert "does not divide (2.5 steps)" in found[0].text
    moving = written("time,tau,w", ",", TIMES, TORQUE, SPEED + 2.0 * np.exp(-2.0 * TIMES))
    found = examine(simulator(read(tmp_path, moving)))
    assert kinds(found) == {"start"}
    off, behind = SPEED[:5] + 2.0 * np.exp(-2.0 * TIMES[:5]), found[-1].text.partition("(w ")[2]
    assert float(behind.split()[0]) == pytest.approx(off.mean(), rel=1e-3)  # four digits
    # one noisy sample is no start: what is estimated is advised before what is taken as exact
    advice = [behind.index(part) for part in ("[[nuisance]]", "without noise", "[starts]")]
    assert advice == sorted(advice)
    stated = read(tmp_path, moving, TOP='[starts]\n"first:w" = "load.speed"')
    assert not kinds(examine(simulator(stated)))
    passed = read(tmp_path, moving, TOP='[checks]\nallow = ["start"]')
    found = examine(simulator(passed))
    assert "start" in kinds(found, "warning") and not kinds(found)


def test_a_variable_that_two_parameters_set(tmp_path: Path) -> None:
    text = written()
    again = '[[parameter]]\nname = "c"\nnominal = 0.9\nmin = 0.5\nmax = 2.0\ntargets = "load.b"\n'
    with pytest.raises(ScenarioError, match="parameters 'b' and 'c' both set load"):
        read(tmp_path, text, RUN=again)
    with pytest.raises(ScenarioError, match=r"dataset\.toml: run one: .*two columns 'tau'"):
        read(tmp_path, written("time,tau,tau"))  # named by the file that lists the runs


def test_a_folder_that_does_not_exist_is_named(tmp_path: Path) -> None:
    (tmp_path / "somewhere").mkdir()
    with pytest.raises(ScenarioError, match=r"no such folder; beside it did you mean 'some"):
        read_problem(tmp_path / "somwhere")
    with pytest.raises(ScenarioError, match=r"has no set.toml that names a rig, and there is no"):
        read_problem(tmp_path / "somewhere")
