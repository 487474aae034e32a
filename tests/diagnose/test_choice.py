"""Which scored candidates are refitted."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim.calibrate.simulator import Simulator
from cosim.diagnose.established import examined
from cosim.diagnose.linear import SampleStack
from cosim.diagnose.search import Search
from cosim.diagnose.secant import PATIENCE, SOLVED
from cosim.diagnose.shortlist import REFITS, kin, promising
from cosim.errors import CosimError

MEMBERS = {("base", f"caster_{place}.swivel") for place in ("fl", "fr", "rl", "rr")}


def near(mean_square: float = 1.0) -> Any:
    """A model with this mean square over the noise's."""
    return SimpleNamespace(
        problem=0,
        estimate=SimpleNamespace(
            cost=0.5 * mean_square * 1e4, robust=0.5 * mean_square * 1e4, count=10000
        ),
    )


def chosen(
    gains: dict[str, float], monkeypatch: pytest.MonkeyPatch, doubtful: tuple[str, ...] = (),
    *, unstable: bool = False,
) -> list[str]:  # fmt: skip
    """Labels that are refitted, of `effect at instance.port` -> gain, all significant but some."""
    monkeypatch.setattr("cosim.diagnose.shortlist.balances", lambda problem: MEMBERS)
    signatures = []
    for label, gain in sorted(gains.items(), key=lambda item: -item[1]):
        instance, port = label.partition(" at ")[2].split(".", 1)
        effect = label.partition(" at ")[0]
        candidate = SimpleNamespace(label=label, effect=effect, instance=instance, port=port)
        score = SimpleNamespace(gain=gain, z=9.0)
        signatures.append(
            SimpleNamespace(candidate=candidate, score=score, unseen=False, asked=None)
        )
    round_: Any = SimpleNamespace(
        signatures=signatures,
        corrected={label: float(label in doubtful) for label in gains},
        base=near(),
    )
    search: Any = SimpleNamespace(
        fitting=SimpleNamespace(largest=lambda change: 1.0), lacking=lambda base: True,
        raw=SimpleNamespace(unstable=unstable),
    )  # fmt: skip
    return [s.candidate.label for s in promising(search, round_)]


