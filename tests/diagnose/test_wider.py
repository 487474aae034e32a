"""What shows first in channels that only a larger system has is looked for in that system."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate.checks.finding import Finding
from cosim.calibrate.mapping import read_problem
from cosim.calibrate.simulator import Simulator
from cosim.diagnose import Diagnosis, diagnose
from cosim.diagnose.models import Fitted
from cosim.diagnose.search import Search
from cosim.errors import CosimError
from tests.diagnose import disc

pytestmark = pytest.mark.slow

RIDER = """
base = "dataset.toml"
system = "both.toml"

[parameters]
"rider.J" = 0.02
"rider.b" = 0.03

[inputs]
"load.tau" = { column = "tau", interpolation = "linear" }
"rider.tau" = { column = "tau", interpolation = "linear" }

[channels.w]
signal = "load.w"
sigma = 0.02

[channels.theta]
signal = "load.phi"
sigma = 0.002

[channels.w_2]
signal = "rider.w"
sigma = 0.02
"""
BOTH = """
description = "Two discs, each on a shaft of its own."
connections = []
[instances]
load = "inertia/disc"
rider = "inertia/disc"
"""


def friction(w: float, theta: float, t: float) -> float:
    return 0.08 * float(np.tanh(w / 0.05))


def nothing(w: float, theta: float, t: float) -> float:
    return 0.0


def found(folder: Path, first: disc.Law, second: disc.Law) -> Diagnosis:
    """The diagnosis of a disc whose log tells of a second one, too."""
    disc.write(folder, first)
    random = np.random.default_rng(11)
    for name in disc.RUNS:
        table = np.loadtxt(folder / f"{name}.csv", delimiter=",", skiprows=1)
        _, _, w, _ = disc.run(name, second, 4.0)
        seen = w + disc.SIGMA["w"] * random.standard_normal(w.size)
        np.savetxt(folder / f"{name}.csv", np.column_stack([table, seen]), delimiter=",",
                   fmt="%.7g", header="time,tau,w,theta,w_2", comments="")  # fmt: skip
    mapping = folder / "dataset.toml"
    text = mapping.read_text("utf-8")
    text = text.replace("[columns]\n", '[columns]\nw_2 = { unit = "rad/s" }\n')
    mapping.write_text('further = ["rider.toml"]\n' + text, encoding="utf-8")
    (folder / "rider.toml").write_text(RIDER, encoding="utf-8")
    (folder / "both.toml").write_text(BOTH, encoding="utf-8")
    return diagnose(read_problem(folder), workers=1)


def test_it_is_found_in_the_part_that_the_smaller_system_lacks(tmp_path: Path) -> None:
    result = found(tmp_path, nothing, friction)
    assert result.problem.file.path.stem == "both"
    assert [law.label for law in result.answer.laws] == ["coulomb at rider.flange"]
    assert result.warnings[0].startswith("diagnosed with both: what is missing shows in w_2 (")
    assert result.rms("after", "validation")["w_2"] == pytest.approx(0.02, rel=0.1)  # the noise


def test_both_parts_are_asked_where_both_lack_something(tmp_path: Path) -> None:
    def brake(w: float, theta: float, t: float) -> float:
        return 0.01 * float(np.tanh(w / 0.05))

    result = found(tmp_path, brake, friction)
    assert result.problem.file.path.stem == "both"
    names = {law.label for law in result.answer.laws}
    assert names == {"coulomb at rider.flange", "coulomb at load.flange"}


@pytest.mark.parametrize("refused", [False, True])
def test_what_the_smaller_system_says_stays_where_the_larger_one_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: bool
) -> None:
    calibrated, why = Search.calibrated, "run stopped at t = 1 s"

    def failing(self: Search, start: Mapping[str, float] | None = None) -> Fitted:
        if start is not None and not refused:
            raise CosimError(why)
        return calibrated(self)

    def examined(simulator: Simulator) -> list[Finding]:
        wrong = refused and simulator.problem.file.path.stem == "both"
        return [Finding("error", "clock", "", "", why)] if wrong else []

    monkeypatch.setattr(Search, "calibrated", failing)
    monkeypatch.setattr("cosim.diagnose.diagnosis.examine", examined)
    result = found(tmp_path, nothing, friction)
    assert result.problem.file.path.stem == "system" and result.verdict == "nothing_missing"
    (said,) = (text for text in result.warnings if text.startswith("not diagnosed with both"))
    assert "w_2 (" in said and why in said
    assert result.further[0].rms("after", 2) > 2.0


@pytest.mark.parametrize(("law", "names"), [(nothing, []), (friction, ["coulomb at load.flange"])])
def test_a_part_that_lacks_nothing_is_judged_only(
    tmp_path: Path, law: Callable[[float, float, float], float], names: list[str]
) -> None:
    result = found(tmp_path, law, nothing)
    assert result.problem.file.path.stem == "system"
    assert [one.label for one in result.answer.laws] == names
    (item,) = result.further
    assert item.rms("after", 2) == pytest.approx(1.0, abs=0.1)  # w_2, at its noise
