"""Which rivals of an early choice are tried in its place, and which are fitted as far as it."""

from __future__ import annotations

from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any, NamedTuple, cast

import pytest

from cosim.calibrate.problem import Problem
from cosim.diagnose.models import GATE, Gate
from cosim.diagnose.rivals import MOST, _alike, _others, restarted
from cosim.diagnose.rounds import Round
from cosim.diagnose.search import CLOSE, LOOSE, Search
from cosim.diagnose.shortlist import kin
from tests.problems import simulator


class Law(NamedTuple):
    effect: str
    place: str


def fit(
    effect: str, place: str, gain: float, own: int = 1, twins: tuple[Any, ...] = (),
    *, placed: bool = False,
) -> Any:  # fmt: skip
    """A fit with what it gains, how many parameters its law has, and what is one with it."""
    law = Law(effect, place)
    signature = SimpleNamespace(
        candidate=law, probe=SimpleNamespace(own=own), same=(), tuned=0, twins=twins, placed=placed
    )
    return SimpleNamespace(effects=(law,), signature=signature, complexity=9, gain=gain)


SEARCH: Any = SimpleNamespace(total=lambda base, f: f.gain, accepted=lambda base, f: True)


def stage(fits: Iterable[Any]) -> Any:
    """A round whose first fit has won."""
    fitted = list(fits)
    return SimpleNamespace(
        fitted=fitted, winner=fitted[0], base=None, near=frozenset(), quick=fitted[0].gain,
        simpler=list,
    )  # fmt: skip


def places(found: list[Any]) -> list[Law]:
    return [item.candidate for item, _ in found]


def test_another_law_is_tried_before_the_same_one_at_a_fourth_place() -> None:
    gains = [fit("gain", f"sensor {k}", 100.0 - k) for k in range(5)]
    radius = fit("radius_offset", "wheel", 90.0)
    found = places(_others(SEARCH, stage([*gains, radius])))
    assert found[0] == radius.effects[-1]
    assert found[1:] == [g.effects[-1] for g in gains[1:MOST]]


@pytest.mark.parametrize(
    ("gain", "own", "placed", "challenges"),
    [
        (96.0, 1, False, True), (90.0, 1, False, False), (96.0, 2, False, False),
        # its place was tried along one axis: it has more to give
        (90.0, 4, True, True), (70.0, 4, True, False),
    ],
)  # fmt: skip
def test_another_law_elsewhere_is_fitted_as_far_if_it_is_close(
    gain: float, own: int, placed: bool, challenges: bool
) -> None:
    winner = fit("gain", "sensor", 100.0)
    other = fit("radius_offset", "wheel", gain, own, placed=placed)
    found = places(_alike(SEARCH, None, stage([winner, other]), set()))  # type: ignore[arg-type]
    assert (other.effects[-1] in found) is challenges


def test_another_law_at_the_same_place_is_not() -> None:
    winner, other = fit("coulomb", "wheel", 100.0), fit("stribeck", "wheel", 99.0)
    assert _alike(SEARCH, None, stage([winner, other]), set()) == []  # type: ignore[arg-type]


def test_another_law_that_is_one_with_the_winner_is_fitted_whatever_the_winner_gains() -> None:
    """The same law elsewhere only where so much is explained that the sixth digit tells it."""
    offset = fit("current_offset", "sensor", 0.0).signature
    elsewhere = fit("command_dead_zone", "joint", 0.0).signature
    for gain, compared in ((1e3, [offset]), (1e8, [elsewhere, offset])):
        winner = fit("command_dead_zone", "sensor", gain, twins=(offset, elsewhere))
        assert kin(SEARCH, None, stage([winner])) == compared  # type: ignore[arg-type]
    offset.tuned = 1  # with a parameter more that the data chose
    assert kin(SEARCH, None, stage([winner])) == [elsewhere]  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("uncorrected", [True, False])
def test_a_fit_without_corrections_gets_them_before_its_other_parameters_are_tried(
    clean_bench: Problem, monkeypatch: pytest.MonkeyPatch, uncorrected: bool
) -> None:
    """They would make up for errors of the communication step."""
    search = Search(simulator(clean_bench), only=[])
    base = search.calibrated()
    search.close()
    base.gate = Gate(100.0, 10.0)
    calls: list[str] = []

    def sharpened(quick: Any, *_: Any, **__: Any) -> Any:
        calls.append("corrected")
        return quick

    def refined(_: Any, fitted: Any, **__: Any) -> Any:
        calls.append("refined")
        return fitted

    monkeypatch.setattr(search, "accepted", lambda *_: True)
    monkeypatch.setattr(search, "total", lambda *_: 1.0)
    monkeypatch.setattr(search, "sharpened", sharpened)
    monkeypatch.setattr(search, "refined", refined)
    current = Round(base, [], {}, fitted=[base])
    search.finish(base, current, CLOSE, uncorrected=uncorrected)
    assert calls == ["corrected"] * uncorrected + ["refined"]


