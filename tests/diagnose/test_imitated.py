"""Laws that calibration imitates nearly in whole: tried weakly, and fitted where no other does.

Of a strong trial only curvature is left.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from cosim.calibrate.mapping import read_problem
from cosim.calibrate.problem import Problem
from cosim.calibrate.simulator import Simulator
from cosim.diagnose.candidates import candidates
from cosim.diagnose.judge import Judge
from cosim.diagnose.rounds import Round
from cosim.diagnose.search import CHECK, Search
from cosim.diagnose.secant import CURVED, TANGENT
from cosim.diagnose.shortlist import IMITATED, promising
from cosim.diagnose.signature import Signature
from cosim.diagnose.trials import nearer
from tests.diagnose import disc, plants
from tests.problems import simulator

Vector = NDArray[np.float64]
RUB, DRAG = "coulomb at load.flange", "quadratic_drag at load.flange"
WEIGHT = "unbalance at load.flange"


@pytest.fixture
def plain(tmp_path: Path) -> Problem:
    """A disc."""
    return read_problem(disc.write(tmp_path, lambda w, theta, t: 0.0, seconds=1.6))


def signature(judge: Judge, label: str, gain: float, absorbed: float, z: float = 9.0) -> Signature:
    """A candidate that gains so much, of which calibration absorbs a share."""
    (candidate,) = [c for c in candidates(judge.raw) if c.label == label]
    return replace(plants.gaining(judge, candidate, gain, z), absorbed=absorbed)


@pytest.mark.parametrize(("gain", "z", "last"), [(30.0, -5.0, True), (15.0, 5.0, False),
                                                 (30.0, 1.0, False)])  # fmt: skip
def test_what_calibration_imitates_is_fitted_last_if_it_promises_enough(
    plain: Problem, gain: float, z: float, last: bool
) -> None:
    judge = Judge(plain, CHECK)
    known = [signature(judge, DRAG, gain, 1.0, z), signature(judge, RUB, 100.0, 0.5)]
    stage = Round(plants.leaving(judge, 1.5), known, {RUB: 1e-6, DRAG: 1e-6})
    found = [s.candidate.label for s in promising(judge, stage)]
    assert found == [RUB, DRAG] if last else found == [RUB]


def test_no_more_of_them_than_a_few(plain: Problem) -> None:
    judge = Judge(plain, CHECK)
    labels = [c.label for c in candidates(plain)][: IMITATED + 2]
    known = [signature(judge, label, 50.0, 1.0) for label in labels]
    known.append(signature(judge, RUB, 100.0, 0.5))
    stage = Round(plants.leaving(judge, 1.5), known, dict.fromkeys([*labels, RUB], 1e-6))
    assert len(promising(judge, stage)) == 1 + IMITATED


def test_of_two_trials_that_calibration_absorbs_the_one_that_gains_more_counts(
    plain: Problem,
) -> None:
    judge = Judge(plain, CHECK)
    strong, weak = (signature(judge, DRAG, gain, 0.99) for gain in (5.0, 50.0))
    strong = replace(strong, score=replace(strong.score, amplitude=0.9))
    weak = replace(weak, score=replace(weak.score, amplitude=-40.0))
    assert nearer(weak, strong) and not nearer(strong, weak)
    # one that shows, but asks for none of the law, says less than one that is absorbed and gains
    none = replace(strong, absorbed=0.9, score=replace(strong.score, amplitude=0.0, gain=0.0))
    assert nearer(weak, none) and not nearer(none, weak)
    # where calibration absorbs less, the one that is asked for
    seen = [replace(s, absorbed=0.5) for s in (strong, weak)]
    assert nearer(seen[0], seen[1]) and not nearer(seen[1], seen[0])


def test_a_trial_that_changes_much_and_is_absorbed_is_made_again_along_the_tangent(
    plain: Problem,
) -> None:
    search = Search(simulator(plain), only=[])
    base = search.calibrated()
    bench = search.bench(base, search.fitting)
    (weight,) = [c for c in candidates(plain) if c.label == WEIGHT]
    (viscous,) = [c for c in candidates(plain) if c.label == "viscous at load.flange"]
    for candidate, again in ((viscous, True), (weight, False)):  # the disc has friction already
        (trials,) = bench.begun([candidate])
        assert trials.best is not None and trials.best.curved is again
        if again:
            assert trials.tried[0] == trials.probe.strength.span and len(trials.tried) == 2
            values = trials.probe.values(trials.tried[0], 0.0, {})
            change = bench.at(trials.probe.problem, values) - bench.model
            size = search.fitting.largest(change)
            assert size > CURVED
            assert trials.tried[1] == pytest.approx(trials.tried[0] * TANGENT / size)
    search.close()


def test_a_fit_of_one_may_begin_along_the_tangent(plain: Problem) -> None:
    """At what was simulated, with so much of the shift as goes with that: the rest is curvature."""
    search = Search(simulator(plain), only=[c for c in candidates(plain) if c.label == DRAG])
    base = search.calibrated()
    search.note(base)
    (item,) = search.scored(base).signatures
    far = replace(item, score=replace(item.score, amplitude=50.0 * item.score.amplitude))
    starts: list[Vector] = []
    usual = search.cost

    def cost(simulator: Simulator, theta: Vector) -> float:
        starts.append(theta)
        return usual(simulator, theta)

    search.cost = cost  # type: ignore[method-assign]
    search.refit(base, far)
    search.close()
    place = starts[0].size - 1
    full, part = (np.array([s[place], *(s[:2] - base.estimate.theta[:2])]) for s in starts[:4:3])
    assert part[0] == pytest.approx(item.value)
    assert np.any(full[1:] != 0.0)
    np.testing.assert_allclose(part, full * (part[0] / full[0]), rtol=1e-9, atol=1e-12)


def test_a_first_order_of_the_wrong_sign_begins_at_the_bound(plain: Problem) -> None:
    """A drag that should be negative has no strength left to share the shift by."""
    search = Search(simulator(plain), only=[c for c in candidates(plain) if c.label == DRAG])
    base = search.calibrated()
    search.note(base)
    (item,) = search.scored(base).signatures
    found = search.refit(base, replace(item, score=replace(item.score, amplitude=-3.0)))
    search.close()
    assert found is not None and found.estimate.values[item.strength.name] >= 0.0
