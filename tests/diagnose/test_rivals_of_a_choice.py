"""Which rivals of an early choice are tried in its place, and which are fitted as far as it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate.fit import INTERVALS, fit
from cosim.calibrate.mapping import read_problem
from cosim.calibrate.problem import Problem
from cosim.diagnose.candidates import candidates
from cosim.diagnose.linear import ScoreTest
from cosim.diagnose.models import Fitted, Gate
from cosim.diagnose.rivals import MOST, _alike, _others, restarted
from cosim.diagnose.rounds import Round
from cosim.diagnose.search import CLOSE, LOOSE, Search
from cosim.diagnose.signature import Signature
from tests.diagnose import disc, plants
from tests.problems import simulator

PLACE = "load.flange"
RUB, GENERAL, DRAG = (
    f"{e} at {PLACE}" for e in ("coulomb", "asymmetric_coulomb", "quadratic_drag")
)
LATE = [f"delay at log.{name}" for name in ("w", "theta", "load.tau", "load.outputs")]
SECONDS = 2.0


def friction(w: float, theta: float, t: float) -> float:
    return 0.08 * math.tanh(w / 0.005)


def uneven(w: float, theta: float, t: float) -> float:
    return friction(w, theta, t) * (1.3 if w > 0.0 else 0.7)


def drag(w: float, theta: float, t: float) -> float:
    return 0.02 * w * abs(w)


def nothing(w: float, theta: float, t: float) -> float:
    return 0.0


def written(folder: Path, law: disc.Law) -> Problem:
    """A short data set of a disc."""
    return read_problem(disc.write(folder / "disc", law, seconds=SECONDS))


class Noting(Search):
    """Notes how quick fits begin."""

    flags: tuple[bool, float] | None = None

    def refit(
        self, base: Fitted, item: Signature, *, again: bool = True, goal: float = 0.0
    ) -> Fitted | None:
        self.flags = again, goal
        return super().refit(base, item, again=again, goal=goal)


def of(problem: Problem, known: Sequence[str], said: list[str] | None = None) -> Noting:
    """A search over some laws, and what it says."""
    chosen = [c for c in candidates(problem) if c.label in known]
    return Noting(simulator(problem), ([] if said is None else said).append, only=chosen)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Search]:
    """Nothing of it is simulated."""
    problem = written(tmp_path_factory.mktemp("plain"), drag)
    search = Search(simulator(problem))
    yield search
    search.close()


def stage(search: Search, gains: dict[str, float]) -> Round:
    """A round whose first fit has won, of label -> gain."""
    known = {c.label: c for c in search.known}
    base = plants.leaving(search, 2.0)
    fits = [plants.fitted(search, base, known[label], gain) for label, gain in gains.items()]
    return Round(base, [], {}, fitted=fits, winner=fits[0], quick=max(gains.values()))


def labels(found: Sequence[tuple[Signature, Fitted | None]]) -> list[str]:
    return [item.candidate.label for item, _ in found]


def test_another_law_is_tried_before_the_same_one_at_a_fourth_place(plain: Search) -> None:
    gains = {label: 100.0 - place for place, label in enumerate(LATE)}
    found = labels(_others(plain, stage(plain, {**gains, DRAG: 90.0})))
    assert found == [DRAG, *LATE[1:MOST]]


@pytest.mark.parametrize(
    ("gain", "effect", "placed", "challenges"),
    [
        (96.0, "quadratic_drag", False, True),
        (90.0, "quadratic_drag", False, False),
        (96.0, "unbalance", False, False),  # it has two parameters
        # its place was tried along one axis: it has more to give
        (90.0, "stribeck", True, True),
        (70.0, "stribeck", True, False),
    ],
)
def test_another_law_elsewhere_is_fitted_as_far_if_it_is_close(
    plain: Search, gain: float, effect: str, placed: bool, challenges: bool
) -> None:
    other = f"{effect} at {PLACE}"
    current = stage(plain, {LATE[0]: 100.0, other: gain})
    item = current.fitted[1].signature
    assert item is not None
    if placed:
        tried = [replace(p, hints=replace(p.hints, tries=(0.1,))) for p in item.probe.others]
        probe = replace(item.probe, others=tuple(tried))
        current.fitted[1].signature = replace(item, probe=probe, fixed={tried[0].name: 0.1})
    found = labels(_alike(plain, current.base, current, set()))
    assert found == [other] * challenges


def test_unused_runs_may_want_it_once_it_has_been(plain: Search) -> None:
    """A torque against turning: 185 nats worse there as a draft, 128 better when it was fitted."""
    other = f"quadratic_drag at {PLACE}"
    current = stage(plain, {LATE[0]: 100.0, other: 96.0})
    current.fitted[1].gate = Gate(-50.0, -3.0)
    assert labels(_alike(plain, current.base, current, set())) == [other]


def test_another_law_at_the_same_place_is_not(plain: Search) -> None:
    current = stage(plain, {DRAG: 100.0, f"viscous at {PLACE}": 99.0})
    assert _alike(plain, current.base, current, set()) == []


SEARCH_STEP = 0.02


@pytest.mark.slow
@pytest.mark.parametrize("uncorrected", [True, False])
def test_a_fit_without_corrections_gets_them_before_its_other_parameters_are_tried(
    tmp_path: Path, uncorrected: bool
) -> None:
    """They would make up for errors of the communication step."""
    folder = disc.write(tmp_path, lambda w, theta, t: 0.1 * math.sin(theta + 0.5), seconds=SECONDS)
    mapping = folder / "dataset.toml"
    text = mapping.read_text("utf-8").replace("step =", f"search_step = {SEARCH_STEP}\nstep =", 1)
    mapping.write_text(text, "utf-8")
    problem = read_problem(folder).changed(far=True)  # whose fits get no corrections
    said: list[str] = []
    search = of(problem, [f"unbalance at {PLACE}"], said)
    base = search.calibrated()
    current = search.scored(base)
    search.tried(base, current, current.signatures[0], again=False)
    del said[:]
    search.finish(base, current, CLOSE, uncorrected=uncorrected)
    wanted = f"unbalance at {PLACE}: its other parameters are wanted, too"
    assert said == [wanted] * (not uncorrected)
    (found,) = current.fitted
    assert search.raw.search.step == found.problem.step == SEARCH_STEP
    search.close()


@pytest.fixture(scope="module")
def dragged(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """A disc with a large drag."""
    return written(tmp_path_factory.mktemp("drag"), drag)


@pytest.mark.parametrize(("second", "fits"), [(38.0, 1), (400.0, 2)])
def test_where_unused_runs_want_none_what_gains_little_beside_the_best_is_not_fitted(
    dragged: Problem, second: float, fits: int
) -> None:
    search = of(dragged, [RUB, GENERAL])
    base = search.calibrated()
    current = search.scored(base)
    for item in current.signatures:
        search.tried(base, current, item, again=False)
    for fitted, gain in zip(current.fitted, (1319.0, second), strict=True):
        assert not search.accepted(base, fitted)
        cost = base.estimate.robust + base.free - fitted.free - gain
        fitted.estimate = replace(fitted.estimate, robust=cost)
    quick = [f.estimate for f in current.fitted]
    search.finish(base, current, CLOSE)
    assert sum(all(f.estimate is not q for q in quick) for f in current.fitted) == fits
    search.close()


Bounded = tuple[Search, list[str], Fitted, dict[str, Fitted], bool]


@pytest.fixture(scope="module", params=[friction, uneven], ids=["even", "uneven"])
def bounded(
    tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> Iterator[Bounded]:
    """Quick fits of friction, even or not; without it, the declared friction is at its bound."""
    problem = written(tmp_path_factory.mktemp("friction"), request.param)
    low = [replace(p, maximum=0.035) if p.name == "b" else p for p in problem.parameters]
    said: list[str] = []
    search = of(problem.with_parameters(low), [RUB, GENERAL], said)
    base = search.calibrated()
    assert search.far(base)
    current = search.scored(base)
    for item in current.signatures:
        search.tried(base, current, item, again=False)
    fits = {f.effects[-1].label: f for f in current.fitted}
    yield search, said, base, fits, request.param is uneven
    search.close()


def begun(search: Search, base: Fitted, quick: Fitted) -> Fitted:
    """A model with far too much friction, which is still far off."""
    theta = quick.estimate.theta.copy()
    theta[quick.problem.index(f"{quick.effects[-1].prefix}tau_c")] = 0.4
    return search.again(
        search.judged(fit(quick.simulator, theta, effort=INTERVALS)), quick, base
    )  # fmt: skip


@pytest.mark.parametrize("simple", [None, "rough", "fitted"])
def test_a_general_law_begins_where_a_simpler_one_has_done_better(
    bounded: Bounded, simple: str | None
) -> None:
    search, said, base, quick, differs = bounded
    general = begun(search, base, quick[GENERAL])
    rub = search.sharpened(quick[RUB], base)
    if simple == "rough":  # worse than the general one
        worse = replace(rub.estimate, robust=general.estimate.robust + 1.0)
        rub = replace(rub, estimate=worse)
    del said[:]
    found = restarted(search, general, base, [] if simple is None else [rub])
    if simple != "fitted":
        assert said == [f"{GENERAL}: a better minimum from nominal values"]
    elif differs:
        assert said == [f"{GENERAL}: a better minimum from {RUB}"]
    else:  # its further parameter brings nothing
        assert said == []
    assert (found is general) == (not said)
    if said:
        assert found.estimate.robust < general.estimate.robust and found.labels == {GENERAL}


@pytest.mark.parametrize(
    ("unstable", "explained", "again"),
    [(False, False, True), (True, False, False), (False, True, False)],
)
def test_quick_fits_begin_elsewhere_too_unless_the_best_one_does_later_or_explains_all(
    dragged: Problem, unstable: bool, explained: bool, again: bool
) -> None:
    search = of(dragged, [RUB, DRAG])
    base = search.calibrated()
    current = search.scored(base)
    items = {s.candidate.label: s for s in current.signatures}
    goal = 0.0
    if explained:
        search.tried(base, current, items[DRAG], again=True)
        goal = LOOSE * search.gain(base, current.fitted[0])
        assert search.explained(base, current.fitted)
    if unstable:
        search.taken(plants.turning_over(search.raw))
    search.attempted(base, current, [items[RUB]])
    assert search.flags == (again, goal)
    search.close()


WEAK, SMALL = 4, 6
"""Places of a law that does not differ from 0, and of one that gains too little."""
WRONG = [
    LATE[2], GENERAL, f"asymmetric_viscous at {PLACE}", RUB,
    f"bearing_drag at {PLACE}", f"viscous at {PLACE}", "clock_skew at log.load.outputs", LATE[0],
    f"load_friction at {PLACE}", f"stribeck at {PLACE}",
]  # fmt: skip
"""Laws that unused runs of a disc with drag do not want."""


def ranked(item: Signature, place: int) -> Signature:
    """A law at a place among the others; only the first two are significant."""
    gain = 100.0 if place < 2 else 19.0 if place == SMALL else 45.0 - place
    score = ScoreTest(
        item.score.amplitude or 1.0, gain, 1.0 if place == WEAK else 3.5, 1.0, 1.0, 1.0
    )
    return replace(item, score=score, rest=np.ones_like(item.rest), absorbed=0.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "right", "attempts"),
    [(drag, 3, 2), (drag, None, 2), (drag, 1, 1), (nothing, None, 1)],
    ids=["found by the second", "found by none", "found by the first", "noise"],
)
def test_a_model_that_lacks_something_gets_the_next_candidates_if_unused_runs_want_none_so_far(
    tmp_path: Path, law: disc.Law, right: int | None, attempts: int
) -> None:
    order = [DRAG if place == right else label for place, label in enumerate(WRONG)]
    problem = written(tmp_path, law)
    said: list[str] = []
    search = of(problem, order, said)
    base = search.calibrated()
    search.note(base)
    bench = search.bench(base, search.fitting)
    items = {s.candidate.label: s for s in bench.followed(bench.begun(search.known))}
    first = [ranked(items[label], place) for place, label in enumerate(order)]
    current = Round(base, first, {label: float(place > 1) for place, label in enumerate(order)})
    del said[:]
    found = search._decided(base, base, current)
    tried = [text.partition(":")[0] for text in said if " nats on identification" in text]
    rest = [label for place, label in enumerate(order) if place not in (0, 1, WEAK, SMALL)]
    again = "unused runs want none of them; the next 6:"
    assert (again in said) == (attempts > 1)
    if law is drag:  # near the noise, some of them cannot be fitted at all
        assert tried == order[:2] + rest * (attempts > 1)
    named = found.winner.labels if found.winner is not None else None
    assert named == ({DRAG} if right is not None and right < 2 * attempts else None)
    search.close()
