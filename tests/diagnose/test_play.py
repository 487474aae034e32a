"""Play in a gear that is declared as rigid is named at once, and not for one that only yields."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from benchmarks.bench import Bench
from benchmarks.motor_plant import D_TWIST, draw, write_sets
from cosim.calibrate.mapping import read_problem
from cosim.diagnose.candidates import candidates
from cosim.diagnose.rounds import Round
from cosim.diagnose.search import Search
from tests.problems import simulator

pytestmark = pytest.mark.slow

SHEET = Path(__file__).parents[2] / "scenarios/motor_bench/data/motor_bench.toml"
CHOICE = {"backlash at gearbox", "elastic at gearbox", "coulomb at gearbox.flange_b"}
GAP, COMPLIANCE = 3e-3, 1e-3
DECLARED = 1.1
"""Damping of a soft gear's twist in its FMU [N.m.s/rad]."""


@pytest.fixture(scope="module")
def sets(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Path]]:
    """An independent bench with play, and the same one with a soft gear."""
    folder = tmp_path_factory.mktemp("benches")
    plain = draw(np.random.default_rng(3)).parameters
    sizes = {"backlash": GAP, "elastic_gear": COMPLIANCE}
    benches = [Bench(plain, effect, size) for effect, size in sizes.items()]
    yield dict(
        zip(sizes, write_sets(folder, benches, SHEET, 5, 2.0, ("ST", "MS", "LW")), strict=True)
    )


def searched(folder: Path) -> Round:
    problem = read_problem(folder)
    chosen = [c for c in candidates(problem) if c.label in CHOICE]
    search = Search(simulator(problem), only=chosen)
    found = search.round(search.calibrated())
    search.close()
    return found


def test_play_is_named_with_its_size(sets: dict[str, Path]) -> None:
    winner = searched(sets["backlash"]).winner
    assert winner is not None
    assert [e.label for e in winner.effects] == ["backlash at gearbox"]
    # the plant moves in ticks, the model does not: a twentieth
    assert winner.estimate.values["gearbox.backlash.gap"] == pytest.approx(GAP, rel=0.05)


def test_a_soft_gear_has_no_play(sets: dict[str, Path]) -> None:
    winner = searched(sets["elastic_gear"]).winner
    assert winner is not None
    assert [e.label for e in winner.effects] == ["elastic at gearbox"]
    value = winner.estimate.values["gearbox.elastic.1/k"]
    # as above
    assert value == pytest.approx(COMPLIANCE, rel=0.05)


def test_a_damping_that_is_not_the_fmus_is_fitted(sets: dict[str, Path]) -> None:
    """Held at the FMU's value, it bends efficiency, friction and inertia by many deviations."""
    winner = searched(sets["elastic_gear"]).winner
    assert winner is not None
    # as above
    assert winner.estimate.values["gearbox.elastic.d"] == pytest.approx(D_TWIST, rel=0.05)


def test_a_damping_that_is_the_fmus_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Held, or fitted and found there."""
    monkeypatch.setattr("benchmarks.motor_plant.D_TWIST", DECLARED)
    plain = draw(np.random.default_rng(3)).parameters
    bench = Bench(plain, "elastic_gear", COMPLIANCE)
    (folder,) = write_sets(tmp_path, [bench], SHEET, 5, 2.0, ("ST", "MS", "LW"))
    winner = searched(folder).winner
    assert winner is not None
    values = {**winner.problem.held, **winner.estimate.values}
    # as above
    assert values["gearbox.elastic.d"] == pytest.approx(DECLARED, rel=0.05)
