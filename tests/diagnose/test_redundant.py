"""Of parameters that undo a law's strength, those are held that the data do not miss."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.diagnose.models import Fitted
from cosim.diagnose.redundant import without_redundant
from tests.diagnose import built
from tests.diagnose.built import Rig

PLACE = "load.flange.bearing_drag."
STRENGTH, SPEED = f"{PLACE}tau_ref", f"{PLACE}w_ref"
DRAG, AT, OTHER = 0.05, 10.0, 9.0
"""Drag of grease [N.m] at a speed [rad/s], and another speed that tells it as well."""


def grease(w: float, theta: float, t: float) -> float:
    """Of its two parameters only DRAG / AT^(2/3) shows."""
    return DRAG * math.copysign((abs(w) / AT) ** (2.0 / 3.0), w)


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with built.rig(tmp_path_factory.mktemp("grease"), grease) as found:
        yield found


def model(rig: Rig, usual: float) -> Fitted:
    """The law with both parameters free, one of which was tried at a usual value before."""
    return rig.added(
        rig.base, "bearing_drag", {"tau_ref": DRAG, "w_ref": AT}, held={"w_ref": usual}
    )


def held(rig: Rig, fitted: Fitted) -> Fitted:
    assert fitted.signature is not None
    return without_redundant(rig.search, fitted, fitted.signature.probe.others)


def test_a_parameter_that_undoes_the_strength_keeps_its_usual_value(rig: Rig) -> None:
    """As the law was tried with, not the nominal one; the strength is known then."""
    before = model(rig, OTHER)
    assert not before.estimate.identifiable[before.problem.index(STRENGTH)]
    found = held(rig, before)
    assert found.problem.names == ("J", "b", STRENGTH)
    assert found.problem.constants[SPEED] == OTHER
    assert found.estimate.identifiable[found.problem.index(STRENGTH)]
    expected = DRAG * (OTHER / AT) ** (2.0 / 3.0)
    assert found.estimate.values[STRENGTH] == pytest.approx(expected, rel=0.05)
    assert found.effects == before.effects and found.signature is before.signature
    assert rig.said[-1] == f"{SPEED} = {OTHER:g}: the data do not tell it from the others"


def test_one_that_the_data_miss_stays_free(rig: Rig) -> None:
    """Greased for such speeds, it would be viscous at all that the disc has."""
    before = model(rig, 1000.0)
    assert held(rig, before) is before


def test_it_stays_free_where_declared_parameters_undo_the_strength(rig: Rig) -> None:
    before = model(rig, OTHER)
    known = np.array([name == SPEED for name in before.problem.names])
    before = replace(before, estimate=replace(before.estimate, identifiable=known))
    assert held(rig, before) is before


def test_it_stays_free_where_the_strength_is_known(tmp_path: Path) -> None:
    """What else is open, another law undoes, which is one too many."""
    with built.rig(tmp_path, lambda w, theta, t: 0.01 * math.tanh(w / 2e-3)) as rig:
        before = rig.added(rig.base, "coulomb", {"tau_c": 0.01, "w_0": 2e-3})
        assert before.estimate.identifiable.tolist() == [True, True, True, False]
        assert held(rig, before) is before