def test_members_that_look_alike_do_not_crowd_out_their_group(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    gains = {
        f"{effect} at {instance}.{port}": 100.0 + len(port) + len(effect)
        for effect in ("coulomb", "bristle", "stribeck", "viscous")
        for instance, port in MEMBERS
    }
    found = chosen({**gains, "coulomb at base.caster.swivel": 80.0}, monkeypatch)
    assert len(found) == REFITS + 1
    assert found[-1] == "coulomb at base.caster.swivel"


def test_two_members_of_a_group_are_enough_for_one_effect(monkeypatch: pytest.MonkeyPatch) -> None:
    gains = {f"coulomb at {i}.{port}": 100.0 + len(port) for i, port in MEMBERS}
    gains |= {"coulomb at arm.joint_1": 99.0, "coulomb at arm.joint_2": 98.0}
    gains |= {"coulomb at arm.joint_3": 97.0, "coulomb at base.caster.swivel": 90.0}
    assert [label.partition(" at ")[2] for label in chosen(gains, monkeypatch)][2:] == [
        "arm.joint_1", "arm.joint_2", "arm.joint_3", "base.caster.swivel"
    ]  # fmt: skip


def test_a_group_of_which_members_are_refitted_needs_no_significance(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    groups = tuple(f"{effect} at base.caster.swivel" for effect in ("coulomb", "stribeck"))
    gains = {f"coulomb at {i}.{port}": 100.0 for i, port in MEMBERS}
    gains |= dict.fromkeys(groups, 80.0)
    assert chosen(gains, monkeypatch, groups)[2:] == [groups[0]]
    assert groups[0] in chosen({**gains, groups[0]: 30.0}, monkeypatch, groups)
    assert groups[0] not in chosen({**gains, groups[0]: 10.0}, monkeypatch, groups)


def test_a_group_that_gains_little_is_no_rival(monkeypatch: pytest.MonkeyPatch) -> None:
    gains = {f"coulomb at {i}.{port}": 100.0 for i, port in MEMBERS}
    gains |= {f"bristle at {i}.{port}": 90.0 for i, port in MEMBERS}
    gains |= {f"stribeck at {i}.{port}": 80.0 for i, port in MEMBERS}
    gains["coulomb at base.caster.swivel"] = 15.0
    found = chosen(gains, monkeypatch)
    assert len(found) == REFITS
    assert "coulomb at base.caster.swivel" not in found
    # where casters may turn over, its first order says nothing
    assert "coulomb at base.caster.swivel" in chosen(gains, monkeypatch, unstable=True)


def test_twins_of_the_winner_and_simpler_ones_at_its_place_are_fitted_too() -> None:
    def signature(effect: str, place: str, tuned: int, *twins: Any) -> Any:
        candidate = SimpleNamespace(effect=effect, place=place)
        return SimpleNamespace(candidate=candidate, tuned=tuned, twins=twins)

    def model(item: Any) -> Any:
        return SimpleNamespace(effects=(item.candidate,), signature=item)

    simpler = signature("coulomb", "load.flange", 0)
    general = signature("asymmetric_coulomb", "load.flange", 1)
    same = signature("asymmetric_coulomb", "gearbox.flange_b", 1)
    law = signature("hose", "load.flange", 1)
    others = [signature("stribeck", "gearbox.flange_b", 0), law]
    winner = model(signature("asymmetric_coulomb", "load.flange", 1, same, *others))
    elsewhere = model(signature("coulomb", "gearbox.flange_a", 0, simpler, general))
    found: Any = SimpleNamespace(winner=winner, fitted=[winner, elsewhere])
    search: Any = SimpleNamespace(total=lambda *_: 1e6)  # nats, of which the data see 1e-5
    assert kin(search, winner, found) == [same, simpler, general, law]
    search.total = lambda *_: 1e5  # of these they do not, but another law is another answer
    assert kin(search, winner, found) == [law]
    search.total, found.winner = lambda *_: 1e6, elsewhere
    assert kin(search, winner, found) == [simpler]


def test_start_values_that_cannot_be_estimated_leave_the_winner(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(*_: Any) -> None:
        raise CosimError("unstable")

    simulator: Any = SimpleNamespace(costs={}, limited=lambda limits: simulator)
    monkeypatch.setattr("cosim.diagnose.late_values.corrected", lambda *_: simulator)
    monkeypatch.setattr("cosim.diagnose.late_values.released", fail)
    estimate = SimpleNamespace(theta=None, robust=9.0, count=2)
    problem = SimpleNamespace(runs=(), late=())
    winner: Any = SimpleNamespace(problem=problem, simulator=simulator, estimate=estimate)
    said: list[str] = []
    search: Any = SimpleNamespace(
        raw=SimpleNamespace(late=(1,)), lacking=lambda _: True, say=said.append, _settled=None
    )
    assert Search.released(search, winner, winner) is winner
    assert said == ["start values of the runs could not be estimated: unstable"]
    search.raw.late = ()
    assert Search.released(search, winner, winner) is winner and len(said) == 1


@pytest.mark.parametrize(("alone", "kept"), [(3.0, True), (12.0, False)])
def test_start_values_stay_where_a_joint_fit_loses_them(
    alone: float, kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And what has been tried in vain is not tried again."""

    def model(cost: float) -> Any:
        estimate = SimpleNamespace(theta=None, robust=cost, count=2)
        return SimpleNamespace(problem=None, simulator=simulator, estimate=estimate)

    simulator: Any = SimpleNamespace(limited=lambda limits: simulator)
    monkeypatch.setattr("cosim.diagnose.late_values.corrected", lambda *_: simulator)
    monkeypatch.setattr("cosim.diagnose.late_values.released", lambda *_: (simulator, None, 5.0))
    monkeypatch.setattr("cosim.diagnose.late_values.late_estimated", lambda _: True)
    monkeypatch.setattr("cosim.diagnose.late_values.patience", lambda _: {})
    said: list[str] = []
    search: Any = SimpleNamespace(
        raw=SimpleNamespace(late=(1,)), lacking=lambda f: f.estimate.robust > 4.0, say=said.append,
        gain=lambda first, second: first.estimate.robust - second.estimate.robust, _settled=None,
        _with_late=lambda *_: model(11.0), fitted=lambda *_: model(alone),
        again=lambda found, *_: found,
    )  # fmt: skip
    winner = model(9.0)
    found = Search.released(search, winner, winner)
    assert (found is not winner) == kept
    assert said == ["start values of the runs estimated: 5 nats"] + kept * [
        "with them and hardly another change: 6 nats"
    ]
    assert Search.released(search, found, winner) is found
    assert len(said) == 1 + kept


def test_without_significance_unused_runs_decide_where_something_is_evidently_missing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("cosim.diagnose.shortlist.balances", lambda problem: set())

    def refitted(lacking: bool, z: float) -> int:
        candidate = SimpleNamespace(label="a", effect="a", instance="motor", port="winding")
        item = SimpleNamespace(
            candidate=candidate, score=SimpleNamespace(gain=100.0, z=z), unseen=False, asked=None
        )
        search: Any = SimpleNamespace(
            fitting=SimpleNamespace(largest=lambda change: 1.0), lacking=lambda base: lacking,
            raw=SimpleNamespace(unstable=False),
        )  # fmt: skip
        found: Any = SimpleNamespace(signatures=[item], corrected={"a": 0.8}, base=near())
        return len(promising(search, found))

    assert refitted(True, 2.5) == 1
    assert refitted(False, 2.5) == 0  # at the noise: nothing to look for
    assert refitted(True, 1.5) == 0


def test_an_effect_without_which_nothing_runs_is_not_dropped() -> None:
    needed, last = SimpleNamespace(label="delay at motor.command"), SimpleNamespace(label="b")

    def without(*_: Any) -> None:
        raise CosimError("unstable")

    said: list[str] = []
    memo = SimpleNamespace(failed=set())
    search: Any = SimpleNamespace(without=without, say=said.append, memo=memo)
    model: Any = SimpleNamespace(
        effects=(needed, last), labels=frozenset((needed.label, last.label))
    )
    assert examined(search, model, 80) is model
    assert memo.failed == {frozenset({needed.label}), frozenset({last.label})}
    assert said == ["without delay at motor.command: unstable", "without b: unstable"]


def test_a_model_that_cannot_be_fitted_thoroughly_stays_as_it_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(*_: Any) -> None:
        raise CosimError("unstable")

    monkeypatch.setattr("cosim.diagnose.fitter.corrected", fail)
    said: list[str] = []
    effect = SimpleNamespace(label="delay at motor.command")
    quick: Any = SimpleNamespace(
        effects=(effect,), simulator=None, estimate=SimpleNamespace(theta=None)
    )
    search: Any = SimpleNamespace(raw=None, say=said.append)
    assert Search.sharpened(search, quick, quick) is quick
    assert said == ["delay at motor.command could not be fitted thoroughly: unstable"]


@pytest.mark.parametrize(
    "mean_square, lacking, gain, z, expected",
    [
        (1e3, True, 4.4e7, 4.0, ["lag", "delay"]),
        (1.0, True, 4.4e7, 4.0, ["lag"]),
        (1.0, True, 8e7, 4.0, ["delay", "lag"]),  # more than any significant one
        (1.0, True, 8e7, 1.7, ["delay", "lag"]),  # whatever its significance
        (1.0, False, 8e7, 4.0, ["lag"]),
    ],
)
def test_where_something_is_missing_a_few_that_are_not_significant_are_refitted_too(
    mean_square: float,
    lacking: bool,
    gain: float,
    z: float,
    expected: list[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("cosim.diagnose.shortlist.balances", lambda problem: set())
    signatures = [
        SimpleNamespace(
            candidate=SimpleNamespace(label=label, effect=label, instance="motor", port="command"),
            score=SimpleNamespace(gain=gain, z=z), unseen=False, asked=None,
        )
        for label, gain, z in sorted(
            (("lag", 6.8e7, 10.7), ("delay", gain, z), ("ripple", 4e7, 1.9), ("sag", 3e7, 4.0)),
            key=lambda item: -item[1],
        )
    ]  # fmt: skip
    search: Any = SimpleNamespace(
        fitting=SimpleNamespace(largest=lambda change: 1.0), lacking=lambda base: lacking,
        raw=SimpleNamespace(unstable=False),
    )  # fmt: skip
    found: Any = SimpleNamespace(
        signatures=signatures, base=near(mean_square),
        corrected={"lag": 1e-10, "delay": 0.019, "ripple": 1.0, "sag": 0.02},
    )  # fmt: skip
    assert [s.candidate.label for s in promising(search, found)] == expected


@pytest.mark.parametrize(
    "close, limit",
    [
        (None, None),
        (30000, PATIENCE * 30000),
        # next to no solver in 1000 communication steps: an effect may bring the first one
        (1000, PATIENCE * SOLVED * 1000),
    ],
    ids=["nothing known", "a multiple", "no state"],
)
def test_quick_fits_have_a_limit_on_work(
    close: int | None, limit: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    search: Any = Search.__new__(Search)
    search.judged = lambda estimate: estimate
    monkeypatch.setattr("cosim.diagnose.fitter.fit", lambda simulator, *_, **__: simulator.limits)
    run = SimpleNamespace(times=np.arange(11.0), lead=0.0)
    problem: Any = SimpleNamespace(step=0.01, run=lambda name: run)
    known: Any = None if close is None else SimpleNamespace(
        simulator=SimpleNamespace(problem=problem, costs={"A": close}), known=None
    )  # fmt: skip
    limits = search.fitted(Simulator(problem), np.zeros(1), known)
    assert limits == ({} if limit is None else {"A": pytest.approx(limit)})


@pytest.mark.parametrize(
    "sizes, unstable, expected",
    [
        ({"calm": 2.5, "long": 2.0, "far": 30.0}, True, ["long"]),  # most excess, of what is near
        ({"calm": 2.5, "long": 2.0, "far": 30.0}, False, ["far"]),  # no run can be so by itself
        ({"calm": 1.0, "long": 1.0, "far": 30.0}, True, ["far"]),  # the others are at the noise
        ({"calm": 5.0, "long": 2.0, "far": 1.0}, True, ["calm"]),
        ({"calm": 1.0, "long": 1.0, "far": 1.0}, True, ["calm", "long", "far"]),
    ],
)
def test_candidates_are_chosen_by_a_run_that_is_not_much_farther_off_than_others(
    sizes: dict[str, float], unstable: bool, expected: list[str]
) -> None:
    random = np.random.default_rng(8)
    runs: list[Any] = []
    for name, size in sizes.items():
        times = np.arange(4000 if name == "long" else 1000) / 100
        # noise of the given size with slow parts, as what a model lacks has
        slow = np.sin(2.0 * np.pi * 0.3 * times) * np.sqrt(2.0 * (size**2 - 1.0))
        data = (slow + random.standard_normal(times.size))[:, None]
        runs.append(SimpleNamespace(name=name, times=times, data=data))
    problem: Any = SimpleNamespace(
        channels=[SimpleNamespace(name="y")], runs=runs, unstable=unstable, late=unstable
    )
    layout = SampleStack(problem, runs)
    vector = layout.vector([run.data for run in runs])
    search: Any = SimpleNamespace(raw=problem, fitting=layout, fit_data=vector)
    search.lacking = lambda base: Search.lacking(search, base)
    base: Any = SimpleNamespace(fit=np.zeros_like(vector))
    assert Search.telling(search, base).names == expected
