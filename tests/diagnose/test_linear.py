"""The tests on residuals keep their level and see what is there."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim.calibrate.loss import DOUBTFUL, WINDOW, Huber, Squares, Windowed, mean_squares
from cosim.calibrate.parts import Channel, MeasuredRun, Parameter
from cosim.calibrate.problem import Problem
from cosim.diagnose.linear import Absorber, SampleStack, holm, score
from cosim.diagnose.models import GATE, Fitted, compare, more_general
from cosim.diagnose.whiteness import CALIBRATED, whiteness_tests
from cosim.errors import CosimError
from tests.diagnose import built, disc

RATE, SECONDS, TICK = 100, 40, 2e-3
Layout = Callable[..., SampleStack]


@pytest.fixture(scope="module")
def disc_alone(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """A disc, of which a test takes what it needs."""
    return built.problem(tmp_path_factory.mktemp("disc"), lambda w, theta, t: 0.0)


@pytest.fixture(scope="module")
def layout(disc_alone: Problem) -> Layout:
    """One run of one channel, sampled at `RATE`."""
    times = np.arange(RATE * SECONDS) / RATE
    run = MeasuredRun("A", "identification", times, np.zeros((times.size, 1)), {})
    angle = Parameter("angle", "rad", 0.0, -1.0, 1.0, (("load.angle", 1.0),), run="A", late=True)

    def stacked(unstable: bool = False, *, tips: bool = False) -> SampleStack:
        problem = disc_alone.changed(
            channels=[Channel("y", "1", 1.0, "load.w")], runs=[run],
            late=[angle] if unstable or tips else [], far=tips,
        )  # fmt: skip
        return SampleStack(problem, [run])

    return stacked


def p_values(place: SampleStack, correlated: bool, trials: int = 400) -> np.ndarray:
    """Of scores of noise alone against a sine."""
    random = np.random.default_rng(0)
    direction = np.sin(2 * np.pi * 3.0 * place.runs[0].times)
    values = []
    for _ in range(trials):
        noise = random.standard_normal(place.size)
        if correlated:  # each value drawn for ten samples: a correlation of 0.1 s
            noise = np.repeat(noise[::10], 10)
        values.append(score(direction, noise, place, 0).p_value)
    return np.array(values)


@pytest.mark.parametrize("correlated", [False, True])
def test_false_alarms_are_as_rare_as_promised(layout: Layout, correlated: bool) -> None:
    # 400 trials at 5 %: 20 expected, 36 is 3.7 standard deviations above
    assert np.sum(p_values(layout(), correlated) < 0.05) <= 36


def test_a_direction_that_is_there_is_found(layout: Layout) -> None:
    place = layout()
    direction = np.sin(2 * np.pi * 3.0 * place.runs[0].times)
    noise = np.random.default_rng(1).standard_normal(place.size)
    found = score(direction, noise + 0.3 * direction, place, 0)
    # standard deviation of the amplitude is 1/sqrt(2000) = 0.022; four of them
    assert found.amplitude == pytest.approx(0.3, abs=0.09)
    assert found.p_value < 1e-6


def test_holm_corrects_for_the_number_of_tests() -> None:
    assert holm([0.01, 0.04, 0.03]).tolist() == pytest.approx([0.03, 0.06, 0.06])


def test_the_gate_opens_for_the_better_model_only(layout: Layout) -> None:
    place = layout()
    truth = np.sin(2 * np.pi * 0.5 * place.runs[0].times)
    data = truth + np.random.default_rng(2).standard_normal(place.size)
    nothing = np.zeros(place.size)
    there, back = compare(data, nothing, truth, place), compare(data, truth, nothing, place)
    assert there.passed and there.gain > GATE
    assert not back.passed
    assert back.gain == pytest.approx(-there.gain)


@pytest.mark.parametrize(
    ("effect", "size", "named"),
    [
        ("delay", 1.6e-3, False), ("delay", 2.4e-3, True),
        ("clock_skew", 1.0e-3, False), ("clock_skew", 1.5e-3, True),  # in 1.6 s
    ],
)  # fmt: skip
def test_a_shift_below_the_tick_of_the_rig_has_no_name(
    tmp_path: Path, effect: str, size: float, named: bool
) -> None:
    """Though the data show it well."""
    with built.rig(tmp_path, lambda w, theta, t: 0.0, late={effect: size}) as rig:
        quantity = {"delay": "t_d", "clock_skew": "skew"}[effect]
        found = rig.added(rig.base, effect, {quantity: size}, place="log.load.outputs")
        assert found.estimate.theta[-1] == pytest.approx(size, rel=0.3)
        assert rig.search.accepted(rig.base, found)
        rig.search.taken(rig.search.raw.changed(tick=TICK))
        assert rig.search.material(rig.base, found) is named


def friction(asymmetry: float) -> disc.Law:
    """Dry friction that differs between the directions by so much."""
    return lambda w, theta, t: 0.03 * (1.0 + math.copysign(asymmetry, w)) * math.tanh(w / 2e-3)


def moved(fitted: Fitted) -> Fitted:
    """A model as if its law acted at another place."""
    law, item, model = fitted.effects[-1], fitted.signature, fitted.simulator
    assert item is not None
    there = replace(law, port="other")
    parameters = [
        replace(p, name=p.name.replace(law.prefix, there.prefix)) for p in model.problem.parameters
    ]
    strength = next(p for p in parameters if p.strength)
    probe = replace(item.probe, candidate=there, strength=strength)
    estimate = replace(
        fitted.estimate, simulator=model.of(model.problem.with_parameters(parameters))
    )
    return replace(
        fitted, effects=(there,), signature=replace(item, probe=probe), estimate=estimate
    )


@pytest.mark.parametrize("asymmetry", [0.0, 0.3])
def test_the_simpler_law_wins_a_tie(tmp_path: Path, asymmetry: float) -> None:
    with built.rig(tmp_path, friction(asymmetry)) as rig:
        best = rig.added(rig.base, "asymmetric_coulomb", {"tau_c": 0.03, "a": asymmetry})
        simple = rig.added(rig.base, "coulomb", {"tau_c": 0.03})
        assert rig.search.apart(simple, best) == (asymmetry > 0.0)
        chosen = rig.search.simplest(rig.base, best, [best, simple])
    assert chosen is (best if asymmetry else simple)
    assert more_general(best, simple) and not more_general(simple, best)


def test_the_same_law_elsewhere_must_do_as_well_to_a_hair(tmp_path: Path) -> None:
    """With fewer parameters; a parameter more may make up for another place."""
    with built.rig(tmp_path, friction(0.0)) as rig:
        search, base = rig.search, rig.base
        best = rig.added(base, "coulomb", {"tau_c": 0.03, "w_0": 2e-3})
        other = replace(best, signature=rig.trace(base, "stribeck"))  # of another quantity
        twin = rig.added(base, "coulomb", {"tau_c": 0.03})
        for share, wanted in ((5e-6, True), (2e-5, False)):
            more = search.total(base, best) * (1.0 - share) - search.total(base, twin)
            there = moved(twin)
            there.estimate = replace(there.estimate, robust=there.estimate.robust - more)
            assert search.simplest(base, best, [best, there]) is (there if wanted else best)
            assert search.simplest(base, other, [there]) is other
        same = rig.trace(base, "coulomb")
    assert not more_general(best, there)
    assert there.signature is not None
    assert more_general(best, replace(there, signature=replace(there.signature, twins=(same,))))


@pytest.fixture(scope="module")
def two(disc_alone: Problem) -> Problem:
    """A problem with two parameters of scale 1."""
    return disc_alone.with_parameters([Parameter(n, "1", 0.0, 0.0, 1.0, ()) for n in "ab"])


def test_a_parameter_at_its_bound_absorbs_nothing(two: Problem) -> None:
    random = np.random.default_rng(2)
    columns = 10.0 * random.standard_normal((50, 2))
    first = columns[:, 0]
    assert np.linalg.norm(Absorber(columns, two).rest(first)) < 1e-5 * np.linalg.norm(first)
    held = Absorber(columns, two, ("a",))
    across = first - columns[:, 1] * float(columns[:, 1] @ first) / float(
        columns[:, 1] @ columns[:, 1]
    )
    # rounding of the float32 basis
    assert held.rest(first) == pytest.approx(across, abs=1e-4)
    assert held.change(first)[0] == 0.0


def test_values_that_are_not_finite_are_refused_when_something_is_absorbed(two: Problem) -> None:
    absorber = Absorber(np.eye(4, 2) * 10.0, two)
    assert absorber.rest(np.ones(4)) == pytest.approx([0.0, 0.0, 1.0, 1.0])
    with pytest.raises(CosimError, match="not finite"):
        absorber.rest(np.array([np.nan, 0.0, 1.0, 1.0]))
    with pytest.raises(CosimError, match="not finite"):  # and without a warning
        absorber.rest(np.array([1e39, 0.0, 1.0, 1.0]))


def test_windows_that_are_far_off_count_by_their_logarithm() -> None:
    calm = np.full((3 * WINDOW, 2), 1.5)
    calm[5, 0] = np.nan
    # nothing changes below the limit: 1.5^2 < 4
    assert Windowed().cost(calm) == pytest.approx(Squares().cost(calm), rel=1e-12)
    off = calm.copy()
    off[2 * WINDOW :, 1] = -40.0
    more = Windowed().cost(off) - Windowed().cost(calm)
    expected = 0.5 * WINDOW * (DOUBTFUL * (1.0 + np.log(1600.0 / DOUBTFUL)) - 1.5**2)
    assert more == pytest.approx(expected, rel=1e-12)
    weights = Windowed().weight(off)
    assert weights[-1] == pytest.approx([1.0, DOUBTFUL / 1600.0], rel=1e-12)
    # a gap moves the windows of its channel by one sample
    assert weights[2 * WINDOW - 1] == pytest.approx([1.0, 1.0], rel=1e-12)


@pytest.mark.parametrize("loss", [Squares(), Huber(3.0), Windowed()])
def test_weights_give_the_gradient_of_a_loss(loss: Any) -> None:
    random = np.random.default_rng(3)
    residual = random.standard_normal((3 * WINDOW + 7, 2)) * np.repeat([[1.0, 8.0]], 67, axis=0)
    residual[4, 1] = np.nan
    slope = np.nan_to_num(loss.weight(residual) * residual)
    for place in ((0, 0), (11, 1), (65, 1), (30, 0)):
        moved, step = residual.copy(), 1e-5
        moved[place] += step
        back = residual.copy()
        back[place] -= step
        # central differences: errors of 1e-10 against rounding of 1e-11 / 1e-5
        change = (loss.cost(moved) - loss.cost(back)) / (2.0 * step)
        assert change == pytest.approx(slope[place], rel=1e-4, abs=1e-5)


def test_windows_of_vectors_are_those_of_arrays(layout: Layout) -> None:
    random = np.random.default_rng(4)
    times = np.arange(3 * WINDOW + 7) / RATE
    rows = random.standard_normal((times.size, 2)) * 5.0
    rows[3:9, 1] = np.nan
    runs = [MeasuredRun(n, "identification", times, rows, {}) for n in "AB"]
    channels = [Channel(n, "1", 1.0, "load.w") for n in "yz"]
    problem = layout(unstable=True).problem.changed(channels=channels, runs=runs)
    place = SampleStack(problem, runs)
    vector = place.vector([rows, 3.0 * rows])
    both = place.vector([mean_squares(rows), mean_squares(3.0 * rows)])
    assert place.mean_squares(vector) == pytest.approx(both, rel=1e-12)
    costs = Windowed().cost(rows) + Windowed().cost(3.0 * rows)
    assert place.cost(vector) == pytest.approx(costs, rel=1e-12)
    assert place.root(vector, 0.5 * vector) ** 2 == pytest.approx(
        place.vector([Windowed().weight(rows), Windowed().weight(3.0 * rows)]), rel=1e-12
    )
    # where no run turns unstable, what is far off counts in full
    place = SampleStack(problem.changed(far=True), runs)
    assert place.cost(vector) == pytest.approx(0.5 * float(vector @ vector), rel=1e-12)
    assert np.all(place.root(vector) == 1.0)


def test_one_stretch_that_is_far_off_does_not_decide_where_runs_turn_unstable(
    layout: Layout,
) -> None:
    place = layout(unstable=True)
    truth = np.sin(2 * np.pi * 0.5 * place.runs[0].times)
    data = truth + np.random.default_rng(6).standard_normal(place.size)
    data[1000:1040] += 60.0  # a moment that neither model has
    nothing, lucky = np.zeros(place.size), np.zeros(place.size)
    lucky[1000:1040] += 20.0
    assert compare(data, lucky, truth, place).gain > GATE
    assert float((data - lucky) @ (data - lucky)) < float((data - truth) @ (data - truth))
    assert compare(data, nothing, truth, place).passed
    assert compare(data, lucky, truth, layout()).gain < -GATE


def test_a_value_that_was_tried_from_a_list_counts(tmp_path: Path) -> None:
    """Cogging with one cycle per turn is an unbalance that had its number of cycles chosen."""
    with built.rig(tmp_path, lambda w, theta, t: 0.01 * math.sin(theta + 0.5)) as rig:
        unbalance = rig.added(rig.base, "unbalance", {"m_u": 0.01, "psi": 0.5})
        cogging = rig.added(rig.base, "cogging", {"tau_c": 0.01, "psi": 0.5}, held={"n": 1.0})
        free = rig.added(rig.base, "cogging", {"tau_c": 0.01, "psi": 0.5, "n": 1.0})
        assert not rig.search.apart(unbalance, cogging)
        assert rig.search.simplest(rig.base, cogging, [cogging, unbalance]) is unbalance
    assert cogging.free == unbalance.free and cogging.complexity == unbalance.complexity + 1
    assert more_general(cogging, unbalance) and not more_general(unbalance, cogging)
    assert free.complexity == cogging.complexity


def test_a_burst_is_no_structure_where_something_may_turn_over(layout: Layout) -> None:
    place = layout()
    tips = layout(tips=True)
    noise = np.random.default_rng(4).standard_normal(place.size)
    burst, lasting = np.zeros(place.size), np.zeros(place.size)
    burst[1000:1040] = 20.0  # 0.4 s of 40 s: 1 % of the windows
    lasting[::10] = 20.0 * np.sqrt(40 / (place.size / 10))  # the same energy, all the time
    for extra, expected, anywhere in (
        (0.0, False, False), (burst, False, True), (lasting + 0.5, True, True)
    ):  # fmt: skip
        for at, structured in ((tips, expected), (place, anywhere)):
            (found,) = whiteness_tests(noise + extra, at)
            assert found.structured is structured
    (found,) = whiteness_tests(noise + burst, tips)
    assert found.rms > 2.0 and found.lasting < CALIBRATED
