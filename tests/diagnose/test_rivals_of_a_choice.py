"""Which rivals of an early choice are tried in its place, and which are fitted as far as it."""

from __future__ import annotations

from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any, NamedTuple, cast

import pytest

from cosim.calibrate.problem import Problem
from cosim.diagnose.exchange import MOST, _alike, _others
from cosim.diagnose.models import Gate
from cosim.diagnose.search import CLOSE, Round, Search


class Law(NamedTuple):
    effect: str
    place: str


def fit(effect: str, place: str, gain: float, own: int = 1) -> Any:
    """A fit with what it gains, and how many parameters its law has."""
    law = Law(effect, place)
    signature = SimpleNamespace(candidate=law, probe=SimpleNamespace(own=own), same=())
    return SimpleNamespace(effects=(law,), signature=signature, complexity=9, gain=gain)


SEARCH: Any = SimpleNamespace(
    total=lambda base, f: f.gain,
    accepted=lambda base, f: True,
    kin=lambda base, stage: [],
    simpler=lambda stage: [],
)


def stage(fits: Iterable[Any]) -> Any:
    """A round whose first fit has won."""
    fitted = list(fits)
    return SimpleNamespace(
        fitted=fitted, winner=fitted[0], base=None, near=frozenset(), quick=fitted[0].gain
    )


def places(found: list[Any]) -> list[Law]:
    return [item.candidate for item, _ in found]


def test_another_law_is_tried_before_the_same_one_at_a_fourth_place() -> None:
    gains = [fit("gain", f"sensor {k}", 100.0 - k) for k in range(5)]
    radius = fit("radius_offset", "wheel", 90.0)
    found = places(_others(SEARCH, stage([*gains, radius])))
    assert found[0] == radius.effects[-1]
    assert found[1:] == [g.effects[-1] for g in gains[1:MOST]]


@pytest.mark.parametrize(
    ("gain", "own", "challenges"), [(96.0, 1, True), (90.0, 1, False), (96.0, 2, False)]
)
def test_another_law_elsewhere_is_fitted_as_far_if_it_is_close(
    gain: float, own: int, challenges: bool
) -> None:
    winner, other = fit("gain", "sensor", 100.0), fit("radius_offset", "wheel", gain, own)
    found = places(_alike(SEARCH, None, stage([winner, other]), set()))  # type: ignore[arg-type]
    assert (other.effects[-1] in found) is challenges


def test_another_law_at_the_same_place_is_not() -> None:
    winner, other = fit("coulomb", "wheel", 100.0), fit("stribeck", "wheel", 99.0)
    assert _alike(SEARCH, None, stage([winner, other]), set()) == []  # type: ignore[arg-type]


@pytest.mark.parametrize("uncorrected", [True, False])
def test_a_fit_without_corrections_gets_them_before_its_other_parameters_are_tried(
    clean_bench: Problem, monkeypatch: pytest.MonkeyPatch, uncorrected: bool
) -> None:
    """They would make up for errors of the communication step."""
    search = Search(clean_bench, only=[])
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
