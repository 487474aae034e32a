"""Many places in one FMU and in one simulation tell the same as each alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate.model import Model
from cosim.calibrate.parts import Channel, Coarse
from cosim.calibrate.problem import Problem
from cosim.diagnose.candidates import Candidate, balances, candidates
from cosim.diagnose.linear import Absorber, SampleStack
from cosim.diagnose.probes import EFFECTS, MOST, PLACES, Batch, batches, single
from cosim.diagnose.secant import Bench, model_values
from cosim.diagnose.signature import unscored
from cosim.diagnose.trials import Trials, shared
from cosim.errors import CosimError
from cosim.installation.builder import default_provider
from cosim.system.toml import read_system
from tests.problems import simulator

pytestmark = pytest.mark.slow

SYSTEMS = Path(__file__).parents[2] / "scenarios/systems"


def declared(system: str, *signals: str) -> Problem:
    """A system of the project with these signals as channels, without runs."""
    model = Model.of(read_system(SYSTEMS / f"{system}.toml"), default_provider())
    channels = [Channel(name, "", 1.0, name) for name in signals]
    return Problem(system, model, (), channels, (), 1e-3, Coarse(1e-3))


def chosen(problem: Problem, instance: str, effect: str) -> list[Candidate]:
    """One effect at all its places of an instance."""
    return [c for c in candidates(problem) if (c.instance, c.effect) == (instance, effect)]


def test_elements_of_a_vector_share_a_simulation() -> None:
    signals = [f"{name}[{k}]" for name in ("arm.q", "drive.i") for k in range(1, 7)]
    problem = declared("ur5_lab", *signals)
    (batch,) = batches(chosen(problem, "arm", "coulomb"), problem)
    assert batch.apart
    assert batch.change == {"arm": "".join(f"+coulomb@joint_{k}" for k in range(1, 7))}
    assert batch.whole is not None and batch.whole.port == "joint"
    masks = {c.port: np.flatnonzero(m).tolist() for c, m in batch.members if m is not None}
    assert masks == {f"joint_{k}": [k - 1, k + 5] for k in range(1, 7)}


def test_without_channels_of_their_own_they_do_not() -> None:
    problem = declared("ur5_lab", *(f"arm.q[{k}]" for k in range(1, 6)), "arm.q")
    (batch,) = batches(chosen(problem, "arm", "coulomb"), problem)
    assert not batch.apart and [mask for _, mask in batch.members] == [None] * 6


def test_no_candidate_is_lost() -> None:
    """Nor do balances share an FMU with groups of them, which declare the same."""
    problem = declared("base_lab", "mocap.x")
    known, kinds = candidates(problem), balances(problem)
    found = batches(known, problem)
    assert sorted(c.label for b in found for c in b.candidates) == sorted(c.label for c in known)
    assert max(len(b.members) for b in found) == MOST
    groups = [{(c.instance, c.port) in kinds for c, _ in b.members} for b in found if b.change]
    assert all(len(both) == 1 for both in groups)
    fmus: dict[str, set[bool]] = {}
    for batch, both in zip([b for b in found if b.change], groups, strict=True):
        fmus.setdefault(str(batch.change), set()).update(both)
    assert all(len(both) == 1 for both in fmus.values())
    assert {False} in fmus.values()


def test_where_places_are_split_the_whole_vector_is_by_itself() -> None:
    """With the last wheel's FMU as its own, it would be that wheel's effect by another name."""
    problem = declared("omni_lab", "camera.x")
    found = batches(chosen(problem, "base", "radius_offset"), problem)
    assert [[c.port for c in b.candidates] for b in found] == [
        ["radius_1", "radius_2"], ["radius_3"], ["radius"],
    ]  # fmt: skip
    assert all(b.whole is None for b in found)
    assert found[1].change != found[2].change


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
            assert np.array_equal(values[0], values[1])


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


@pytest.mark.parametrize(
    ("gains", "whole"), [((200.0, 150.0, 90.0), True), ((200.0, 150.0, 1.0), False)]
)
def test_a_whole_vector_is_blamed_only_if_every_element_asks_for_it(
    clean_bench: Problem, gains: Sequence[float], whole: bool
) -> None:
    (wanted,) = [c for c in candidates(clean_bench) if c.label == "coulomb at load.flange"]
    (probe,) = single(clean_bench, [wanted])

    def tried(gain: float, rough: bool) -> Trials:
        item = unscored(probe)
        item.score = replace(item.score, gain=gain)
        return Trials(probe, 1.0, best=item, rough=rough)

    trials = [*(tried(gain, True) for gain in gains), tried(sum(gains), False)]
    assert shared(trials) == (trials if whole else trials[:-1])


def test_a_simulation_that_runs_away_is_refused(clean_bench: Problem) -> None:
    """Values that are no numbers an FMU refuses itself."""
    layout = SampleStack(clean_bench, clean_bench.chosen("identification"))
    nothing = np.zeros(layout.size)
    absorber = Absorber(np.zeros((layout.size, len(clean_bench.parameters))), clean_bench)
    place = Bench(simulator(clean_bench), clean_bench.nominal, layout, nothing, nothing, absorber)
    place.at(clean_bench, {})
    away = clean_bench.changed(channels=[replace(c, gain=1e30) for c in clean_bench.channels])
    with pytest.raises(CosimError, match="runs away"):
        place.at(away, {})
