"""A law that calibration has hidden shows around nominal values; where none is, none does."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.bench import Bench
from benchmarks.crawler_plant import EFFECTS, SECONDS, SHEET, write_sets
from cosim.calibrate.mapping import read_problem
from cosim.diagnose import Diagnosis
from cosim.diagnose.answer import Verdict
from cosim.diagnose.candidates import candidates
from cosim.diagnose.course import Course
from cosim.diagnose.rounds import Round
from cosim.diagnose.search import Search
from tests.problems import simulator

pytestmark = pytest.mark.slow

PLAIN = {"r": 0.0545, "B": 0.282, "a": 0.164, "mu": 0.75}
ACROSS, LATE = "friction_anisotropy at crawler.mu_lateral", "delay at log.camera.outputs"


@pytest.fixture(scope="module")
def sets(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A crawler that grips less across its tracks, and one with a late camera."""
    kinds = ("friction_anisotropy", "camera_late")
    benches = [Bench(PLAIN, kind, EFFECTS[kind][0], 1.0) for kind in kinds]
    folder = tmp_path_factory.mktemp("crawler")
    return dict(zip(kinds, write_sets(folder, benches, SHEET, 7, SECONDS), strict=True))


@pytest.fixture
def search(sets: dict[str, Path], request: pytest.FixtureRequest) -> Iterator[Search]:
    problem = read_problem(sets[request.param])
    chosen = [c for c in candidates(problem) if c.label in (ACROSS, LATE)]
    found = Search(simulator(problem), only=chosen)
    yield found
    found.close()


def looked(search: Search, label: str) -> Round | None:
    """A round around nominal values, beside a model with the law that a round has found."""
    base = search.calibrated()
    search.note(base)
    stage = search.round(base)
    assert stage.winner is not None
    assert stage.winner.labels == {label}
    return search.around_nominal(stage.winner)


@pytest.mark.parametrize("search", ["camera_late"], indirect=True)
def test_the_law_that_is_there_stays(search: Search) -> None:
    assert looked(search, LATE) is None


@pytest.mark.parametrize("search", ["friction_anisotropy"], indirect=True)
def test_a_law_that_calibration_hides_is_found_around_nominal_values(search: Search) -> None:
    """The second round adds nothing, asks there, and there is no third one."""
    base = search.calibrated()
    search.note(base)
    result = Diagnosis(search.raw, Verdict(""), search=search, before=base)
    found = Course(result, search, base, rounds=2).followed()
    first, second, third = search.rounds
    assert first.winner is not None and first.winner.labels == {LATE}
    assert second.winner is None
    assert third.winner is not None and third.winner.labels == found.labels == {ACROSS}
    # with radius and friction, four parameters make up for each other: a tenth
    excess = found.estimate.values["crawler.mu_lateral.friction_anisotropy.excess"]
    assert excess == pytest.approx(-EFFECTS["friction_anisotropy"][0], rel=0.1)
