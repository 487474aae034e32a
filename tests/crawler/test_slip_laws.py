"""Slip laws over the track speeds, judged on sets that they were not fitted to."""

from __future__ import annotations

import numpy as np
import pytest

from sources.tools.crawler_identification import LAWS, Turns, leave_one_set_out, predict
from sources.tools.slip_laws import (
    CANDIDATES,
    LawCandidate,
    OuterSkid,
    left_out,
    nested,
    other_runs,
    path_error,
    ranked,
    simplest,
)
from tests.crawler.tables import PAPER, column, turns
from tests.support import oracle_of

E2, E3 = column(2, "e2_m"), column(2, "e3_m")
TURNS = turns()
MOVING = TURNS.group > 1  # inner track turning
PART = TURNS.where(MOVING)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_figures_of_the_page() -> None:
    table = ranked(PART, E2[MOVING], E3[MOVING], PAPER)
    got = [(str(law), rms(s.e2) * 1e3, rms(s.e3) * 1e3, s.error * 100) for law, s in table[:2]]
    want = [
        ("e2 = a + b w2, e2 + e3 = s", 3.7, 3.9, 2.00),
        ("e2 = a + b (w2 - w3), e3 = 0", 2.7, 5.4, 2.06),
    ]
    for one, other in zip(got, want, strict=True):
        assert one[0] == other[0]
        assert one[1:3] == pytest.approx(other[1:3], abs=0.051)  # printed to a tenth
        assert one[3] == pytest.approx(other[3], abs=0.0051)  # printed to a hundredth
    assert str(simplest(table)) == "e2 = a + b (w2 - w3), e3 = 0"
    floor = other_runs(PART, E2[MOVING], E3[MOVING], PAPER)
    assert floor.error * 100 == pytest.approx(1.74, abs=0.0051)  # printed to a hundredth
    assert len(CANDIDATES) == 196


@pytest.mark.slow
def test_choosing_a_law_is_worth_no_more_than_a_constant() -> None:
    score, chosen = nested(PART, E2[MOVING], E3[MOVING], PAPER)
    constant = left_out(LawCandidate(("1",)), PART, E2[MOVING], E3[MOVING], PAPER)
    assert score.error * 100 == pytest.approx(3.34, abs=0.0051)  # printed to a hundredth
    assert constant.error * 100 == pytest.approx(3.27, abs=0.0051)
    assert len({str(law) for law in chosen.values()}) == 4  # another one in each fold


def test_the_same_folds_as_the_older_evaluation() -> None:
    name = "e2 = a + b (w2 - w3), e3 = 0"
    old = leave_one_set_out(LAWS[name], PART, E2[MOVING], E3[MOVING], PAPER)
    new = left_out(LawCandidate(("1", "(w2 - w3)")), PART, E2[MOVING], E3[MOVING], PAPER)
    got = rms(new.e2), rms(new.e3), rms(new.radius), rms(new.w_z)
    assert got == pytest.approx((old.e2, old.e3, old.R_S, old.w_z), rel=1e-9)  # rounding


@pytest.mark.parametrize(
    "law", [LawCandidate(("1", "w2"), ("sum",)), LawCandidate(("K",)), OuterSkid()], ids=str
)
def test_a_law_is_found_in_turns_that_follow_it(law: LawCandidate | OuterSkid) -> None:
    # shifts that the law itself gives, at speeds of 5 sets: nothing is left on the set left out
    e2, e3 = law.fitted(PART, E2[MOVING], E3[MOVING])(TURNS)
    w_z, radius = predict(TURNS, e2, e3, PAPER)
    made = Turns(TURNS.w2, TURNS.w3, w_z, radius, TURNS.group)
    assert path_error(made, e2, e3, PAPER, np.pi / 2).max() < 1e-12  # rounding
    score = left_out(law, made, e2, e3, PAPER)
    assert score.error < 1e-6  # tolerance of the nonlinear fit
    table = ranked(made, e2, e3, PAPER)
    assert table[0][1].error < 1e-6
    assert any(str(other) == str(law) and s.error < 1e-6 for other, s in table[:30])


def test_the_fmu_takes_the_law_with_a_constant_sum() -> None:
    model = oracle_of("crawler.paper/slip_law")
    law = {"slip_a": 0.02, "slip_b": 0.005, "slip_c": 0.005, "e_inner": 0.02, "exchange": 1.0}
    for w2, w3 in ((3.3, 1.3), (4.8, 0.6)):
        got = model.outputs({"w2": w2, "w3": w3, **law})
        # exp(-(0.6/0.1)^2) = 2e-16 of the locked values remain; 1e-6 rad/s rounds the speeds
        assert got["e2"] == pytest.approx(0.02 + 0.005 * w2, abs=1e-9)
        assert got["e2"] + got["e3"] == pytest.approx(0.04, abs=1e-9)
