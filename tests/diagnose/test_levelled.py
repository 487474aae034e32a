"""Laws that are nearly one are told apart by their minima, not by where rough fits end."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

from cosim.calibrate.fit import INTERVALS, fit
from cosim.diagnose.levelled import CLOSE, levelled
from cosim.diagnose.models import GATE, Fitted
from tests.diagnose import built
from tests.diagnose.built import Rig

DRY, USUAL = 0.05, 2e-3
"""Friction [N.m], and the speed over which the laws of the catalogue smooth its sign [rad/s]."""


def friction(w: float, theta: float, t: float) -> float:
    return DRY * math.tanh(w / USUAL)


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """A disc with dry friction."""
    with built.rig(tmp_path_factory.mktemp("dry"), friction) as found:
        yield found


@pytest.fixture(scope="module")
def named(rig: Rig) -> Fitted:
    """The model that says so, fitted to the end."""
    quick = rig.added(rig.base, "coulomb", {"tau_c": DRY})
    return rig.search.sharpened(quick, rig.base)


FALLING = {"tau_s": DRY, "w_s": 30.0}
"""Friction that falls with speed, so slowly that viscous friction makes up for it."""
NEAR, FAR = 0.001, 0.01
"""Shares of all parameters by which rough fits end beside their minima."""


def ended(rig: Rig, away: float) -> tuple[Fitted, Fitted]:
    """The other law's fit, and one that ended beside it, which is all that is known."""
    search, best = rig.search, rig.added(rig.base, "stribeck", FALLING)
    theta = best.estimate.theta * (1.0 + away)
    early = search.judged(fit(best.simulator, theta, effort=INTERVALS))
    search.memo.keep(search.again(early, best, rig.base))
    return best, early


def known(rig: Rig, fitted: Fitted) -> Fitted:
    """What the memo has of a set."""
    found = rig.search.memo.get(fitted.labels)
    assert found is not None
    return found


def test_a_law_close_behind_is_fitted_to_its_minimum(rig: Rig, named: Fitted) -> None:
    best, early = ended(rig, NEAR)
    search, done = rig.search, {named.labels}
    assert search.total(rig.base, early) > CLOSE * search.total(rig.base, named)
    assert search.gain(early, best) > 100.0 * GATE
    levelled(search, named, done)
    assert search.gain(best, known(rig, early)) > -GATE
    assert done == {named.labels, early.labels}
    said = len(rig.said)
    levelled(search, named, done)
    assert rig.said[said:] == []


def test_a_law_that_does_much_less_is_not(rig: Rig, named: Fitted) -> None:
    _, early = ended(rig, FAR)
    search, done = rig.search, {named.labels}
    assert 0.0 < search.total(rig.base, early) < CLOSE * search.total(rig.base, named)
    levelled(search, named, done)
    assert search.gain(early, known(rig, early)) == 0.0
    assert done == {named.labels}


def test_special_cases_are_fitted_elsewhere(rig: Rig, named: Fitted) -> None:
    """From where the set is, by `simplified`: what is nearly one with them is no other law."""
    either = rig.added(rig.base, "asymmetric_coulomb", {"tau_c": DRY, "a": 0.0})
    assert rig.search.total(rig.base, either) > CLOSE * rig.search.total(rig.base, named)
    done = {named.labels, frozenset(["stribeck at load.flange"])}
    before = set(done)
    levelled(rig.search, named, done)
    assert done == before
