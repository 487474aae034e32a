"""What counts as more than noise: slow, fast, in few samples, at the end of a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate.problem import Channel, MeasuredRun, Problem
from cosim.diagnose.linear import SampleStack
from cosim.diagnose.whiteness import WhitenessTest, whiteness_tests
from tests.diagnose import built


@pytest.fixture(scope="module")
def disc_alone(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    """A disc, of which a test takes what it needs."""
    return built.problem(tmp_path_factory.mktemp("disc"), lambda w, theta, t: 0.0)


def whiteness(problem: Problem, *runs: np.ndarray) -> WhitenessTest:
    """The test of one channel with these residuals, over its noise."""
    measured = [
        MeasuredRun(f"R{i}", "identification", np.arange(one.size) / 100.0,
                    np.zeros((one.size, 1)), {})
        for i, one in enumerate(runs)
    ]  # fmt: skip
    stack = SampleStack(
        problem.changed(channels=[Channel("y", "1", 1.0, "load.w")], runs=measured), measured
    )
    (found,) = whiteness_tests(np.concatenate(runs), stack)
    return found


def noise(*sizes: int, seed: int = 1) -> list[np.ndarray]:
    random = np.random.default_rng(seed)
    return [random.normal(size=size) for size in sizes]


@pytest.mark.parametrize("cycles", [0.1, 0.25, 0.5])  # per sample: whole periods in 20 samples
def test_a_hum_is_more_than_noise(disc_alone: Problem, cycles: float) -> None:
    runs = noise(1000, 1000)
    hum = [one + 2.0 * np.cos(2.0 * np.pi * cycles * np.arange(one.size)) for one in runs]
    assert not whiteness(disc_alone, *runs).structured
    found = whiteness(disc_alone, *hum)
    assert found.structured and found.p_fast < 1e-9 < found.p_value


def test_white_noise_that_is_larger_than_stated_is_not_fast(disc_alone: Problem) -> None:
    # checks of the columns tell it; 1000 of these have p below 0.01 in 1 %
    values = [whiteness(disc_alone, *(3.0 * n for n in noise(90, 400, seed=s))).p_fast
              for s in range(200)]  # fmt: skip
    assert 0 <= sum(p < 0.01 for p in values) <= 8  # 2 expected; 8 has a chance of 1e-3
    assert np.quantile(values, 0.5) == pytest.approx(0.5, abs=0.12)


def test_larger_noise_is_white_and_what_lasts_is_not(disc_alone: Problem) -> None:
    runs = noise(1000, 1000)
    large = whiteness(disc_alone, *(1.5 * one for one in runs))
    assert large.structured and large.white and large.p_white > 0.01 > large.p_value
    assert not whiteness(disc_alone, *(2.5 * one for one in runs)).white
    walk = [one + np.sin(0.05 * np.arange(one.size)) for one in runs]
    alternating = [one + np.cos(np.pi * np.arange(one.size)) for one in runs]
    for other in (walk, alternating):
        found = whiteness(disc_alone, *other)
        assert found.structured and not found.white


def test_few_samples_and_ends_of_runs_count(disc_alone: Problem) -> None:
    for sizes in ([17, 17, 17], [37, 37], [20, 9], [3, 2]):
        pushed = noise(*sizes)
        assert not whiteness(disc_alone, *pushed).structured
        pushed[-1][-2:] += 74.0
        found = whiteness(disc_alone, *pushed)
        assert found.structured, sizes
        assert found.lasting == pytest.approx(found.rms)


def test_windows_are_of_like_length(disc_alone: Problem, tmp_path: Path) -> None:
    # a run of 2001 samples has 100 windows, not one sample in none of them or in one of its own
    (one,) = noise(2001)
    one[-1] = 60.0
    found = whiteness(disc_alone, one)
    assert found.rms == pytest.approx(found.lasting)
    assert found.slow == pytest.approx(np.sqrt(1.0 + 60.0**2 / 20.0 / 100.0), rel=0.05)
