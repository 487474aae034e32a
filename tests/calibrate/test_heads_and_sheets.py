"""Units and noise that heads of logs and rig sheets state: what becomes of them on the way."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate import Problem, read_problem
from cosim.errors import ScenarioError, UnitError
from tests.calibrate.test_log_habits import SIZE, SPEED, STEP, TIMES, TORQUE, read, written

TURNED = np.degrees(SPEED)
SET = """
set = "x"
rig = "disc"
sheet = "rig.toml"
[[run]]
name = "one"
file = "one.csv"
purpose = "identification"
"""


def stated(folder: Path, signals: str, log: str, text: str = SET, **parts: str) -> Problem:
    """The problem of a log with a rig sheet, whose noise counts."""
    (folder / "set.toml").write_text(text)
    (folder / "rig.toml").write_text(signals)
    read(folder, log, **parts)
    mapping = folder / "dataset.toml"
    mapping.write_text(mapping.read_text().replace(", sigma = 0.01 ", " "))
    return read_problem(folder)


def signal(name: str, unit: str, noise: float = 0.0) -> str:
    return f'[[signal]]\nname = "{name}"\nunit = "{unit}"\nnoise_sigma = {noise}\n'


def right(problem: Problem, sigma: float) -> None:
    """Whether the channel is the speed, with this noise, as it drives no factor."""
    (channel,) = problem.channels
    assert channel.sigma == pytest.approx(sigma, rel=1e-12)
    assert channel.gain == 1.0
    np.testing.assert_allclose(problem.run("one").data[:, 0], SPEED, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize(
    ("sheet", "head", "column"),
    [
        ("w", "w", 'w = { unit = "rad/s" }'),
        ("w", "w", "w = { scale = 0.017453292519943295 }"),
        ("w", "w", 'w = { scale = 0.017453292519943295, unit = "rad/s" }'),
        ("w_1", "w_1", 'w = { source = "w_1", unit = "rad/s" }'),
        ("w_1..2", "w_1", 'w = { source = "w_1", unit = "rad/s" }'),
        ("w_1..2", "w_1", '"w_1..1" = { unit = "rad/s" }'),
    ],
)
def test_a_sheet_s_unit_and_noise_are_converted_with_its_column(
    tmp_path: Path, sheet: str, head: str, column: str
) -> None:
    log = written(f"time,tau,{head}", ",", TIMES, TORQUE, TURNED)
    channel = ', column = "w_1"' if column.startswith('"') else ""
    problem = stated(tmp_path, signal(sheet, "deg/s", 0.1), log, COLUMNS=column, CHANNEL=channel)
    right(problem, np.radians(0.1))


def test_a_sheet_s_noise_of_an_input_is_converted_with_its_column(tmp_path: Path) -> None:
    log = written("time,tau,w", ",", TIMES, 1e3 * TORQUE, SPEED)
    sheet = signal("tau", "mN.m", 5.0) + signal("w", "rad/s", 0.01)
    run = stated(tmp_path, sheet, log, COLUMNS='tau = { unit = "N.m" }').run("one")
    assert run.noisy == {"load.tau": pytest.approx(5e-3)}


def test_a_sheet_s_noise_is_none_of_a_derivative(tmp_path: Path) -> None:
    log = written("time,tau,w", ",", TIMES, TORQUE, SPEED)
    column = 'w = { unit = "rad/s", derivative = true }'
    with pytest.raises(ScenarioError, match="its noise is not known; give sigma"):
        stated(tmp_path, signal("w", "rad", 0.01), log, COLUMNS=column)


def test_a_sheet_s_noise_of_what_is_made_is_in_its_unit(tmp_path: Path) -> None:
    log = written("time,tau,turned", ",", TIMES, TORQUE, TURNED)
    column = 'w = { source = "turned", from = "deg/s", unit = "rad/s" }'
    right(stated(tmp_path, signal("w", "rad/s", 0.02), log, COLUMNS=column), 0.02)
    right(stated(tmp_path, signal("w", "mrad/s", 20.0), log, COLUMNS=column), 0.02)


def test_a_sheet_that_states_no_unit_leaves_that_of_the_head(tmp_path: Path) -> None:
    log = written("time,tau,w [deg/s]", ",", TIMES, TORQUE, TURNED)
    sheet = '[[signal]]\nname = "w"\nnoise_sigma = 0.1\n'
    problem = stated(tmp_path, sheet, log, COLUMNS='w = { unit = "rad/s" }')
    right(problem, np.radians(0.1))


def test_a_sheet_tells_of_columns_of_several_files(tmp_path: Path) -> None:
    rows = written("time,w", ",", TIMES, TURNED)
    (tmp_path / "seen.csv").write_text(rows)
    text = SET.replace('file = "one.csv"', 'files = { cmd = "one.csv", seen = "seen.csv" }')
    column = 'w = { source = "seen.w", unit = "rad/s" }'
    problem = stated(
        tmp_path, signal("seen.w", "deg/s", 0.1), written("time,tau", ",", TIMES, TORQUE), text,
        TOP='time = "cmd.time"', COLUMNS=column, INPUT='"cmd.tau"',
    )  # fmt: skip
    right(problem, np.radians(0.1))


def test_columns_with_a_prefix_keep_what_their_heads_say(tmp_path: Path) -> None:
    log = written("a_time [ms],a_tau [N.m],a_w [deg/s],b_w [V]", ",", 1e3 * TIMES, TORQUE, TURNED,
                  SPEED)  # fmt: skip
    run = read(tmp_path, log, RUN='prefix = "a_"', COLUMNS='w = { unit = "rad/s" }').run("one")
    np.testing.assert_allclose(run.times, TIMES, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.data[:, 0], SPEED, rtol=1e-8, atol=1e-9)


def test_columns_with_a_prefix_keep_their_gaps_and_where_they_count_from(tmp_path: Path) -> None:
    begin = 1_764_040_000_000_000_000
    rows = [f"{begin + 10_000_000 * k},{TORQUE[k]:.9g},{SPEED[k]:.9g}" for k in range(SIZE)]
    rows[7] = rows[7].rpartition(",")[0] + ",lost"
    log = "a_time,a_tau,a_w\n" + "\n".join(rows) + "\n"
    problem = read(tmp_path, log, RUN='prefix = "a_"')
    np.testing.assert_allclose(problem.run("one").times, TIMES, rtol=0, atol=1e-9)
    said = [f.text for f in problem.source.findings if f.kind == "gaps"]
    assert said == ["1 of 300 cells hold no number (the first 'lost' in row 8): they are gaps"]


def test_a_prefix_leads_to_text_that_is_called_so(tmp_path: Path) -> None:
    log = "a_time,a_tau,a_w\n" + "".join(f"{k},1,on\n" for k in range(90))
    with pytest.raises(ScenarioError, match="column 'w' holds text"):
        read(tmp_path, log, RUN='prefix = "a_"')


def tables(unit: str) -> str:
    """One row, of which a run is made."""
    heads = [f"{name}_{k} [{unit if name == 'w' else 'N.m'}]"
             for name in ("tau", "w") for k in range(SIZE)]  # fmt: skip
    return ",".join(heads) + "\n" + ",".join(f"{x:.12g}" for x in (*TORQUE, *TURNED)) + "\n"


def test_tables_of_rows_keep_the_unit_of_their_heads(tmp_path: Path) -> None:
    rows = f"rows = true\ninterval = {STEP}"
    column = 'w = { unit = "rad/s" }'
    run = read(tmp_path, tables("deg/s"), RUN=rows, COLUMNS=column).run("one 0")
    np.testing.assert_allclose(run.data[:, 0], SPEED, rtol=1e-8, atol=1e-9)
    mixed = tables("deg/s").replace("[deg/s]", "[rad/s]", 1)
    with pytest.raises(ScenarioError, match="of table 'w' are in deg/s and rad/s; give them one"):
        read(tmp_path, mixed, RUN=rows, COLUMNS=column)


def two(folder: Path, first: str, second: str, column: str = "") -> Problem:
    """Two runs of the same motion, with these units of the speed."""
    values = {"rad/s": SPEED, "deg/s": TURNED, "s-1.rad": SPEED}
    for name, unit in (("one", first), ("two", second)):
        log = written(f"time,tau [N.m],w [{unit}]", ",", TIMES, TORQUE, values[unit])
        (folder / f"{name}.csv").write_text(log)
    more = '\n[[run]]\nname = "two"\nfile = "two.csv"\npurpose = "identification"\n'
    return read(folder, (folder / "one.csv").read_text(), RUN=more, COLUMNS=column)


def test_heads_with_another_unit_in_another_run_are_refused(tmp_path: Path) -> None:
    message = (
        "column 'w' is in 'deg/s' in run one, but in 'rad/s' in run two; give its unit in "
        "[columns] (w = { unit = 'deg/s' }), which converts each run from its own"
    )
    with pytest.raises(UnitError, match=re.escape(message)):
        two(tmp_path, "deg/s", "rad/s")
    problem = two(tmp_path, "deg/s", "rad/s", "w = { unit = 'deg/s' }")
    for run in problem.runs:
        np.testing.assert_allclose(run.data[:, 0], TURNED, rtol=1e-8, atol=1e-7)
    assert two(tmp_path, "rad/s", "s-1.rad").channels[0].gain == 1.0
