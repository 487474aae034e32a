"""What a thorough fit that cannot be made leaves behind, and fits that come back from the memo."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate.simulator import Simulator
from cosim.diagnose import diagnosis, fitter
from cosim.diagnose.answer import Verdict
from cosim.diagnose.facts import Model, Table
from cosim.diagnose.localise import UnknownInput, localise, worst
from cosim.diagnose.result import Diagnosis
from cosim.errors import CosimError
from cosim.spec.hints import SearchHints
from tests.diagnose import built

LATTICE = 1.7e-3
"""A grid [N.m] on which no fit of the friction ends by itself."""


def rubbing(w: float, theta: float, t: float) -> float:
    return 0.05 * math.copysign(1.0, w) + 0.02 * w * abs(w)


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[built.Rig]:
    """A disc with friction and drag that nobody has declared."""
    with built.rig(tmp_path_factory.mktemp("disc"), rubbing) as found:
        yield found


@pytest.fixture
def unstable(monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps finer than the search's cannot be simulated."""

    def corrected(*args: object) -> Simulator:
        raise CosimError("unstable at this step")

    monkeypatch.setattr(fitter, "corrected", corrected)


def test_a_fit_of_the_memo_comes_back_with_derivatives(rig: built.Rig, unstable: None) -> None:
    """Without them no force at a port can be asked for."""
    rig.added(rig.base, "coulomb", {"tau_c": 0.03})
    (known,) = (f for f in rig.search.memo if f.effects)
    assert known.estimate.jacobian == []
    found = rig.search.recalled(known, rig.base)
    assert found.labels == known.labels and len(found.estimate.jacobian) == 2
    assert rig.search.gain(known, found) == pytest.approx(0.0, abs=0.1)  # the last steps of a fit
    assert localise(rig.search, found, [rig.candidate("coulomb")])


def test_what_was_held_of_a_law_is_said(rig: built.Rig) -> None:
    model = rig.added(rig.base, "coulomb", {"tau_c": 0.03}, held={"w_0": 1e-3})
    law = rig.search.law(model, model.effects[-1])
    assert [v.name for v in law.values] == ["tau_c"] and law.held == (("w_0", 1e-3),)
    table = Table(models=(Model((law,), 3, 1.0, 0.0, ()),))
    assert Table.read(json.loads(json.dumps(table.to_dict()))) == table
    (told,) = Verdict("effect_found", laws=(law,), shares={law.label: 1.0}).effects()
    assert told["held"] == {"w_0": 1e-3}


def test_no_model_takes_values_of_a_grid_at_which_it_was_not_fitted(
    rig: built.Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    free = rig.added(rig.base, "coulomb", {"tau_c": 0.03})
    on_grid = [
        replace(p, hints=SearchHints(lattice=LATTICE)) if p.name.endswith("tau_c") else p
        for p in free.problem.parameters
    ]
    simulator = free.simulator.of(free.problem.with_parameters(on_grid))
    free = replace(free, estimate=replace(free.estimate, simulator=simulator))
    monkeypatch.setattr(fitter, "GATE", np.inf)  # any value of the grid does as well
    assert rig.search.snapped(free, rig.base) is not free
    monkeypatch.setattr(rig.search, "sharpened", lambda quick, base, *, draft=False: quick)
    assert rig.search.snapped(free, rig.base) is free


def test_runs_that_end_earlier_do_so_for_forces_too(tmp_path: Path) -> None:
    with built.rig(tmp_path, rubbing, unstable=True) as rig:
        model = rig.added(rig.base, "coulomb", {"tau_c": 0.03})
        half = {run.name: run.times.size // 2 for run in rig.search.raw.runs}
        cut = rig.search.shortened(model, half)
        assert [run.times.size for run in rig.search.declared.runs] == list(half.values())
        assert localise(rig.search, cut, [rig.candidate("coulomb")])


@pytest.mark.parametrize("coarse", [False, True])
def test_an_unknown_input_of_nothing_changes_nothing(tmp_path: Path, coarse: bool) -> None:
    """Neither where a model has start values of its own, nor where a search runs coarsely."""
    with built.hanging(tmp_path) if coarse else built.rig(tmp_path, rubbing, unstable=True) as rig:
        base = rig.added(rig.base, "coulomb", {"tau_c": 0.03})
        if not coarse:
            runs = [replace(run, starts={**run.starts, "load.angle": 0.4})
                    for run in base.problem.runs]  # fmt: skip
            simulator = base.simulator.of(base.problem.changed(runs=runs))
            base = rig.search.fitted(simulator, base.estimate.theta, share=1e9)
        bench = UnknownInput(rig.search, base, worst(rig.search, base, 3), "load", "flange")
        names = tuple(bench.names)
        change, _ = bench.at(names, s_last=1.0)
        assert np.all(change == 0.0)
        change, _ = bench.at(names, s_last=1.0, **{"c[1]": 0.1})
        assert np.any(np.abs(change) > 1.0)


def test_starts_that_cannot_be_simulated_leave_the_others(rig: built.Rig) -> None:
    search, simulator = rig.search, rig.base.simulator
    good = rig.base.estimate.theta
    worse, bad = good * 1.1, good.copy()
    bad[simulator.problem.index("J")] = -1.0
    ranked = search.ranked(simulator, [bad, worse, good])
    assert [theta is good for _, theta in ranked] == [True, False]
    assert ranked[0][0] == search.cost(simulator, good) < ranked[1][0]
    with pytest.raises(CosimError):
        search.ranked(simulator, [bad])


def test_the_model_is_the_one_that_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where another set is proposed when there is no turn left."""
    monkeypatch.setattr(diagnosis, "TURNS", 0)
    with built.rig(tmp_path, lambda w, theta, t: 2e-4 * w * abs(w)) as rig:
        result = Diagnosis(rig.search.raw, Verdict(""), search=rig.search, before=rig.base)
        poor = rig.added(rig.base, "coulomb", {"tau_c": 0.03})
        right = rig.added(rig.base, "quadratic_drag", {"c": 2e-4})
        current = diagnosis._judged(result, rig.search, poor, [])
        assert result.after is current and current.labels == right.labels
        assert {law.label for law in result.answer.laws} == right.labels
