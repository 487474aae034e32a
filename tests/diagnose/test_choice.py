"""Which scored candidates are refitted, on plants of a few lines."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from cosim.calibrate.estimate import Estimate
from cosim.calibrate.fit import CORRECTION, fit
from cosim.calibrate.mapping import read_problem
from cosim.calibrate.nuisance import late_values
from cosim.calibrate.parts import MeasuredRun
from cosim.calibrate.problem import Problem
from cosim.calibrate.simulator import Simulator
from cosim.diagnose.candidates import candidates
from cosim.diagnose.established import examined
from cosim.diagnose.fitter import QUICKLY
from cosim.diagnose.judge import Judge
from cosim.diagnose.models import Fitted
from cosim.diagnose.rounds import Round
from cosim.diagnose.search import CHECK, Search
from cosim.diagnose.secant import PATIENCE, SOLVED
from cosim.diagnose.shortlist import REFITS, kin, promising
from cosim.diagnose.unstable import ended
from cosim.errors import FmuCallError
from tests.diagnose import disc, plants
from tests.problems import simulator

Vector = NDArray[np.float64]
PLACES = [f"base.caster_{place}.swivel" for place in ("fl", "fr", "rl", "rr")]
GROUP = "coulomb at base.caster.swivel"


def nothing(w: float, theta: float, t: float) -> float:
    return 0.0


@pytest.fixture(scope="module")
def casters(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """A base on casters."""
    return plants.base_on_casters(tmp_path_factory.mktemp("base"))


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """A disc."""
    return read_problem(disc.write(tmp_path_factory.mktemp("disc"), nothing))


def refitted(
    problem: Problem,
    promised: Mapping[str, tuple[float, float, float]],
    mean_square: float,
) -> list[str]:
    """Labels of what is refitted, of label -> gain, z and p value, the others promise nothing."""
    judge = Judge(problem, CHECK)
    known = {c.label: c for c in candidates(problem)}
    found = [plants.gaining(judge, known[n], gain, z) for n, (gain, z, _) in promised.items()]
    found.sort(key=lambda s: -s.score.gain)
    p_values = {name: p for name, (_, _, p) in promised.items()}
    stage = Round(plants.leaving(judge, mean_square), found, p_values)
    return [s.candidate.label for s in promising(judge, stage)]


def chosen(
    problem: Problem,
    gains: Mapping[str, float],
    doubtful: tuple[str, ...] = (),
    mean_square: float = 1.5,
) -> list[str]:
    """The same, all significant but some; a channel exceeds its noise if not said otherwise."""
    promised = {name: (gain, 9.0, float(name in doubtful)) for name, gain in gains.items()}
    return refitted(problem, promised, mean_square)


@pytest.mark.parametrize("mean_square", [1.0, 1.5])
def test_members_that_look_alike_do_not_crowd_out_their_group(
    casters: Problem, mean_square: float
) -> None:
    gains = {
        f"{effect} at {place}": 100.0 + len(effect)
        for effect in ("coulomb", "bristle", "stribeck", "viscous")
        for place in PLACES
    }
    found = chosen(casters, {**gains, GROUP: 80.0}, mean_square=mean_square)
    assert len(found) == REFITS + 1
    assert found[-1] == GROUP


def test_two_members_of_a_group_are_enough_for_one_effect(casters: Problem) -> None:
    gains = {f"coulomb at {place}": 100.0 for place in PLACES}
    others = ["delay at log.w", "delay at log.theta", "body_drag at base.body", GROUP]
    gains |= dict(zip(others, (99.0, 98.0, 97.0, 90.0), strict=True))
    assert chosen(casters, gains)[2:] == others


def test_a_group_of_which_members_are_refitted_needs_no_significance(casters: Problem) -> None:
    groups = (GROUP, GROUP.replace("coulomb", "stribeck"))
    gains = {f"coulomb at {place}": 100.0 for place in PLACES}
    gains |= dict.fromkeys(groups, 80.0)
    assert chosen(casters, gains, groups)[2:] == [GROUP]
    assert GROUP in chosen(casters, {**gains, GROUP: 30.0}, groups)
    assert GROUP not in chosen(casters, {**gains, GROUP: 10.0}, groups)


def test_a_group_that_gains_little_is_no_rival(casters: Problem) -> None:
    gains = {
        f"{effect} at {place}": gain
        for effect, gain in (("coulomb", 100.0), ("bristle", 90.0), ("stribeck", 80.0))
        for place in PLACES
    }
    gains[GROUP] = 15.0
    found = chosen(casters, gains)
    assert len(found) == REFITS
    assert GROUP not in found
    # where casters may turn over, its first order says nothing
    assert GROUP in chosen(plants.turning_over(casters), gains)


def test_without_significance_unused_runs_decide_where_something_is_evidently_missing(
    plain: Problem,
) -> None:
    def few(mean_square: float, z: float) -> int:
        return len(refitted(plain, {"coulomb at load.flange": (100.0, z, 0.8)}, mean_square))

    assert few(1.5, 2.5) == 1
    assert few(1.0, 2.5) == 0  # at the noise: nothing to look for
    assert few(1.5, 1.5) == 0


@pytest.mark.parametrize(
    "mean_square, gain, z, expected",
    [
        (1e3, 4.4e7, 4.0, ["viscous", "coulomb"]),
        (1.5, 4.4e7, 4.0, ["viscous"]),
        (1.5, 8e7, 4.0, ["coulomb", "viscous"]),  # more than any significant one
        (1.5, 8e7, 1.7, ["coulomb", "viscous"]),  # whatever its significance
        (1.0, 8e7, 4.0, ["viscous"]),
    ],
)
def test_where_something_is_missing_a_few_that_are_not_significant_are_refitted_too(
    plain: Problem, mean_square: float, gain: float, z: float, expected: list[str]
) -> None:
    promised = {
        "viscous": (6.8e7, 10.7, 1e-10), "coulomb": (gain, z, 0.019), "cogging": (4e7, 1.9, 1.0),
        "unbalance": (3e7, 4.0, 0.02),
    }  # fmt: skip
    places = {f"{effect} at load.flange": numbers for effect, numbers in promised.items()}
    found = refitted(plain, places, mean_square)
    assert [label.partition(" at ")[0] for label in found] == expected


@pytest.fixture(scope="module")
def search(plain: Problem) -> Iterator[tuple[Search, Fitted]]:
    """A calibrated disc that lacks nothing."""
    found = Search(simulator(plain), only=[])
    base = found.calibrated()
    found.note(base)
    yield found, base
    found.close()


LABELS = {
    f"{effect} at gearbox.{place}" for effect in ("coulomb", "asymmetric_coulomb", "load_friction")
    for place in ("flange_a", "flange_b")
}  # fmt: skip


@pytest.fixture(scope="module", params=[0.1, 0.01])
def geared(
    tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> Iterator[tuple[Search, Round, float]]:
    """Scored and quickly fitted laws of a gear with so much friction, all twins to first order."""
    problem = plants.gear(tmp_path_factory.mktemp("gear"), request.param)
    found = Search(simulator(problem), only=[c for c in candidates(problem) if c.label in LABELS])
    base = found.calibrated()
    found.note(base)
    stage = found.scored(base)
    (item,) = stage.signatures
    assert item.candidate.label == "coulomb at gearbox.flange_b"
    for each in (item, *item.twins):
        found.tried(base, stage, each, again=False)
    yield found, stage, request.param
    found.close()


@pytest.mark.parametrize(
    ("winner", "told", "another"),
    [
        # where so much is explained that the sixth digit tells them its other place, and always
        # another law that does the same by as many parameters
        ("coulomb at gearbox.flange_b", ["coulomb at gearbox.flange_a"],
         ["load_friction at gearbox.flange_b", "load_friction at gearbox.flange_a"]),
        # with one parameter more, its other place and simpler laws at its own
        ("asymmetric_coulomb at gearbox.flange_a",
         ["coulomb at gearbox.flange_a", "load_friction at gearbox.flange_a",
          "asymmetric_coulomb at gearbox.flange_b"], []),
    ],
)  # fmt: skip
def test_twins_of_the_winner_and_simpler_ones_at_its_place_are_fitted_too(
    geared: tuple[Search, Round, float], winner: str, told: list[str], another: list[str]
) -> None:
    search, stage, size = geared
    stage.winner = next(f for f in stage.fitted if f.labels == {winner})
    found = [s.candidate.label for s in kin(search, stage.base, stage)]
    assert [label for label in found if label != winner] == told * (size > 0.05) + another


@pytest.mark.parametrize("work", [None, 1000.0, 30000.0], ids=["nothing known", "none", "much"])
def test_quick_fits_have_a_limit_on_work(search: tuple[Search, Fitted], work: float | None) -> None:
    """A multiple of what a fit close by took; where that is next to none, an effect may bring the
    first solver.
    """
    judge, base = search
    near = base.simulator.limited({})
    near.costs = {run.name: work or 0.0 for run in judge.raw.runs}
    close = replace(base.estimate, simulator=near)
    found = judge.fitted(near, base.estimate.theta, close if work else None)
    times = judge.raw.runs[0].times
    least = SOLVED * (times[-1] - times[0]) / judge.raw.step
    limits = dict.fromkeys(near.costs, PATIENCE * max(work or 0.0, least))
    assert found.simulator.limits == pytest.approx(limits if work else {})
    assert 1000.0 < least < 30000.0


@pytest.mark.parametrize(
    "sizes, unstable, expected",
    [
        ({"slow": 6.0, "steps": 4.0, "sweep": 900.0}, True, ["steps"]),  # most, of what is near
        ({"slow": 6.0, "steps": 4.0, "sweep": 900.0}, False, ["sweep"]),  # no run is so by itself
        ({"slow": 1.0, "steps": 1.0, "sweep": 900.0}, True, ["sweep"]),  # others are at the noise
        ({"slow": 25.0, "steps": 4.0, "sweep": 1.0}, True, ["slow"]),
        ({"slow": 1.0, "steps": 1.0, "sweep": 1.0}, True, ["sweep", "steps", "slow"]),
    ],
)
def test_candidates_are_chosen_by_a_run_that_is_not_much_farther_off_than_others(
    plain: Problem, sizes: dict[str, float], unstable: bool, expected: list[str]
) -> None:
    """The steps last four times as long as the others."""
    size = plain.runs[0].times.size // 4
    problem = ended(plain, dict.fromkeys(("sweep", "slow"), size))
    problem = plants.turning_over(problem) if unstable else problem
    found = Search(simulator(problem), only=[])
    assert found.telling(plants.leaving(found, sizes)).names == expected
    found.close()


SWUNG = "unbalance at load.flange"


@pytest.fixture(scope="module")
def swung(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """A disc with a weight that begins at angles which are not known."""
    return plants.swinging(tmp_path_factory.mktemp("weight"), 0.02)


def started(search: Search) -> tuple[Fitted, Fitted]:
    """The declared model and one with the weight, fitted from wrong angles."""
    base = search.calibrated()
    stage = search.scored(base)
    search.tried(base, stage, stage.signatures[0], again=False)
    (fitted,) = stage.fitted
    assert search.lacking(fitted)
    return base, fitted


class Astray(Search):
    """Whose joint fits, and perhaps all others, end where a run has turned over."""

    joint = alone = False

    @staticmethod
    def lost(fitted: Fitted) -> Fitted:
        worse = replace(fitted.estimate, robust=fitted.estimate.robust + 1e4)
        return replace(fitted, estimate=worse)

    def _with_late(self, simulator: Simulator, theta: Vector) -> Fitted:
        found = super()._with_late(simulator, theta)
        return self.lost(found) if self.joint else found

    def fitted(
        self,
        simulator: Simulator,
        theta: Vector,
        close: Estimate | None = None,
        *,
        share: float = QUICKLY,
    ) -> Fitted:
        found = super().fitted(simulator, theta, close, share=share)
        return self.lost(found) if self.alone else found


@pytest.mark.parametrize(
    ("joint", "alone", "last"),
    [(False, False, "fitted with them"), (True, False, "with them and hardly another change"),
     (True, True, "")],
)  # fmt: skip
def test_start_values_stay_where_a_joint_fit_loses_them(
    swung: Problem, joint: bool, alone: bool, last: str
) -> None:
    """And what has been tried in vain is not tried again."""
    said: list[str] = []
    known = [c for c in candidates(swung) if c.label == SWUNG]
    search = Astray(simulator(swung), said.append, only=known)
    base, winner = started(search)
    search.joint, search.alone = joint, alone
    del said[:]
    found = search.released(winner, base)
    steps = ["start values of the runs estimated", *([last] if last else [])]
    assert [text.partition(":")[0] for text in said] == steps
    assert (found is winner) == (not last)
    if last:
        assert not search.lacking(found)
        begun = [each["start"] for each in late_values(found.problem).values()]
        psi = found.estimate.values["load.flange.unbalance.psi"]
        # by half a turn, as far as a negative weight goes
        away = np.sin(np.add(begun, psi) - plants.STARTS)
        assert away == pytest.approx(np.zeros(len(begun)), abs=0.1)
    count = len(said)
    assert search.released(found, base) is found
    assert len(said) == count
    search.close()


def test_start_values_that_cannot_be_estimated_leave_the_winner(swung: Problem) -> None:
    """They are those of a shaft that the model lacks."""
    said: list[str] = []
    known = [c for c in candidates(swung) if c.label == SWUNG]
    problem = plants.turning_over(swung, "load.gear.angle")
    search = Search(simulator(problem), said.append, only=known)
    base, winner = started(search)
    del said[:]
    assert search.released(winner, base) is winner
    (text,) = said
    assert text.startswith("start values of the runs could not be estimated: ")
    assert "has no variable 'gear.angle'" in text
    # without such values nothing is simulated for them
    search.taken(search.raw.changed(late=()))
    anew, spent = replace(winner, estimate=replace(winner.estimate)), search.simulator.budget.spent
    assert search.released(anew, base) is anew
    assert search.simulator.budget.spent == spent and len(said) == 1
    search.close()


RUB, DRAG = "coulomb at load.flange", "quadratic_drag at load.flange"


@pytest.fixture(scope="module")
def rubbing(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """A disc with dry friction, and no drag."""
    folder = tmp_path_factory.mktemp("friction")
    return read_problem(disc.write(folder, lambda w, theta, t: 0.08 * math.tanh(w / 0.02)))


def added(search: Search, *labels: str) -> Fitted:
    """The model with some effects, thoroughly fitted."""
    effects = [c for c in search.known if c.label in labels]
    problem = search.raw
    for effect in effects:
        problem = effect.added_to(problem)
    theta = problem.nominal
    theta[problem.index("load.flange.coulomb.tau_c")] = 0.05
    found = search.judged(fit(search.simulator.of(problem), theta, effort=CORRECTION))
    found.effects = tuple(effects)
    search.note(found)
    return found


@pytest.mark.parametrize("fails", [False, True])
def test_an_effect_without_which_nothing_runs_is_not_dropped(
    rubbing: Problem, monkeypatch: pytest.MonkeyPatch, fails: bool
) -> None:
    """Only the call of the FMU is a stand-in: none of the small ones fails without an effect."""
    said: list[str] = []
    known = [c for c in candidates(rubbing) if c.label in (RUB, DRAG)]
    search = Search(simulator(rubbing), said.append, only=known)
    search.note(search.calibrated())
    model = added(search, RUB, DRAG)
    simulate = Simulator.simulate

    def called(self: Simulator, theta: Vector, run: MeasuredRun | str) -> Vector:
        if self.problem.constants.get("load.flange.quadratic_drag.c") == 0.0:
            raise FmuCallError("it runs away")
        return simulate(self, theta, run)

    if fails:
        monkeypatch.setattr(Simulator, "simulate", called)
    del said[:]
    found = examined(search, model, 80)
    if fails:
        assert found is model
        assert search.memo.failed == {frozenset({RUB})}
        assert said == [f"without {DRAG}: it runs away"]
    else:  # else it would be
        assert found.labels == {RUB}
        assert not search.memo.failed
        assert said == [f"dropped again: {DRAG}"]
    search.close()


def test_a_model_that_cannot_be_fitted_thoroughly_stays_as_it_is(rubbing: Problem) -> None:
    said: list[str] = []
    known = [c for c in candidates(rubbing) if c.label == RUB]
    search = Search(simulator(rubbing), said.append, only=known)
    base = search.calibrated()
    model = added(search, RUB)
    theta = model.estimate.theta.copy()
    theta[model.problem.index("J")] = -0.02  # its FMU refuses that
    quick = replace(model, estimate=replace(model.estimate, theta=theta))
    assert search.sharpened(quick, base) is quick
    assert said[-1].startswith(f"{RUB} could not be fitted thoroughly: load.J: J = -0.02 kg.m2 is")
    sharp = search.sharpened(model, base)
    assert sharp is not model and sharp.labels == model.labels
    search.close()
