"""The chain on data of an independent plant: an effect is named, its clean twin stays quiet."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks.bench import Bench
from benchmarks.motor_plant import draw, write_sets
from cosim.calibrate.budget import Budget
from cosim.calibrate.mapping import read_problem
from cosim.calibrate.parts import Parameter
from cosim.cli.diagnose import _value
from cosim.diagnose import Diagnosis
from cosim.diagnose.answer import Verdict
from cosim.diagnose.candidates import Candidate, candidates
from cosim.diagnose.diagnosis import _searched, _Task, _written
from cosim.diagnose.rounds import Round
from cosim.diagnose.search import Search
from cosim.diagnose.story.facts import interval
from cosim.report import sections
from cosim.report.page import page
from tests.problems import simulator
from tests.report import stories
from tests.report.marked import Marked, expected

pytestmark = pytest.mark.slow

SHEET = Path(__file__).parents[2] / "scenarios/motor_bench/data/motor_bench.toml"
SIZE = 0.15
CHOICE = {"battery_sag", "brush_drop", "winding_heating", "current_gain", "viscous", "unbalance"}


@pytest.fixture(scope="module")
def sets(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Path]]:
    """A bench with a soft supply, and the same bench without."""
    folder = tmp_path_factory.mktemp("benches")
    plain = draw(np.random.default_rng(3))
    benches = [
        plain, Bench(plain.parameters, "supply_sag", SIZE), Bench(plain.parameters, "coulomb", 0.4)
    ]  # fmt: skip
    places = write_sets(folder, benches, SHEET, 5, 2.0, ("ST", "MS", "LW"))
    yield dict(zip(("clean", "supply_sag", "coulomb"), places, strict=True))


def searched(folder: Path, choice: set[str] = CHOICE) -> tuple[Search, Round]:
    """One round over a part of the catalogue."""
    problem = read_problem(folder)
    chosen = [c for c in candidates(problem) if c.effect in choice]
    assert len({c.effect for c in chosen}) == len(choice)
    search = Search(simulator(problem), only=chosen)
    return search, search.round(search.calibrated())


def test_the_undeclared_effect_is_named_with_its_size(sets: dict[str, Path]) -> None:
    search, found = searched(sets["supply_sag"])
    assert found.winner is not None
    assert found.winner.effects[-1].effect == "battery_sag"
    size = found.winner.estimate.values["motor.winding.battery_sag.r_b"]
    # twice the 95 % interval of this short data set is about 10 %
    assert size == pytest.approx(SIZE, rel=0.1)
    # 1.1: what the sheets' noise figures are good for
    rest = search.check_data - found.winner.check
    assert np.sqrt(np.mean(rest**2)) < 1.1


def test_the_clean_twin_stays_quiet(sets: dict[str, Path]) -> None:
    search, found = searched(sets["clean"])
    assert found.winner is None
    assert np.sqrt(np.mean((search.check_data - found.base.check) ** 2)) < 1.1


def test_a_law_is_not_mistaken_for_one_that_contains_it(sets: dict[str, Path]) -> None:
    _, found = searched(sets["coulomb"], {"coulomb", "asymmetric_coulomb", "quadratic_drag"})
    assert found.winner is not None
    assert found.winner.effects[-1].effect == "coulomb"
    # on either side of the gearbox it is the same
    assert found.winner.signature is not None
    places = {found.winner.effects[-1].label, *found.winner.signature.same}
    assert "coulomb at load.flange" in places


def test_the_result_is_complete(sets: dict[str, Path], tmp_path: Path) -> None:
    problem = read_problem(sets["supply_sag"])
    chosen = [
        c for c in candidates(problem) if c.effect in {"battery_sag", "brush_drop", "elastic"}
    ]
    search = Search(simulator(problem), only=chosen)
    base = search.calibrated()
    task = _Task(None, (), tmp_path, lambda text: None, (), law=True, workers=None, budget=Budget())
    result = _written(_searched(search, base, [], task), task)
    search.close()
    table = result.to_dict()
    assert table["verdict"] == "effect_found"
    assert [e["effect"] for e in table["effects"]] == ["battery_sag"]
    assert table["localisation"][0]["component"] == "motor"
    assert all(v["identifiable"] for e in table["effects"] for v in e["parameters"].values())
    json.dumps(table, allow_nan=False)
    text = page(result)
    for part in ("battery_sag at motor.winding", "Where the disturbance enters", "motor.winding"):
        assert part in text
    for fact, shown in Marked(text).facts.items():
        assert set(shown) == {expected(table, fact)}
    view = Marked(result._repr_html_())
    assert "Supply voltage that falls" in view.text or "supply voltage that falls" in view.text
    assert all(set(shown) == {expected(table, fact)} for fact, shown in view.facts.items())
    assert "R_a" in Marked(base.estimate._repr_html_()).text
    assert table["model"]["variants"] == {"motor": "dc_motor.lab_bench/sampled+battery_sag@winding"}
    assert table["model"]["values"].keys() > {"motor.R_a", "motor.winding.battery_sag.r_b"}
    assert shape(table) == shape(stories.table("effect_found"))
    (left,) = result.files
    assert "battery_sag" in left.name and left.is_file()


def shape(table: dict[str, Any]) -> list[set[str]]:
    """Keys of a diagnosis and of what is in it."""
    parts = [
        table, table["effects"][0], table["localisation"][0], table["model"],
        table["localisation"][0]["curves"][0], table["channels"]["speed"],
        table["parameters"]["R_a"], table["parameters"]["R_a"]["before"],
        table["structure"]["after validation"][0],
        *(item["parameters"][name] for item in table["effects"][:1]
          for name in list(item["parameters"])[:1]),
    ]  # fmt: skip
    return [set(part) for part in parts]


def test_friction_that_is_declared_already_is_not_identifiable(sets: dict[str, Path]) -> None:
    problem = read_problem(sets["clean"])
    viscous = [c for c in candidates(problem) if c.effect == "viscous" and c.instance == "load"]
    search = Search(simulator(problem), only=viscous)
    stage = search.scored(search.calibrated())
    assert [s.unseen for s in stage.signatures] == [True]
    assert isinstance(viscous[0], Candidate)


def test_start_values_that_were_estimated_are_reported(sets: dict[str, Path]) -> None:
    problem = read_problem(sets["clean"])
    late = [
        Parameter(f"theta_0@{run.name}", "rad", 0.0, -1.0, 1.0, (("encoder.theta", 2.0),),
                  "nuisance", run.name, late=True)
        for run in problem.runs
    ]  # fmt: skip
    own = problem.with_parameters([*problem.parameters, late[0]])
    after: Any = SimpleNamespace(problem=own.hold({late[0].name: 0.125}).changed(late=late[:1]))
    found = Diagnosis(problem, Verdict("effect_found"), after=after).start_values()
    assert found == {problem.runs[0].name: {"theta_0": 0.125}}
    shown = sections.starts(found)
    assert "theta_0" in shown and "0.125" in shown
    assert sections.starts({}) == ""


def test_what_the_data_leave_open_is_said() -> None:
    known = {"value": 0.5, "ci95": [0.2, 0.8], "unit": "W", "identifiable": True}
    for entry, word in ((known, False), ({**known, "identifiable": False}, True)):
        assert ("open" in _value("P_0", entry)) is word
        assert ("open" in interval(entry)) is word
