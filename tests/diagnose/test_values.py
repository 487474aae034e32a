"""Model values with the rig's own exchange are simulated where a comparison asks for them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate.simulator import Simulator
from cosim.diagnose import table
from cosim.diagnose.models import Fitted
from cosim.diagnose.table import table_of
from cosim.errors import StepError
from tests.diagnose import built
from tests.diagnose.built import ANCHOR, SEARCH_STEP, WEIGHT, Rig

SHARE = 0.9
"""Of the best model's gain, which a drag that holds the disc fast does not reach."""


@pytest.fixture
def hanging(tmp_path: Path) -> Iterator[Rig]:
    """A disc with a weight beside its axis, run coarsely in a search."""
    with built.hanging(tmp_path) as rig:
        yield rig


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Communication steps at which identification runs are simulated."""
    steps: list[float] = []
    simulate = Simulator.simulate

    def counted(self: Simulator, theta, run):  # type: ignore[no-untyped-def]
        name = run if isinstance(run, str) else run.name
        if self.problem.run(name).purpose == "identification":
            steps.append(self.problem.step)
        return simulate(self, theta, run)

    monkeypatch.setattr(Simulator, "simulate", counted)
    return steps


def weighted(rig: Rig, share: float = 1.0) -> Fitted:
    """The model with the weight at this share of its size."""
    values = {"m_u": share * WEIGHT, "psi": ANCHOR}
    return rig.added(rig.base, "unbalance", values, fit=False)


def test_fitted_runs_are_simulated_at_the_rigs_step_when_they_are_asked_for(
    hanging: Rig, asked: list[float]
) -> None:
    found = weighted(hanging)
    assert asked and min(asked) == SEARCH_STEP
    near = found.values.nearly().fit
    assert min(asked) == SEARCH_STEP
    exact = found.fit
    assert min(asked) < SEARCH_STEP
    # what the search's exchange adds here, beside what it adds without a weight
    assert 0.0 < np.linalg.norm(near - exact) < 0.1 * np.linalg.norm(exact - hanging.base.fit)
    del asked[:]
    assert found.fit is exact and found.values.nearly().fit is exact and not asked


def test_a_model_that_the_rigs_exchange_cannot_follow_is_judged_with_the_searchs(
    hanging: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = weighted(hanging)

    def fails(*_: object) -> None:
        raise StepError("the load failed", time=0.3)

    monkeypatch.setattr("cosim.diagnose.values.step_error", fails)
    near = found.values.nearly().fit
    del hanging.said[:]
    np.testing.assert_array_equal(found.fit, near)
    assert hanging.said == ["the load failed; it is judged with the search's exchange"]


@pytest.mark.parametrize("least", [SHARE, 0.0])
def test_models_far_from_the_best_are_not_simulated_again_for_the_table(
    hanging: Rig, asked: list[float], monkeypatch: pytest.MonkeyPatch, least: float
) -> None:
    monkeypatch.setattr(table, "RIVALS", least)
    search = hanging.search
    good = weighted(hanging)
    poor = hanging.added(hanging.base, "quadratic_drag", {"c": 1e-4}, fit=False)
    for model in (hanging.base, good, poor):
        search.note(model)
    assert hanging.base.fit.size and good.fit.size
    assert search.total(hanging.base, poor) < SHARE * search.total(hanging.base, good)
    del asked[:]
    found = table_of(search, [], {}, {})
    assert (min(asked) == SEARCH_STEP) is (least > 0.0)
    assert [model.fitted for model in found.models[:2]] == [
        -search.fitting.cost(search.fit_data - f.fit) for f in (hanging.base, good)
    ]