@pytest.mark.parametrize(("second", "fits"), [(38.0, 1), (400.0, 2)])
def test_where_unused_runs_want_none_what_gains_little_beside_the_best_is_not_fitted(
    second: float, fits: int
) -> None:
    gains = [fit("pivot_torque", "floor", 1319.0), fit("stribeck", "swivel", second)]
    thorough = []

    def sharpened(fitted: Any, base: Any, *, draft: bool) -> Any:
        thorough.append(fitted.gain)
        return fitted

    search: Any = SimpleNamespace(
        total=lambda base, f: f.gain,
        gain=lambda base, f: f.gain,
        accepted=lambda base, f: False,
        lacking=lambda base: True,
        sharpened=sharpened,
        refined=lambda base, f: f,
    )
    current: Any = SimpleNamespace(fitted=gains)
    Search.finish(search, cast(Any, None), current, CLOSE)
    assert len(thorough) == fits


def rough(effect: str, robust: float) -> Any:
    """A quick fit that is still far off."""
    law = SimpleNamespace(label=effect)
    problem = SimpleNamespace(runs=(), changed=lambda runs: None)
    return SimpleNamespace(
        effects=(law,), signature=law, problem=problem, p_value=0.0, check=None,
        estimate=SimpleNamespace(robust=robust),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("simple", "reached", "anew", "better"),
    [
        (None, 0.0, True, True),  # nothing to begin from
        (1000.0, 0.0, True, True),  # worse than the quick fit
        (500.0, 400.0, False, True),
        (500.0, 500.0 - 0.5 * GATE, False, False),  # its further parameters bring nothing
    ],
)
def test_a_general_law_begins_where_a_simpler_one_has_done_better(
    monkeypatch: pytest.MonkeyPatch,
    simple: float | None,
    reached: float,
    anew: bool,
    better: bool,
) -> None:
    general = rough("asymmetric_coulomb", 800.0)
    begun: list[Any] = []

    def retried(fitted: Any, base: Any) -> Any:
        begun.append(fitted)
        return rough("asymmetric_coulomb", 300.0)

    search = SimpleNamespace(
        retried=retried, sharper=lambda fitted, base: fitted, say=lambda text: None,
        check_data=None, checking=None,
    )  # fmt: skip
    monkeypatch.setattr("cosim.diagnose.rivals.exchanged", lambda *_: rough("a", reached))
    monkeypatch.setattr("cosim.diagnose.rivals.compare", lambda *_: None)
    known = [] if simple is None else [rough("coulomb", simple)]
    found = restarted(cast(Any, search), general, rough("", 9e9), known)
    assert bool(begun) is anew
    assert (found is not general) is better


class Seen(Exception):
    """What follows the quick fits is of no interest."""


@pytest.mark.parametrize(
    ("unstable", "explained", "again", "goal"),
    [(False, False, True, 0.0), (True, False, False, 0.0), (False, True, False, LOOSE * 9.0)],
)
def test_quick_fits_begin_elsewhere_too_unless_the_best_one_does_later_or_explains_all(
    unstable: bool, explained: bool, again: bool, goal: float
) -> None:
    def tried(start: Any, current: Any, item: Any, again: bool, goal: float) -> None:
        raise Seen(again, goal)

    item: Any = SimpleNamespace(
        candidate=SimpleNamespace(change=()), score=SimpleNamespace(gain=9.0)
    )
    search: Any = SimpleNamespace(
        raw=SimpleNamespace(unstable=unstable), tried=tried, explained=lambda base, fits: explained,
        _build=lambda problem, changes: None, gain=lambda base, f: f.gain,
    )  # fmt: skip
    current = stage([fit("coulomb", "wheel", 9.0)])
    with pytest.raises(Seen) as seen:
        Search.attempted(search, cast(Any, SimpleNamespace(problem=None)), current, [item])
    assert seen.value.args == (again, goal)


LABELS = [f"law {index}" for index in range(10)]


@pytest.mark.parametrize(
    ("mean_square", "right", "attempts"),
    [
        (100.0, "law 3", [LABELS[:2], [*LABELS[2:4], *LABELS[5:6], *LABELS[7:]]]),
        (100.0, "none", [LABELS[:2], [*LABELS[2:4], *LABELS[5:6], *LABELS[7:]]]),
        (100.0, "law 1", [LABELS[:2]]),
        (3.0, "law 3", [LABELS[:2]]),
    ],
    ids=["found by the second", "found by none", "found by the first", "near the noise"],
)
def test_a_model_that_is_far_off_gets_the_next_candidates_if_unused_runs_want_none_of_the_first(
    mean_square: float, right: str, attempts: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    signatures = [
        SimpleNamespace(
            candidate=SimpleNamespace(label=label), unseen=False, asked=1.0,
            score=SimpleNamespace(
                z=1.0 if label == LABELS[4] else 3.5, gain=19.0 if label == LABELS[6] else 100.0
            ),
        )
        for label in LABELS
    ]  # fmt: skip
    base = SimpleNamespace(estimate=SimpleNamespace(robust=0.5 * mean_square * 100, count=100))
    made: list[list[str]] = []

    def attempted(start: Any, current: Any, items: list[Any]) -> Any:
        made.append([item.candidate.label for item in items])
        current.winner = object() if right in made[-1] else None
        return base

    current = SimpleNamespace(signatures=signatures, winner=None, open=True)
    search: Any = SimpleNamespace(
        attempted=attempted, say=lambda text: None,
        fitting=SimpleNamespace(largest=float),
    )  # fmt: skip
    monkeypatch.setattr("cosim.diagnose.search.promising", lambda *_: signatures[:2])
    found = Search._decided(search, cast(Any, base), cast(Any, base), cast(Any, current))
    assert made == attempts
    assert (found.winner is not None) is any(right in labels for labels in attempts)
