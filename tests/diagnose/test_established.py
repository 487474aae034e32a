"""A law is named if the data determine it, a further effect if the model needs it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim.calibrate.parts import Parameter
from cosim.diagnose import established
from cosim.diagnose.models import Gate
from cosim.diagnose.rounds import Round
from cosim.errors import CosimError

TOTALS = {"bristle": 1e5, "coulomb": 1e5 - 300.0, "cogging": 5e4}


def law(effect: str, own: int, *, known: bool = False, held: int = 0) -> Any:
    """A fitted law at one place; what it has beyond its strength may be determined, or held."""
    prefix = f"axle.{effect}."
    names = ["tau_c", "x_0", "r"][:own]
    parameters = [
        Parameter(prefix + n, "1", 1.0, 0.0, 9.0, (), strength=n == "tau_c") for n in names
    ]
    low = np.array([0.9, *([0.5 if known else 0.0] * (own - 1))])
    return SimpleNamespace(
        effects=(SimpleNamespace(effect=effect, place="axle", prefix=prefix, label=effect),),
        problem=SimpleNamespace(parameters=parameters),
        estimate=SimpleNamespace(low=low, high=low + 1.0, identifiable=np.ones(own, dtype=bool)),
        signature=SimpleNamespace(
            strength=parameters[0], probe=SimpleNamespace(own=own + held)
        ),
        quantity="tau_c", complexity=own,
    )  # fmt: skip


def judge(**more: Any) -> Any:
    """What a search is asked for."""
    return SimpleNamespace(
        total=lambda base, fitted: TOTALS[fitted.effects[-1].effect],
        accepted=lambda base, fitted: True, sharpened=lambda fitted, base: fitted,
        say=lambda text: None, raw=SimpleNamespace(unstable=True), **more,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("others", "known", "named"),
    [
        (("coulomb", "cogging"), False, "coulomb"),
        (("coulomb", "cogging"), True, "bristle"),  # it is seen to give way
        (("cogging",), False, "bristle"),  # the simpler law does much worse
    ],
)
def test_a_law_of_which_only_a_simpler_one_shows_is_that(
    others: tuple[str, ...], known: bool, named: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And its places are compared: other ones were fitted with the other law."""
    compared: list[str] = []
    monkeypatch.setattr(
        established, "challenged",
        lambda search, base, stage: compared.append(stage.winner.effects[-1].effect),
    )  # fmt: skip
    winner = law("bristle", 3, known=known)
    fits = [winner, *(law(n, 1) for n in others)]
    stage = Round(winner, [], {}, fitted=fits, winner=winner)
    established.settle(judge(), SimpleNamespace(effects=()), stage)  # type: ignore[arg-type]
    assert stage.winner is not None and stage.winner.effects[-1].effect == named
    assert compared == [named] * (named == "coulomb")


def test_a_law_with_more_parameters_that_were_held_is_no_simpler_one() -> None:
    """Coulomb's law with its smoothing free is not a bristle whose deflection was not fitted."""
    winner = law("coulomb", 2)
    stage: Any = SimpleNamespace(winner=winner, fitted=[winner, law("bristle", 1, held=2)])
    established.settle(judge(), SimpleNamespace(effects=()), stage)  # type: ignore[arg-type]
    assert stage.winner is winner


