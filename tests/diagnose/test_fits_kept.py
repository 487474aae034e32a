"""Which fit of a set is kept, and what is told of it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from cosim.calibrate.estimate import Estimate
from cosim.calibrate.fit import CORRECTION, INTERVALS, Effort
from cosim.calibrate.simulator import Simulator
from cosim.data.signals import Table
from cosim.diagnose import fitter
from cosim.diagnose.adding import made_of
from cosim.diagnose.candidates import candidates
from cosim.diagnose.experiment import scaled
from cosim.diagnose.late_values import LateValueFitter
from cosim.diagnose.search import Search
from cosim.diagnose.table import table_of
from cosim.diagnose.values import exact
from cosim.errors import CosimError
from tests.diagnose import built
from tests.problems import simulator

Vector = NDArray[np.float64]


def rubbing(w: float, theta: float, t: float) -> float:
    return 0.05 * math.tanh(w / 2e-3)


@pytest.mark.parametrize("good", [1, 0])
def test_corrections_of_the_exchange_that_lead_away_are_not_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, good: int
) -> None:
    """Each fit begins where the last one ended; the best one by its own values counts.

    If that is the first, it gets intervals where it is.
    """
    with built.hanging(tmp_path) as rig:
        quick = rig.added(rig.base, "unbalance", {"m_u": 0.5, "psi": 0.4})
        kept, begun = fitter.fit, []

        def away(simulator: Simulator, theta: Vector, **options: Effort) -> Estimate:
            """So many good fits, and then farther off each time."""
            found = kept(simulator, theta, **options)  # type: ignore[arg-type]
            begun.append(options["effort"])
            off = 1.0 if options["effort"] is INTERVALS else 1.1 ** max(len(begun) - good, 0)
            return replace(found, theta=found.theta * off)

        monkeypatch.setattr(fitter, "fit", away)
        monkeypatch.setattr(LateValueFitter, "stale", lambda self, fitted: math.inf)
        found = rig.search.sharpened(quick, rig.base)
        assert begun == ([CORRECTION, CORRECTION] if good else [CORRECTION, INTERVALS])
        if not good:
            assert np.array_equal(found.estimate.theta, quick.estimate.theta)
        left = np.mean((rig.search.fit_data - found.fit) ** 2)
        assert left <= np.mean((rig.search.fit_data - quick.fit) ** 2)


def test_a_refused_fit_leaves_the_memo_as_it_was(tmp_path: Path) -> None:
    """Of a friction that falls with speed, and has no direction: a is not wanted."""

    def falling(w: float, theta: float, t: float) -> float:
        return 0.05 * math.exp(-((w / 0.5) ** 2)) * math.tanh(w / 0.05)

    with built.rig(tmp_path, falling) as rig:
        search = rig.search
        fitted = rig.added(rig.base, "asymmetric_coulomb", {"tau_c": 0.05}, held={"w_0": 0.05})
        fitted = search.sharpened(fitted, rig.base)
        before = table_of(search, [], {}, {}).models[1]
        assert search.refined(rig.base, fitted) is fitted
        assert table_of(search, [], {}, {}).models[1] == before


def test_the_model_that_is_told_has_what_a_law_was_held_at(tmp_path: Path) -> None:
    with built.rig(tmp_path, lambda w, theta, t: 0.05 * math.sin(7.0 * theta + 0.4)) as rig:
        search = rig.search
        fitted = rig.added(rig.base, "cogging", {"tau_c": 0.05, "psi": 0.4}, held={"n": 7.0})
        fitted = search.sharpened(fitted, rig.base)
        values = made_of(search.raw, fitted)["values"]
        assert values["load.flange.cogging.n"] == 7.0
        problem = fitted.effects[0].added_to(search.raw)
        theta = np.array([values[p.targets[0][0]] for p in problem.parameters])
        model = exact(search.simulator.of(problem), theta, search.raw, search.fitting)
        assert np.mean((search.fit_data - model) ** 2) < 1.1  # 113 with the law's usual cycles


def test_a_fit_of_the_memo_is_recounted_from_what_it_leaves(tmp_path: Path) -> None:
    with built.rig(tmp_path, rubbing, unstable=True, angle=0.1) as rig:
        known = rig.search.memo.get(frozenset())
        assert known is not None and not known.estimate.residuals
        whole = rig.search.recounted(rig.base).estimate.robust
        # start values of unused runs have priors that a fit does not count
        assert rig.search.recounted(known).estimate.robust == pytest.approx(whole, rel=1e-3)


def test_the_declared_model_may_be_all_that_cannot_be_fitted_thoroughly(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def steep(*args: object, **options: object) -> None:
        raise CosimError("too steep")

    with built.rig(tmp_path, rubbing) as rig:
        monkeypatch.setattr(fitter, "fit", steep)
        assert rig.search.sharpened(rig.base, rig.base) is rig.base
        assert "the declared model could not be fitted thoroughly: too steep" in rig.said


def test_a_scaled_run_holds_its_inputs_as_long_as_the_run_did(tmp_path: Path) -> None:
    with built.rig(tmp_path, rubbing) as rig:
        run = rig.base.problem.runs[0]
        ((name, signal),) = run.inputs.items()
        assert isinstance(signal, Table)
        short = Table(signal.times[:-40], signal.values[:-40], extend=True)
        found = scaled(replace(run, inputs={name: short}), 1.5)
        assert found is not None and found.inputs[name].extend  # type: ignore[union-attr]


def test_around_a_model_without_laws_all_are_asked_again(tmp_path: Path) -> None:
    problem = built.problem(tmp_path, rubbing)
    search = Search(simulator(problem), without={c.effect for c in candidates(problem)} - {"delay"})
    try:
        base = search.calibrated()
        known = {c.label for c in search.known}
        one = next(c for c in search.known)
        beside = search.fitted(search.simulator.of(one.added_to(base.problem)),
                               np.append(base.estimate.theta, 0.02))  # fmt: skip
        beside.effects = (one,)
        search.scored(beside)
        assert {c.label for c in search.known} != known
        search.scored(base)
        assert {c.label for c in search.known} == known
    finally:
        search.close()
