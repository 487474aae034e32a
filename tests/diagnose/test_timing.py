"""Holds, delays and rate limits of one signal are told apart."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from benchmarks.own_plant import catalogue, example, made
from cosim.diagnose.search import Search
from cosim.diagnose.trials import Trials
from tests.problems import simulator

pytestmark = pytest.mark.slow

EXAMPLE = Path(__file__).parents[2] / "scenarios/motor_bench/data/MB-12"
LABELS = tuple(f"{law} at encoder.speed" for law in ("sample_hold", "delay", "rate_limit"))


@pytest.mark.parametrize("truth", LABELS)
def test_what_a_signal_lacks_in_time_is_named(truth: str) -> None:
    """On average a hold is a delay, and a period that is wrong by a percent samples at other times
    after a second; a limit that is far too low lets nothing through and so tells nothing.
    """
    rig = example(EXAMPLE, 3.0)
    known = [c for c in catalogue(rig) if c.label in LABELS]
    (item,) = [c for c in known if c.label == truth]
    plant = made(rig, item, 1e-3 if item.effect == "rate_limit" else 1.0, 11)
    search = Search(simulator(plant.problem), only=known)
    winner = search.round(search.calibrated()).winner
    search.close()
    assert winner is not None and winner.effects[-1].label == truth
    if item.effect == "sample_hold":
        found = winner.estimate.values["encoder.speed.sample_hold.t_s"]
        # fits stay at the period that they began with
        assert found == pytest.approx(0.01, rel=1e-3)


def test_strengths_are_tuned_between_trials_on_both_sides() -> None:
    def trials(asked: dict[float, float]) -> Trials:
        probe: Any = None
        return Trials(probe, 1.0, asked=asked)

    # the same ratio on both sides: the geometric mean
    assert trials({1e-3: 4.0, 1e-2: 0.25}).between() == pytest.approx(10**-2.5, rel=1e-9)
    # the nearest two count
    assert trials({1e-4: 5.0, 1e-3: 4.0, 1e-2: 0.25, 1.0: 1e-3}).between() == pytest.approx(
        10**-2.5, rel=1e-9
    )
    assert trials({1e-3: 4.0, 1e-2: 2.0}).between() is None
    assert trials({1e-3: 0.5, 1e-2: 0.2}).between() is None
    # a strength that should be negative lies on neither side
    assert trials({1e-3: 4.0, 1e-2: -0.2}).between() is None