def without(gain: float, left: float, unused: float, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A round after a further effect, of which the model without it has been fitted again.

    Args:
        gain: by which it is better [nats].
        left: what the model without it leaves beyond noise [nats].
        unused: gain on unused runs [nats].
        monkeypatch: of pytest.
    """
    winner, base = (
        law("coulomb", 1),
        SimpleNamespace(effects=("first",), signature=1, gate=2, p_value=3),
    )
    estimate = SimpleNamespace(robust=500.0 + left, count=1000)
    less = SimpleNamespace(check=0, estimate=estimate)
    winner.check = 1
    monkeypatch.setattr(established, "compare", lambda *_: Gate(unused, 9.0 if unused > 0 else 0.0))
    search = judge(
        without=lambda fitted, effect: less, approached=lambda trial, goal, base: trial,
        gain=lambda first, second: gain if first is less else 5000.0, check_data=0, checking=0,
    )  # fmt: skip
    stage: Any = SimpleNamespace(winner=winner, fitted=[winner], base=base)
    established.needed(search, base, stage)  # type: ignore[arg-type]
    return stage, winner, base, less


def test_a_further_effect_that_the_model_needs_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    stage, winner, base, _ = without(900.0, 1000.0, 50.0, monkeypatch)
    assert stage.winner is winner and stage.base is base


@pytest.mark.parametrize(("gain", "left", "unused"), [(150.0, 1000.0, 50.0), (900.0, 1000.0, -1.0)])
def test_one_that_came_with_better_start_values_does_not(
    monkeypatch: pytest.MonkeyPatch, gain: float, left: float, unused: float
) -> None:
    """It leaves the model without it, which is better than the one that the round began with."""
    stage, _, base, less = without(gain, left, unused, monkeypatch)
    assert stage.winner is None and stage.base is less
    assert (less.effects, less.signature, less.gate, less.p_value) == (base.effects, 1, 2, 3)


def test_one_without_which_nothing_can_be_simulated_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: Any) -> None:
        raise CosimError("it runs away")

    winner = law("coulomb", 1)
    stage: Any = SimpleNamespace(winner=winner, fitted=[winner])
    search = judge(without=fails, approached=None)
    established.needed(search, SimpleNamespace(effects=("first",)), stage)  # type: ignore[arg-type]
    assert stage.winner is winner


@pytest.mark.parametrize(("effects", "unstable"), [((), True), (("first",), False)])
def test_first_effects_and_calm_systems_are_not_asked(
    effects: tuple[str, ...], unstable: bool
) -> None:
    stage: Any = SimpleNamespace(winner=law("coulomb", 1))
    search = SimpleNamespace(raw=SimpleNamespace(unstable=unstable))  # fits nothing
    established.needed(search, SimpleNamespace(effects=effects), stage)  # type: ignore[arg-type]
    assert stage.winner is not None


@pytest.mark.parametrize(
    ("held", "gain", "instead"),
    [((), 900.0, False), (("x", "y"), 900.0, True), (("x", "y"), 0.1, False)],
    ids=["nothing is held", "it does the work", "it does not"],
)
def test_a_law_beside_another_gives_way_to_all_parameters_of_that_one(
    monkeypatch: pytest.MonkeyPatch, held: tuple[str, ...], gain: float, instead: bool
) -> None:
    """A payload in the middle and a shift of the load are a payload that stands aside."""
    mass = Parameter("payload.m", "kg", 0.0, 0.0, 99.0, (), strength=True, span=5.0)
    places = [Parameter(f"payload.{n}", "m", 0.0, -1.0, 1.0, ()) for n in held]

    def problem(parameters: list[Parameter]) -> Any:
        return SimpleNamespace(
            parameters=parameters, names=[p.name for p in parameters], constants={},
            with_parameters=problem,
        )  # fmt: skip

    payload: Any = SimpleNamespace(label="payload", added_to=lambda _: problem([mass, *places]))
    monkeypatch.setattr(
        established, "composed", lambda raw, fitted, effects: problem([mass] if effects else [])
    )
    monkeypatch.setattr(established, "at_usual", lambda search, found, usual: found)
    begun: list[list[float]] = []

    def fitted(whole: Any, theta: Any, close: Any) -> Any:
        begun.append(theta.tolist())
        return SimpleNamespace(
            estimate=SimpleNamespace(values=dict.fromkeys(whole.names, 1.0)), gain=gain
        )

    noted: list[Any] = []
    search: Any = SimpleNamespace(
        raw=None, simulator=SimpleNamespace(of=lambda p: p), fitted=fitted, note=noted.append,
        approached=lambda found, goal, base: found, gain=lambda less, found: found.gain,
        say=lambda text: None,
    )  # fmt: skip
    less: Any = SimpleNamespace(effects=(payload,), signature=3)
    both: Any = SimpleNamespace(estimate=SimpleNamespace(values={"payload.m": 25.0}))
    found: Any = established.freed(search, less, both)
    assert begun == ([[25.0, 0.0, 0.0]] if held else [])  # from where both laws ended
    assert (found is less) is not instead
    assert noted == ([found] if instead else [])
    if instead:
        assert (found.effects, found.signature) == ((payload,), 3)


def test_a_law_that_stands_on_another_is_not_asked_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stiffening spring acts on a gear that yields; a rigid one has no spring."""

    def refused(*_: Any) -> None:
        raise CosimError("effect 'cubic_stiffness@spring' fits no balance")

    monkeypatch.setattr(established, "composed", refused)
    said: list[str] = []
    search: Any = SimpleNamespace(raw=None, say=said.append)
    spring: Any = SimpleNamespace(effects=("cubic_stiffness",), labels={"cubic_stiffness at gear"})
    assert established.freed(search, spring, spring) is spring
    assert said == [
        "cubic_stiffness at gear alone: effect 'cubic_stiffness@spring' fits no balance"
    ]
