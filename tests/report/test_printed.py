"""What `cosim diagnose` prints is what it found, letter by letter."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim.calibrate.mapping import read_problem
from cosim.cli.diagnose import _print
from cosim.diagnose import Diagnosis
from cosim.diagnose.answer import Verdict
from cosim.installation import places


def test_what_stands_in_brackets_is_no_markup(capsys: pytest.CaptureFixture[str]) -> None:
    said = 'yaw: give unwrap = true in [columns] (if it is right: [checks] allow = ["wrapped"])'
    problem = read_problem(places.scenarios() / "motor_bench" / "data" / "MB-12")
    result = Diagnosis(problem, Verdict("bad_data", errors=(said,)))
    result.files = [Path("report.html"), Path("diagnosis.json")]
    _print(result)
    assert said in capsys.readouterr().out
