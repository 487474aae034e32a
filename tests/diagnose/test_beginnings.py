"""Where fits and trials begin when first orders do not lead to what is missing."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate.mapping import read_problem
from cosim.diagnose import fitter
from cosim.diagnose.candidates import delays
from cosim.diagnose.diagnosis import diagnose
from cosim.diagnose.doubling import doubled
from cosim.diagnose.models import Fitted
from cosim.diagnose.rivals import _sharpest
from cosim.diagnose.search import Search
from cosim.diagnose.sticking import sharper
from tests.diagnose import built, disc
from tests.diagnose.built import ANCHOR, SEARCH_STEP, WEIGHT, Rig
from tests.problems import simulator

USUAL, SIZE = 2e-3, 0.1
"""Speed over which a sign is smoothed [rad/s], and friction [N.m]."""
STRENGTH, SMOOTHING = "load.flange.coulomb.tau_c", "load.flange.coulomb.w_0"
LATE = 0.7 * 2.0 * math.pi / disc.SWING
"""Of a clock [s]: it seems to be early by three tenths of a period."""


def dry(w: float, theta: float, t: float) -> float:
    return SIZE * math.tanh(w / USUAL)


def creeping(w: float, theta: float, t: float) -> float:
    return SIZE * math.tanh(w / (100.0 * USUAL))


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """A disc with dry friction."""
    with built.rig(tmp_path_factory.mktemp("dry"), dry, unstable=True) as found:
        yield found


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Search]:
    """A disc that swings at one frequency, whose speed has been logged late."""
    folder = disc.write(
        tmp_path_factory.mktemp("late"), lambda w, theta, t: 0.0, seconds=2.4, names=["swing"]
    )
    table = np.loadtxt(folder / "swing.csv", delimiter=",", skiprows=1)
    shift = round(LATE / disc.INTERVAL)
    table[shift:, 2] = table[:-shift, 2]
    table[:shift, 2] = 0.0
    np.savetxt(folder / "swing.csv", table, delimiter=",", header="time,tau,w,theta", comments="")
    search = Search(simulator(read_problem(folder)), only=[])
    yield search
    search.close()


# -- larger strengths ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("start", "most", "found"), [(0.13, 1.0, 1.0), (0.5, 1.0, 1.0), (0.13, 0.4, 0.4), (1.3, 2, 1.3)]
)
def test_a_strength_is_doubled_as_long_as_that_is_better(
    rig: Rig, start: float, most: float, found: float
) -> None:
    """To a power of two, never past its bound; not at all where it is right or too large.

    Args:
        rig: a disc with friction.
        start, most, found: where it begins, its bound, and where it ends, over what is right.
    """
    model = rig.added(rig.base, "coulomb", {"tau_c": SIZE}, fit=False)
    problem = model.problem.with_parameters(
        [replace(p, maximum=most * SIZE) if p.strength else p for p in model.problem.parameters]
    )
    of, theta = rig.search.simulator.of(problem), np.array([disc.J, disc.B, start * SIZE])
    end = doubled(
        lambda at: rig.search.cost(of, at), of.problem, theta, rig.search.cost(of, theta), STRENGTH
    )
    assert end[2] == pytest.approx(found * SIZE, rel=0.05) and theta[2] == start * SIZE


@pytest.mark.parametrize(
    ("start", "usual", "found"), [(0.02, 0.3, 0.32), (0.0, 0.3, 0.3), (0.02, 0.0, 0.02)]
)
def test_up_to_the_usual_strength_all_are_tried(
    late: Search, start: float, usual: float, found: float
) -> None:
    """A delay far below the right one shifts a swing the wrong way, and does harm.

    Not where first orders hold (no usual strength is given).
    """
    (clock,) = [c for c in delays(late.raw) if c.label == "delay at log.w"]
    of = late.simulator.of(clock.added_to(late.raw))
    theta = np.array([disc.J, disc.B, start])
    cost = late.cost(of, theta)
    assert late.cost(of, np.array([disc.J, disc.B, start + 0.02])) > cost
    end = doubled(
        lambda at: late.cost(of, at), of.problem, theta, cost, f"{clock.prefix}t_d", usual
    )
    assert end[2] == pytest.approx(found)


def test_of_usual_strengths_the_best_is_kept_though_none_leads_there(late: Search) -> None:
    """A residual that swings at one frequency says nothing of what is off by most of a period."""
    (clock,) = [c for c in delays(late.raw) if c.label == "delay at log.w"]
    base = late.calibrated()
    bench = late.bench(base, late.fitting)
    (alone,), (trials,) = bench.begun([clock]), bench.begun([clock], thorough=True)
    assert trials.best is not None and alone.best is not None and not trials.going
    tries = trials.probe.strength.hints.tries
    assert trials.best.value == min(tries, key=lambda value: abs(value - LATE))
    assert trials.best.score.gain > 2.0 * alone.best.score.gain


# -- sharper laws ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("begun", "power"), [(USUAL, 0), (0.02, 1), (0.2, 2)])
def test_a_law_begins_as_sharp_as_the_data_want_it(rig: Rig, begun: float, power: int) -> None:
    """What smooths nothing (how uneven it is may be negative) stays."""
    whole = rig.candidate("asymmetric_coulomb").added_to(rig.base.problem)
    prefix = "load.flange.asymmetric_coulomb."
    values = {"J": disc.J, "b": disc.B, prefix + "tau_c": SIZE}
    fixed = {prefix + "w_0": begun, prefix + "a": -0.002}
    found = _sharpest(rig.search, whole, values, fixed)
    assert found == {prefix + "w_0": pytest.approx(begun * 0.1**power), prefix + "a": -0.002}


def near(rig: Rig, smoothing: float) -> tuple[Fitted, Fitted]:
    """A model with friction that creeps so fast, and without it, where runs may turn unstable.

    Residuals count in full while all of them are large, and by their logarithm from then on.
    """
    rig.search.count_in_full(False)
    base = rig.search.recounted(rig.base)
    return base, rig.added(base, "coulomb", {"tau_c": SIZE}, held={"w_0": smoothing}, fit=False)


def test_a_law_that_smooths_a_sign_is_fitted_sharp_where_runs_turn_unstable(rig: Rig) -> None:
    base, model = near(rig, 0.2)
    found = sharper(rig.search, model, base)
    assert found.estimate.robust < 0.5 * model.estimate.robust
    assert found.problem.constants[SMOOTHING] == pytest.approx(USUAL)
    assert found.signature is not None and found.labels == model.labels
    assert not found.signature.fixed  # it is where it is usual, which nobody chose
    assert rig.said[-1] == "coulomb at load.flange: sticks more nearly than usual"


def test_it_is_kept_so_only_if_that_is_better(tmp_path: Path) -> None:
    with built.rig(tmp_path, creeping, unstable=True) as rig:
        base, model = near(rig, USUAL)
        before = rig.search.evaluations
        assert sharper(rig.search, model, base) is model
        assert rig.search.evaluations > before


def test_one_that_cannot_be_simulated_so_stays(rig: Rig) -> None:
    base, model = near(rig, 0.2)
    usual = rig.search.simulator
    rig.search.simulator = usual.limited({run.name: 1.0 for run in rig.search.raw.runs})
    try:
        assert sharper(rig.search, model, base) is model
    finally:
        rig.search.simulator = usual
    assert rig.said[-1].startswith("coulomb at load.flange with {")


def test_calm_systems_are_not_asked(rig: Rig) -> None:
    base, model = near(rig, 0.2)
    rig.search.count_in_full()
    before = rig.search.evaluations
    assert sharper(rig.search, model, base) is model and rig.search.evaluations == before


# -- fits that have not ended ----------------------------------------------------------------------


LIGHT = 0.1


@pytest.fixture
def hanging(tmp_path: Path) -> Iterator[Rig]:
    """A disc with a weight beside its axis, run coarsely in a search."""
    with built.hanging(tmp_path) as rig:
        yield rig


@pytest.mark.parametrize("most", [fitter.CORRECTIONS, 1])
def test_errors_of_the_exchange_are_taken_off_again_where_a_fit_has_ended_elsewhere(
    hanging: Rig, monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    """With the law at a third of its size they are others; one correction does not do."""
    monkeypatch.setattr(fitter, "CORRECTIONS", most)
    values = {"m_u": WEIGHT / 3.0, "psi": ANCHOR}
    far = hanging.added(hanging.base, "unbalance", values, fit=False)
    found = hanging.search.sharpened(far, hanging.base)
    assert found.problem.step == SEARCH_STEP
    assert (hanging.search.stale(found) <= fitter.STALE) is (most > 1)


def test_a_law_whose_freed_parameters_stall_is_fitted_with_derivatives_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of the law with its anchor held lead nowhere; the data want the anchor all the same."""

    def law(w: float, theta: float, t: float) -> float:
        return LIGHT * math.sin(theta + ANCHOR)

    with built.rig(tmp_path, law) as rig:
        plain = rig.added(rig.base, "unbalance", {"m_u": 0.5 * LIGHT})
        monkeypatch.setattr(fitter, "ITERATIONS", 1)
        found = rig.search.refined(rig.base, plain)
        name = "load.flange.unbalance.psi"
        assert name not in plain.problem.names
        assert found.estimate.values[name] == pytest.approx(ANCHOR, abs=0.02)


@pytest.mark.slow
def test_unused_runs_begin_where_the_last_model_wants_them(tmp_path: Path) -> None:
    """Not where the one before did, which lacked the second law: their start angles are 0.1 rad."""

    def law(w: float, theta: float, t: float) -> float:
        return 0.03 * math.tanh(w / 2e-3) + 0.05 * math.sin(theta)

    problem = built.problem(tmp_path, law, 2.0, names=tuple(disc.RUNS), unstable=True, angle=0.1)
    found = diagnose(problem, law=False)
    assert found.verdict == "effect_found"
    assert {item.effect for item in found.answer.laws} == {"coulomb", "unbalance"}
    for run in problem.chosen("validation"):
        # a few deviations of an angle that a run of 2 s tells to half a thousandth
        assert found.start_values()[run.name]["angle"] == pytest.approx(0.1, abs=2e-3)
