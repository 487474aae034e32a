"""The tests on residuals keep their level and see what is there."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim.calibrate.loss import DOUBTFUL, WINDOW, Huber, Squares, Windowed, mean_squares
from cosim.diagnose.linear import Absorber, SampleStack, holm, score
from cosim.diagnose.models import GATE, Fitted, compare, more_general
from cosim.diagnose.search import Search
from cosim.diagnose.whiteness import CALIBRATED, whiteness_tests
from cosim.errors import CosimError

RATE, SECONDS = 100, 40


def layout(unstable: bool = False, *, tips: bool = False) -> SampleStack:
    """One run of one channel, sampled at `RATE`."""
    times = np.arange(RATE * SECONDS) / RATE
    run: Any = SimpleNamespace(name="A", times=times, data=np.zeros((times.size, 1)))
    problem: Any = SimpleNamespace(
        channels=[SimpleNamespace(name="y")], unstable=unstable, late=tips
    )
    return SampleStack(problem, [run])


def p_values(correlated: bool, trials: int = 400) -> np.ndarray:
    """Of scores of noise alone against a sine."""
    random, place = np.random.default_rng(0), layout()
    direction = np.sin(2 * np.pi * 3.0 * place.runs[0].times)
    values = []
    for _ in range(trials):
        noise = random.standard_normal(place.size)
        if correlated:  # each value drawn for ten samples: a correlation of 0.1 s
            noise = np.repeat(noise[::10], 10)
        values.append(score(direction, noise, place, 0).p_value)
    return np.array(values)


@pytest.mark.parametrize("correlated", [False, True])
def test_false_alarms_are_as_rare_as_promised(correlated: bool) -> None:
    # 400 trials at 5 %: 20 expected, 36 is 3.7 standard deviations above
    assert np.sum(p_values(correlated) < 0.05) <= 36


def test_a_direction_that_is_there_is_found() -> None:
    place = layout()
    direction = np.sin(2 * np.pi * 3.0 * place.runs[0].times)
    noise = np.random.default_rng(1).standard_normal(place.size)
    found = score(direction, noise + 0.3 * direction, place, 0)
    # standard deviation of the amplitude is 1/sqrt(2000) = 0.022; four of them
    assert found.amplitude == pytest.approx(0.3, abs=0.09)
    assert found.p_value < 1e-6


def test_holm_corrects_for_the_number_of_tests() -> None:
    assert holm([0.01, 0.04, 0.03]).tolist() == pytest.approx([0.03, 0.06, 0.06])


def test_the_gate_opens_for_the_better_model_only() -> None:
    place = layout()
    truth = np.sin(2 * np.pi * 0.5 * place.runs[0].times)
    data = truth + np.random.default_rng(2).standard_normal(place.size)
    nothing = np.zeros(place.size)
    there, back = compare(data, nothing, truth, place), compare(data, truth, nothing, place)
    assert there.passed and there.gain > GATE
    assert not back.passed
    assert back.gain == pytest.approx(-there.gain)


@pytest.mark.parametrize(
    ("effect", "unit", "strength", "named"),
    [
        ("delay", "s", 3e-4, False), ("delay", "s", 6e-4, True),
        ("clock_skew", "1", 3e-5, False), ("clock_skew", "1", 6e-5, True),  # in 10 s
    ],
)  # fmt: skip
def test_a_shift_below_the_tick_of_the_rig_has_no_name(
    effect: str, unit: str, strength: float, named: bool
) -> None:
    place = layout()
    run = SimpleNamespace(times=np.array([0.0, 10.0]))
    rig: Any = SimpleNamespace(
        raw=SimpleNamespace(tick=5e-4, step=5e-4, runs=[run]), fitting=place, checking=place
    )
    model = np.zeros(place.size)
    base: Any = SimpleNamespace(fit=model, check=model)
    quantity = SimpleNamespace(name="law.strength", unit=unit)
    other: Any = SimpleNamespace(
        fit=model + 1.0, check=model + 1.0, signature=SimpleNamespace(strength=quantity),
        estimate=SimpleNamespace(values={"law.strength": strength}),
        effects=[SimpleNamespace(effect=effect)],
    )  # fmt: skip
    assert Search.material(rig, base, other) is named


@pytest.mark.parametrize("told_apart", [False, True])
def test_the_simpler_law_wins_a_tie(told_apart: bool) -> None:
    def law(
        free: int, place: str = "load.flange", same: tuple[str, ...] = (), quantity: str = "tau_c",
        gain: float = 1e7,
    ) -> Any:  # fmt: skip
        gate, item = SimpleNamespace(passed=True), SimpleNamespace(same=same)
        effects = [SimpleNamespace(place=place)]
        return SimpleNamespace(
            complexity=free, effects=effects, gate=gate, signature=item, quantity=quantity,
            gain=gain,
        )  # fmt: skip

    rig: Any = SimpleNamespace(
        accepted=lambda *_: True, apart=lambda *_: told_apart, total=lambda _, f: f.gain
    )
    best, simple, elsewhere = law(12), law(11, gain=1e7 - 1e3), law(10, "gearbox.flange_a")
    elsewhere.quantity = "b"
    chosen = Search.simplest(rig, law(10), best, [best, simple, elsewhere])
    assert chosen is (best if told_apart else simple)
    # the same quantity at another place with fewer parameters: only if it does as well to a hair
    for less, wanted in ((50.0, True), (500.0, False)):
        twin = law(11, "gearbox.flange_a", gain=1e7 - less)
        chosen = Search.simplest(rig, law(10), best, [best, twin])
        assert chosen is (twin if wanted else best)
    assert more_general(best, simple)
    assert not more_general(simple, best)
    assert not more_general(best, elsewhere)
    assert more_general(best, law(10, "gearbox.flange_a", ("coulomb at load.flange",)))


def test_a_parameter_at_its_bound_absorbs_nothing() -> None:
    random = np.random.default_rng(2)
    columns = 10.0 * random.standard_normal((50, 2))
    parameters = [SimpleNamespace(name=n, prior=None) for n in "ab"]
    problem: Any = SimpleNamespace(parameters=parameters, names=["a", "b"], scale=np.ones(2))
    first = columns[:, 0]
    assert np.linalg.norm(Absorber(columns, problem).rest(first)) < 1e-5 * np.linalg.norm(first)
    held = Absorber(columns, problem, ("a",))
    across = first - columns[:, 1] * float(columns[:, 1] @ first) / float(
        columns[:, 1] @ columns[:, 1]
    )
    # rounding of the float32 basis
    assert held.rest(first) == pytest.approx(across, abs=1e-4)
    assert held.change(first)[0] == 0.0


def test_values_that_are_not_finite_are_refused_when_something_is_absorbed() -> None:
    columns = np.eye(4, 2) * 10.0
    problem: Any = SimpleNamespace(names=("a", "b"), parameters=[SimpleNamespace(prior=0.0)] * 2)
    absorber = Absorber(columns, problem)
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


def test_windows_of_vectors_are_those_of_arrays() -> None:
    random = np.random.default_rng(4)
    times = np.arange(3 * WINDOW + 7) / RATE
    rows = random.standard_normal((times.size, 2)) * 5.0
    rows[3:9, 1] = np.nan
    runs: Any = [SimpleNamespace(name=n, times=times, data=rows) for n in "AB"]
    problem: Any = SimpleNamespace(channels=[SimpleNamespace(name=n) for n in "yz"], unstable=True)
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
    problem.unstable = False
    place = SampleStack(problem, runs)
    assert place.cost(vector) == pytest.approx(0.5 * float(vector @ vector), rel=1e-12)
    assert np.all(place.root(vector) == 1.0)


def test_one_stretch_that_is_far_off_does_not_decide_where_runs_turn_unstable() -> None:
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


def test_a_value_that_was_tried_from_a_list_counts() -> None:
    def law(fixed: dict[str, float], *names: str) -> Fitted:
        estimate: Any = SimpleNamespace(
            theta=np.zeros(len(names)), problem=SimpleNamespace(names=names)
        )
        item: Any = SimpleNamespace(fixed=fixed, same=())
        effects: Any = (SimpleNamespace(place="load.flange"),)
        return Fitted(effects, estimate, np.zeros(0), np.zeros(0), item)

    unbalance = law({}, "m_u", "psi")
    cogging = law({"n": 1.0}, "tau_c", "psi")
    assert cogging.free == unbalance.free and cogging.complexity == unbalance.complexity + 1
    assert more_general(cogging, unbalance) and not more_general(unbalance, cogging)
    assert law({"n": 1.0}, "tau_c", "psi", "n").complexity == cogging.complexity


def test_a_burst_is_no_structure_where_something_may_turn_over() -> None:
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
