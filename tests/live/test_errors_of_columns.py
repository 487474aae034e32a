"""What is known to be wrong with columns counts in a twin as it does in a calibration."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.machine import Machine
from cosim.calibrate import Simulator, read_problem
from cosim.live.folder import Folder
from cosim.live.reading import Reading, read_reading
from cosim.live.watch import Settings, Watch
from tests.live.disc import commands, rig

COUNT = 400
ERROR = """
[[parameter]]
name = "error"
unit = "{unit}"
nominal = {value}
min = -1.0
max = 1.0
targets = "{target}"
[[run]]"""


def changed(folder: Path, old: str, new: str) -> Reading:
    """The small rig, with its mapping changed."""
    rig(folder)
    path = folder / "dataset.toml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return read_reading(folder)


def lines(reading: Reading, seed: int = 3, clock: float = 0.0, **how: Any) -> list[bytes]:
    machine = Machine(reading, commands(COUNT), {"angle_0": 0.25}, seed=seed, clock=clock, **how)
    return [line for block in machine.lines() for line in block]


def followed(
    reading: Reading, given: list[bytes], block: int, folder: Folder | None = None, **how: Any
) -> list[dict[str, Any]]:
    """What is said of lines that come in blocks."""
    events: list[dict[str, Any]] = []
    watch = Watch(reading, Settings(**{"pace": 0.0, "report": 1e9, **how}), events.append, folder)
    for first in range(0, len(given), block):
        if not watch.take([(0.0, line) for line in given[first : first + block]]):
            break
    watch.finish()
    watch.summary()
    return events


def agree(
    reading: Reading,
    given: list[bytes],
    place: Path,
    log: Reading | None = None,
    errors: Mapping[str, float] | None = None,
    unknown: int = 0,
) -> None:
    """The residual of a stream, in any blocks, is that of its log.

    Args:
        reading, given: of the stream.
        place: of the log.
        log: reading of it, if it is another one.
        errors: that the log has beside.
        unknown: samples at the begin that clocks have moved out of the run.
    """
    for block in (1, 50, 1000):
        kept = place / f"kept{block}"
        (told,) = (e for e in followed(reading, given, block, Folder(kept, log or reading))
                   if "residual" in e)  # fmt: skip
        problem = read_problem(kept)
        problem = problem.changed(constants={**problem.constants, **(errors or {})})
        ((_, rows),) = Simulator(problem, workers=1).residuals(problem.nominal, None)
        assert told["samples"] > COUNT - 10
        for column, channel in enumerate(problem.channels):
            known = rows[: told["samples"], column][unknown if channel.name == "phi" else 0 :]
            # printed to 4 digits
            rms = np.sqrt(np.nanmean(known**2))
            assert told["residual"][channel.name]["rms"] == pytest.approx(rms, rel=1e-3)


@pytest.mark.parametrize(
    ("target", "value", "unknown"),
    [
        ("column:bias:phi", 0.1, 0), ("column:gain:w", 0.05, 0),
        ("column:zero_drift:phi", 0.05, 0),
        ("clock:phi", 0.1, 10), ("clock:phi", -0.03, 0), ("clock:phi", 0.013, 2),
        ("clock:drift:phi", 0.02, 0), ("clock:drift:phi", -0.01, 0),
        ("clock:load.tau", 0.02, 0), ("clock:load.tau", -0.035, 0),
    ],
)  # fmt: skip
def test_a_twin_corrects_columns_as_a_calibration_does(
    tmp_path: Path, target: str, value: float, unknown: int
) -> None:
    plain = rig(tmp_path / "plain")
    unit = {"gain": "1", "bias": "rad", "zero_drift": "rad/s", "drift": "1"}.get(
        target.split(":")[1], "s"
    )
    reading = changed(
        tmp_path / "disc", "[[run]]", ERROR.format(value=value, target=target, unit=unit)
    )
    # the log's own mapping has no bounds of a lateness, which would leave out its ends
    agree(reading, lines(plain), tmp_path, plain, {target: value}, unknown)


@pytest.mark.parametrize("shift", [-0.1, -0.3])
def test_a_channel_that_is_late_reads_its_own_rows_however_lines_come(
    tmp_path: Path, shift: float
) -> None:
    signal = 'signal = "load.phi"\n'
    reading = changed(tmp_path / "disc", signal, f"{signal}shift = {shift}\n")
    agree(reading, lines(rig(tmp_path / "plain")), tmp_path)


@pytest.mark.parametrize("how", ["slope", "window", "linear", "hold"])
def test_an_input_with_nulls_is_the_same_however_lines_come(tmp_path: Path, how: str) -> None:
    old = '"load.tau" = "torque"\n'
    new = f'[inputs."load.tau"]\ncolumn = "torque"\ninterpolation = "{how}"\n'
    reading = changed(tmp_path / "disc", old, new)
    given = lines(rig(tmp_path / "plain"))
    for place in range(4, len(given), 3):
        given[place] = json.dumps({**json.loads(given[place]), "torque": None}).encode()
    agree(reading, given, tmp_path)


def test_a_twin_has_the_options_of_the_mapping(tmp_path: Path) -> None:
    new = 'algorithm = "jacobi"\noptions = { extrapolation = 2 }\n'
    reading = changed(tmp_path / "disc", 'algorithm = "gauss_seidel"\n', new)
    with reading.twin({}) as twin:
        assert dict(twin.master.options) == {"extrapolation": 2}


# -- runs ------------------------------------------------------------------------------------------


def test_a_run_whose_clock_begins_anew_is_told_and_counted_as_the_first(tmp_path: Path) -> None:
    reading = rig(tmp_path / "disc")
    given = [*lines(reading), *lines(reading, 4)]
    told = [e for e in followed(reading, given, 50, report=1.0) if "residual" in e]
    assert len(told) == 2 * (COUNT // 100)
    (end,) = (e for e in followed(reading, given, 50, duration=5.0) if e.get("event") == "end")
    assert end["samples"] == pytest.approx(COUNT + 101, abs=2)  # of 5 s, and those on its edges


def test_each_run_tells_its_own_alarms(tmp_path: Path) -> None:
    reading = rig(tmp_path / "disc")
    faulty: dict[str, Any] = {
        "variant": {"load": "+coulomb"},
        "values": {"load.coulomb.tau_c": 0.3},
    }
    runs = [lines(reading, k, 100.0 * k, **(faulty if k != 1 else {})) for k in range(3)]
    events = followed(reading, [line for run in runs for line in run], 50)
    told = [[e["t"] // 100.0, e["channel"], e["kind"]] for e in events if e.get("event") == "alarm"]
    assert {run for run, *_ in told} == {0.0, 2.0}
    assert len({tuple(entry) for entry in told}) == len(told)
