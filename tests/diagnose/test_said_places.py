"""What `cosim diagnose` prints of the places that data do not tell apart, for sets of laws, too."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from cosim.cli.app import app
from cosim.diagnose.facts import Table
from cosim.diagnose.result import Diagnosis
from cosim.diagnose.verdict import decide
from tests.diagnose.test_verdict import FAR, law, model, table

LEFT, RIGHT = "base.speed_left", "base.speed_right"
LATE = law("delay", "log.outputs")
SETS = FAR, model(law("gain", LEFT), LATE), model(law("gain", RIGHT), LATE, gain=-1.0)


def printed(monkeypatch: pytest.MonkeyPatch, folder: Path, known: Table) -> list[str]:
    """Lines of the command for a diagnosis that ended with this table of models."""
    problem = SimpleNamespace(
        name="mine", file=SimpleNamespace(path=Path("robot.toml")), channels=(), instances={},
        parameters=(), runs=(),
    )  # fmt: skip
    result = Diagnosis(problem, decide(known), known)  # type: ignore[arg-type]
    monkeypatch.setattr("cosim.diagnose.result.made_of", lambda problem, after: {})
    monkeypatch.setattr("cosim.calibrate.mapping.read_problem", lambda *_, **__: problem)
    monkeypatch.setattr("cosim.diagnose.diagnose", lambda *_, **__: result)
    monkeypatch.setattr("cosim.report.page.write_page", lambda *_: None)
    done = CliRunner().invoke(app, ["diagnose", str(folder), "--out", str(folder / "out")])
    assert done.exit_code == 0, done.output
    return [line.strip() for line in done.output.splitlines()]


def test_a_law_of_a_set_is_said_with_the_places_where_it_does_the_same(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A gain of one wheel beside a late camera: the other wheel's gain does as well."""
    lines = printed(monkeypatch, tmp_path, table(*SETS, alike=((1, 2),)))
    place = next(i for i, line in enumerate(lines) if line.startswith(f"gain at {LEFT}:"))
    assert lines[place + 1] == f"or at {RIGHT}: these runs do not tell which"
    assert lines[place + 2].startswith("delay at log.outputs:")
    assert sum("do not tell which" in line for line in lines) == 1  # the delay is where it is


def test_a_place_that_the_data_tell_is_said_alone(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    far = model(law("gain", RIGHT), LATE, rms=1.3)
    lines = printed(monkeypatch, tmp_path, table(*SETS[:2], far))
    assert any(line.startswith(f"gain at {LEFT}:") for line in lines)
    assert not any("do not tell which" in line for line in lines)
