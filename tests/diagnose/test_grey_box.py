"""A law that nobody has catalogued is rebuilt, judged on unused runs and put into an FMU."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.law_from_data import late_drag
from benchmarks.shaft_plant import FRICTION, SIGMA, shaft
from cosim.calibrate.problem import Problem
from cosim.diagnose import Diagnosis, diagnose
from cosim.diagnose.grey_box import unnamed
from cosim.diagnose.grey_box.result import Writer
from cosim.diagnose.localise import Curve, Place
from cosim.diagnose.models import GATE
from cosim.diagnose.search import Search
from cosim.errors import UnknownNameError, VariantError
from cosim.installation.builder import default_provider
from tests.problems import simulator

pytestmark = pytest.mark.slow
PLACE = "load.flange"


def friction(w: float, _: float) -> float:
    """Coulomb friction as the catalogue has it, smoothed over 0.2 rad/s [N.m]."""
    return -0.25 * math.tanh(w / 0.2)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Diagnosis, Path]:
    out = tmp_path_factory.mktemp("law")
    return diagnose(shaft(late_drag, 7), out, law_at=PLACE, workers=2), out


def test_a_law_outside_the_catalogue_is_rebuilt(made: tuple[Diagnosis, Path]) -> None:
    law = made[0].to_dict()["law_from_data"]
    assert law["made"] and law["depends_on"] == "velocity"
    curve = {
        name: np.array(law["curve"][name]) for name in ("x", "value", "low", "high", "visited")
    }
    seen = curve["visited"] > 0.0
    # viscous friction is declared, and its slope is the one's or the other's
    slope = FRICTION - law["declared"]["b"]["value"]
    truth = np.array([late_drag(x, 0.0) for x in curve["x"]]) - slope * curve["x"]
    half = 0.5 * (curve["high"] - curve["low"])
    # 95 % bands of a curve with about a dozen independent points: twice as wide for all of them
    assert np.all(np.abs(curve["value"] - truth)[seen] < 2.0 * half[seen])
    # without the slope it is known to a twentieth of what it does at most
    away = np.average((curve["value"] - truth) ** 2, weights=curve["visited"]) ** 0.5
    assert away < 0.05 * abs(late_drag(curve["x"][seen][-1], 0.0))


def test_unused_runs_are_explained_to_the_noise(made: tuple[Diagnosis, Path]) -> None:
    error = made[0].to_dict()["law_from_data"]["error"]
    for channel, sigma in SIGMA.items():
        before, after = (error[channel][which]["validation"] ** 2 for which in ("before", "after"))
        assert before > 3.0 * sigma**2
        # 400 samples tell the noise's square to 7 %, three standard deviations of that; and a
        # twentieth of what was missing, since the law is known to a twentieth of itself
        assert after < 1.21 * sigma**2 + 0.05 * (before - sigma**2)


def test_the_fmu_is_the_model_with_the_law(made: tuple[Diagnosis, Path]) -> None:
    from cosim.calibrate.model import Model
    from cosim.calibrate.simulator import Simulator

    result, out = made
    assert result.law is not None and result.law.law is not None
    file = replace(result.problem.file, instances={"load": str(result.law.fmu)})
    assert result.law.fmu is not None and result.law.fmu.is_relative_to(out)
    problem = result.problem.changed(model=Model.of(file, None), parameters=())
    (row,) = Simulator(problem, workers=1).residuals(np.zeros(0), ["unused"])
    expected = result.law.law.fitted.simulator.residuals(
        result.law.law.fitted.estimate.theta, ["unused"]
    )
    # the same code with the same numbers
    assert row[1] == pytest.approx(expected[0][1], abs=1e-9)


def test_a_machine_that_lacks_nothing_gets_no_law(tmp_path: Path) -> None:
    result = diagnose(shaft(lambda w, phi: 0.0, 7), tmp_path, law_at=PLACE, workers=2)
    law = result.to_dict()["law_from_data"]
    assert result.verdict == "nothing_missing"
    assert not law["made"] and "reaches the noise" in law["reason"]
    assert not list(tmp_path.rglob("*.fmu"))


def test_the_nearest_name_of_a_law_that_has_one() -> None:
    result = diagnose(shaft(friction, 8), law_at=PLACE, workers=2)
    law = result.to_dict()["law_from_data"]
    assert law["made"]
    first = law["nearest"][0]
    assert first["effect"] == "coulomb"
    assert first["parameters"]["tau_c"] == pytest.approx(0.25, rel=0.05)  # a band of a hundredth
    # the true law does as well; both were fitted to other runs, which leaves either some nats ahead
    assert abs(first["unused_runs_prefer_the_law_by_nats"]) < 0.01 * law["gate"]["gain_nats"]
    assert first["rms_difference"] < 0.1 * 0.25
    # where the two curves are, viscous friction of each counted in: to first order, and to what
    # the runs tell of a hundredth of a law
    assert result.law is not None
    x, value, visited = (np.array(law["curve"][name]) for name in ("x", "value", "visited"))
    more = result.law.named[0].fitted.estimate.values["b"] - law["declared"]["b"]["value"]
    p = first["parameters"]
    away = -p["tau_c"] * np.tanh(x / p["w_0"]) - more * x - value
    apart = np.average(away**2, weights=visited) ** 0.5
    assert 0.5 * apart < first["rms_difference"] < 2.0 * apart
    # a slope may be the law's or the declared one's: four standard deviations, 1.96 in half of it
    b = law["declared"]["b"]
    assert abs(b["value"] - FRICTION) < 4.0 * (b["ci95"][1] - b["ci95"][0]) / (2.0 * 1.96)
    # the curve is made of its coefficients, eight alike, with weights that add up to 1 and a jump
    half = np.array([0.5 * (c["ci95"][1] - c["ci95"][0]) for c in law["coefficients"]])
    band = 0.5 * (np.array(law["curve"]["high"]) - np.array(law["curve"]["low"]))
    assert np.max(band) < np.max(half[:-8]) + half[-1]
    # the others do not, and it is said where
    assert all(named["unused_runs_prefer_the_law_by_nats"] > GATE for named in law["nearest"][1:])
    assert law["nearest"][-1]["differs"]


def test_a_place_that_is_none_is_refused_with_those_that_are() -> None:
    problem: Problem = shaft(lambda w, phi: 0.0, 7)
    with pytest.raises(UnknownNameError, match=r"load\.flange.*as place of a law"):
        diagnose(problem, law_at="load.flunge")


def test_only_a_place_with_evidence_gets_a_law_unasked() -> None:
    problem = shaft(lambda w, phi: 0.0, 7)
    search = Search(simulator(problem), only=[])
    base = search.calibrated()
    at = np.linspace(0.0, 1.0, 9)

    def place(evidence: float) -> Place:
        curve = Curve("velocity", "", at, at, at, evidence, 1.0)
        return Place("load", "flange", "", "N.m", [curve])

    assert unnamed(search, base, []) is None
    assert unnamed(search, base, [place(0.9 * GATE)]) is None
    found = unnamed(search, base, [place(2.0 * GATE), place(1.5 * GATE)])
    assert found is not None and not found.made
    assert "It may as well act at load.flange." in found.reason
    search.close()


def test_a_start_value_of_no_variable_is_refused(tmp_path: Path) -> None:
    builder = default_provider()
    assert isinstance(builder, Writer)
    with pytest.raises(VariantError, match=r"inertia/disc: .*angle.*as variable"):
        builder.written("inertia/disc", {"angel": 1.0}, tmp_path / "disc.fmu")
