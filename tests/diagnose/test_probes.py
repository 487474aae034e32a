"""Many places in one FMU and in one simulation tell the same as each alone."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim.calibrate.problem import Problem
from cosim.diagnose.candidates import Candidate, candidates
from cosim.diagnose.linear import Absorber, SampleStack
from cosim.diagnose.probes import EFFECTS, MOST, PLACES, Batch, batches
from cosim.diagnose.secant import Bench, _shared, model_values
from cosim.errors import CosimError
from tests.problems import simulator

pytestmark = pytest.mark.slow


def places(*ports: str) -> list[Candidate]:
    """One effect at several places of an arm."""
    return [Candidate("arm", "ur5_arm", "coulomb", port) for port in ports]


def measured(*signals: str, kind: str = "rotation") -> Any:
    """A problem of which only channels and balances matter; `tail` is a group of balances."""
    names = ["wheel", "body", "joint", *(f"wheel_{k}" for k in range(2 * MOST))]
    extra = {"balances": [{"name": name, "kind": kind} for name in [*names, "joint_1", "joint_2"]]}
    arm = SimpleNamespace(description=SimpleNamespace(extra=extra))
    return SimpleNamespace(
        channels=[SimpleNamespace(signal=s) for s in signals],
        system=lambda: SimpleNamespace(members={"arm": arm}),
    )


def test_elements_of_a_vector_share_a_simulation() -> None:
    problem = measured("arm.q[1]", "arm.q[2]", "drive.i[1]", "drive.i[2]")
    (batch,) = batches(places("joint", "joint_1", "joint_2"), problem)
    assert batch.apart
    assert batch.change == {"arm": "+coulomb@joint_1+coulomb@joint_2"}
    assert batch.whole is not None and batch.whole.port == "joint"
    masks = {c.port: m.tolist() for c, m in batch.members if m is not None}
    assert masks == {"joint_1": [True, False, True, False], "joint_2": [False, True, False, True]}


def test_without_channels_of_their_own_they_do_not() -> None:
    (batch,) = batches(places("joint", "joint_1", "joint_2"), measured("arm.q[1]", "tool.x"))
    assert not batch.apart


def test_no_candidate_is_lost() -> None:
    known = places(*(f"wheel_{k}" for k in range(2 * MOST)), "wheel", "body", "tail")
    found = batches(known, measured("body.x"))
    assert sorted(c.label for b in found for c in b.candidates) == sorted(c.label for c in known)
    assert max(len(b.members) for b in found) == MOST
    (alone,) = [b for b in found if any(c.port == "tail" for c, _ in b.members)]
    assert len(alone.members) == 1


def test_where_places_are_split_the_whole_vector_is_by_itself() -> None:
    """With the last wheel's FMU as its own, it would be that wheel's effect by another name."""
    known = places("wheel", "wheel_1", "wheel_2", "wheel_3")
    found = batches(known, measured("body.x", kind="coefficient"))
    assert [[c.port for c in b.candidates] for b in found] == [
        ["wheel_1", "wheel_2"], ["wheel_3"], ["wheel"],
    ]  # fmt: skip
    assert all(b.whole is None for b in found)


@pytest.mark.parametrize(
    "effects, shared",
    [
        (("delay",), False),
        (("bristle", "coulomb", "stribeck", "unbalance"), True),
        (("delay", "first_order_lag", "gain", "sample_hold"), True),
    ],
)
def test_an_effect_among_others_does_what_it_does_alone(
    clean_bench: Problem, effects: tuple[str, ...], shared: bool
) -> None:
    known = [c for c in candidates(clean_bench) if c.effect in effects]
    assert len({c.instance for c in known}) >= 2
    layout = SampleStack(clean_bench, clean_bench.chosen("identification"))
    several = [b for b in batches(known, clean_bench) if b.change != b.members[0][0].change]
    assert any(len(effects_of(b)) > 1 for b in several) == shared
    for batch in several:
        for probe in batch.probes(clean_bench):
            (alone,) = Batch(None, ((probe.candidate, None),)).probes(clean_bench)
            assert alone.problem is not probe.problem
            values = []
            for one in (alone, probe):
                theta = one.problem.nominal
                for name, value in one.values(0.01, 0.0, {}).items():
                    theta[one.problem.index(name)] = value
                values.append(model_values(simulator(one.problem), theta, layout))
                simulator(one.problem).close()
            # effects of strength 0 are absent exactly, so nothing but bits may be compared
            assert np.array_equal(*values)


def effects_of(batch: Batch) -> set[str]:
    """Effects in the FMU of a batch."""
    return {part.partition("@")[0] for change in (batch.change or {}).values()
            for part in change.split("+")[1:]}  # fmt: skip


def test_few_fmus_serve_many_candidates(clean_bench: Problem) -> None:
    found = batches(candidates(clean_bench), clean_bench)
    built = [b for b in found if b.change]
    changes = {tuple((b.change or {}).items()) for b in built}
    assert len(changes) < 0.4 * len(built)
    for batch in built:
        assert len(effects_of(batch)) <= EFFECTS
        places = sum(change.count("+") for change in (batch.change or {}).values())
        assert places <= max(PLACES, len(batch.members))


def test_the_angle_of_an_effect_is_found_without_a_search(clean_bench: Problem) -> None:
    (wanted,) = [c for c in candidates(clean_bench) if c.label == "unbalance at load.flange"]
    layout = SampleStack(clean_bench, clean_bench.chosen("identification"))
    theta = clean_bench.nominal
    model = model_values(simulator(clean_bench), theta, layout)
    (probe,) = Batch(None, ((wanted, None),)).probes(clean_bench)
    strength, angle = 0.02, 2.2  # small against what moves the shaft, in no special direction
    point = probe.problem.nominal
    for name, value in probe.values(strength, angle, {}).items():
        point[probe.problem.index(name)] = value
    seen = model_values(simulator(probe.problem), point, layout) - model
    simulator(probe.problem).close()
    jacobian = np.zeros((layout.size, len(clean_bench.parameters)))
    absorber = Absorber(jacobian, clean_bench)
    place = Bench(simulator(clean_bench), theta, layout, model, seen, absorber)
    (found,) = place.followed(place.begun([wanted]))
    # the signature is linear in the strength to a percent, and so is the angle
    assert found.second == pytest.approx(angle, abs=0.02)
    assert found.value * found.score.amplitude == pytest.approx(strength, rel=0.02)


@pytest.mark.parametrize("asymmetry", [-0.4, 0.0, 1.0])
def test_the_asymmetry_of_friction_is_found_without_a_search(
    clean_bench: Problem, asymmetry: float
) -> None:
    (wanted,) = [
        c for c in candidates(clean_bench) if c.label == "asymmetric_coulomb at load.flange"
    ]
    layout = SampleStack(clean_bench, clean_bench.chosen("identification"))
    model = model_values(simulator(clean_bench), clean_bench.nominal, layout)
    (probe,) = Batch(None, ((wanted, None),)).probes(clean_bench)
    assert probe.reach == (-1.0, 1.0)
    point = probe.problem.nominal
    for name, value in probe.values(0.02, asymmetry, {}).items():
        point[probe.problem.index(name)] = value
    seen = model_values(simulator(probe.problem), point, layout) - model
    simulator(probe.problem).close()
    absorber = Absorber(np.zeros((layout.size, len(clean_bench.parameters))), clean_bench)
    place = Bench(simulator(clean_bench), clean_bench.nominal, layout, model, seen, absorber)
    (found,) = place.followed(place.begun([wanted]))
    # linear in both to a few percent: the speed at which the sign is smoothed is passed elsewhere
    assert found.second == pytest.approx(asymmetry, abs=0.05)
    assert -1.0 <= found.second <= 1.0
    assert found.value * found.score.amplitude == pytest.approx(0.02, rel=0.05)


def test_cycles_per_revolution_are_tried(clean_bench: Problem) -> None:
    (wanted,) = [c for c in candidates(clean_bench) if c.effect == "torque_ripple"]
    layout = SampleStack(clean_bench, clean_bench.chosen("identification"))
    theta = clean_bench.nominal
    model = model_values(simulator(clean_bench), theta, layout)
    (probe,) = Batch(None, ((wanted, None),)).probes(clean_bench)
    ((name, angle),) = [(p.name, p.hints.cycles) for p in probe.others if p.hints.cycles]
    assert angle == "motor.torque_constant.torque_ripple.angle"
    truth = probe.values(0.01, 0.7, {name: 7.0})
    point = probe.problem.nominal
    for full, value in truth.items():
        point[probe.problem.index(full)] = value
    seen = model_values(simulator(probe.problem), point, layout) - model
    simulator(probe.problem).close()
    absorber = Absorber(np.zeros((layout.size, len(clean_bench.parameters))), clean_bench)
    place = Bench(simulator(clean_bench), theta, layout, model, seen, absorber)
    (found,) = place.followed(place.begun([wanted], thorough=True))
    assert found.fixed == {name: 7.0}
    assert found.second == pytest.approx(0.7, abs=0.02)  # linear in the strength to a percent
    (blind,) = place.followed(place.begun([wanted]))
    assert blind.score.gain < 0.1 * found.score.gain


def test_a_whole_vector_is_blamed_only_if_every_element_asks_for_it() -> None:
    def trials(gains: tuple[float, ...]) -> list[Any]:
        parts = [
            SimpleNamespace(rough=True, best=SimpleNamespace(score=SimpleNamespace(gain=g)))
            for g in gains
        ]
        return [*parts, SimpleNamespace(rough=False, best=None)]

    assert len(_shared(trials((200.0, 150.0, 90.0)))) == 4
    assert len(_shared(trials((200.0, 150.0, 1.0)))) == 3


def test_a_simulation_that_runs_away_is_refused(
    clean_bench: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    layout = SampleStack(clean_bench, clean_bench.chosen("identification"))
    nothing = np.zeros(layout.size)
    absorber = Absorber(np.zeros((layout.size, len(clean_bench.parameters))), clean_bench)
    place = Bench(simulator(clean_bench), clean_bench.nominal, layout, nothing, nothing, absorber)
    for value in (1e30, np.nan):
        monkeypatch.setattr(
            "cosim.diagnose.secant.model_values", lambda *_, v=value: np.full(layout.size, v)
        )
        with pytest.raises(CosimError, match="runs away"):
            place.at(clean_bench, {})
