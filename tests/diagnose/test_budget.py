"""A diagnosis that is ended early reports what it has found, and names nothing."""

from __future__ import annotations

import json
import math
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cosim.calibrate.budget import Budget, StoppedError
from cosim.calibrate.mapping import read_problem
from cosim.cli.app import app
from cosim.diagnose import Diagnosis, diagnose, diagnosis
from cosim.diagnose.models import Fitted
from cosim.diagnose.search import Search
from cosim.diagnose.small import Small
from cosim.errors import CosimError
from tests.diagnose import disc

FEW = ("sweep", "steps", "check")
ENOUGH = 400
"""Simulated runs in which the declared parameter and some laws are fitted; all of them take more
than a thousand."""


@pytest.fixture(scope="module")
def rubbing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A disc with friction that is not declared."""
    folder = tmp_path_factory.mktemp("rubbing") / "rubbing"
    law = lambda w, theta, t: 0.08 * math.tanh(w / 0.02)  # noqa: E731
    disc.write(folder, law, seconds=1.6, names=FEW)
    return folder


@pytest.fixture(scope="module")
def ended(rubbing: Path) -> Callable[[int], Diagnosis]:
    """Diagnoses with few simulated runs, by the number of threads."""
    return lambda workers: diagnose(read_problem(rubbing), workers=workers, budget=Budget(ENOUGH))


def test_what_is_found_until_then_is_a_hint_and_no_name(ended: Callable[[int], Diagnosis]) -> None:
    found = ended(1)
    content = found.to_dict()
    assert found.verdict == content["verdict"] == "unexplained" and not found.answer.laws
    assert content["stopped"] == f"after {ENOUGH} simulated runs"
    assert f"was stopped after {ENOUGH} simulated runs, so no effect is named" in found.reason
    (hint, *_) = found.answer.hints
    assert "not all others were asked" in hint.why
    assert all(row["before"]["validation"] > 0.0 for row in content["channels"].values())
    # the same end whoever simulates
    again = ended(2).to_dict()
    for volatile in ("wall_s", "evaluations"):
        content.pop(volatile), again.pop(volatile)
    assert again == content


def test_a_budget_ends_all_work_but_the_report() -> None:
    budget = Budget(2)
    budget.spend()
    budget.spend()
    for _ in range(2):
        with pytest.raises(StoppedError, match="after 2 simulated runs"):
            budget.spend()
    with budget.lifted():
        budget.spend()
    with pytest.raises(StoppedError, match="after 2 simulated runs"):  # a larger system is asked
        budget.spend()
    assert budget.spent == 3 and budget.stopped == "after 2 simulated runs"
    over = Budget(2)
    with over.lifted():
        for _ in range(3):
            over.spend()
    with pytest.raises(StoppedError, match="after 2 simulated runs"):
        over.spend()
    endless = Budget()
    endless.spend()
    endless.stop("by hand")
    with pytest.raises(StoppedError, match="by hand"):
        endless.spend()


def test_what_is_found_is_told_whole_though_the_budget_ends_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The name stands; what is said beside it is part of the report."""
    budget, told = Budget(), []
    small_laws = diagnosis.small_laws

    def small(search: Search, after: Fitted) -> list[Small]:
        budget.stop("by hand")
        budget.spend()
        told.append(small_laws(search, after))
        return told[-1]

    monkeypatch.setattr(diagnosis, "small_laws", small)
    disc.write(tmp_path, lambda w, theta, t: 2e-3 * w * abs(w))
    found = diagnose(read_problem(tmp_path), budget=budget)
    assert found.verdict == "effect_found" and told == [found.small]
    assert not found.to_dict()["stopped"]
    assert not any("stopped" in warning for warning in found.warnings)


def test_before_the_declared_parameters_are_fitted_there_is_nothing_to_report(
    rubbing: Path,
) -> None:
    with pytest.raises(CosimError, match="stopped after 3 simulated runs, before the declared"):
        diagnose(read_problem(rubbing), budget=Budget(3))
    with pytest.raises(ValueError, match="a budget of 0 simulated runs is none; give at least 1"):
        Budget(0)
    result = CliRunner().invoke(app, ["diagnose", str(rubbing), "--runs", "0"])
    assert result.exit_code == 2 and "--runs" in result.output


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C cannot be sent to one process there")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_search_with_a_report(
    rubbing: Path, tmp_path: Path, number: signal.Signals
) -> None:
    """Ctrl-C by hand; `timeout` sends SIGTERM, to the command and to its group."""
    command = [sys.executable, "-m", "cosim", "diagnose", str(rubbing), "--out", str(tmp_path)]
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:  # fmt: skip
        assert process.stderr is not None
        for line in process.stderr:
            if "round 1" in line:
                process.send_signal(number)
                if number == signal.SIGTERM:
                    time.sleep(0.3)  # the second one is another
                    process.send_signal(number)
                break
        out, said = process.communicate()
    assert process.returncode == 0, said
    assert "a report on what was found so far follows" in said
    assert "stopped by hand" in out
    content = json.loads((tmp_path / "diagnosis.json").read_text(encoding="utf-8"))
    assert content["stopped"] == "by hand" and content["verdict"] == "unexplained"
    assert (tmp_path / "report.html").exists()
