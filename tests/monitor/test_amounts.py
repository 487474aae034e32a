"""Which direction changed, where logs tell directions by weights of their own."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.monitor.amounts import Sums
from cosim.monitor.profiles import constants, profiles

LOGS, SAMPLES = 14, 50
DAYS = 7.0 * np.arange(LOGS)


def logs(seed: int, alike: float = 0.97) -> list[np.ndarray]:
    """Patterns of two directions by log, with this cosine, in logs that show them 1 to 30 times."""
    random = np.random.default_rng(seed)
    found = []
    for _ in range(LOGS):
        first, other = random.standard_normal((2, SAMPLES))
        second = alike * first + np.sqrt(1.0 - alike**2) * other
        found.append(np.column_stack([first, second]) * 30.0 ** random.uniform())
    return found


@pytest.mark.parametrize("kind", ["step", "outlier", "spell", "creep"])
@pytest.mark.parametrize("seed", range(5))
def test_what_changed_scores_best_whatever_weights_its_logs_have(kind: str, seed: int) -> None:
    patterns = logs(seed)
    random = np.random.default_rng(100 + seed)
    shapes = profiles(DAYS)
    place = next(k for k, s in enumerate(shapes) if s.kind == kind and s.first == 6)
    truth = shapes[place]
    z, weight = np.zeros((LOGS, 2)), np.zeros((LOGS, 2, 2))
    for n, pattern in enumerate(patterns):
        amount = 5.0 * truth.values[n] / np.max(truth.values)
        rest = pattern[:, 0] * amount + random.standard_normal(SAMPLES)
        z[n], weight[n] = pattern.T @ rest, pattern.T @ pattern
    known = constants(list(range(LOGS)))
    matrix = np.array([shape.values for shape in shapes])
    sums = Sums(z, weight, known, declared=0)
    best = [int(np.argmax(sums.by_profile([column], matrix)[0])) for column in range(2)]
    assert shapes[best[0]].alike(truth)
    assert sums.score([0], truth.values) > sums.score([1], matrix[best[1]]) + 10.0
    fitted = sums.fitted([0], truth.values[None, :])
    size = float(fitted.values[0] * np.max(truth.values))
    half = 4.0 * float(np.sqrt(fitted.covariance[0, 0])) * np.max(truth.values)
    assert abs(size - 5.0) < half  # four deviations: one in 16 000


def test_what_was_there_always_is_no_change() -> None:
    """The second direction is in all logs, the first comes with the seventh one."""
    patterns, random = logs(1, alike=0.3), np.random.default_rng(4)
    shapes = profiles(DAYS)
    place = next(k for k, s in enumerate(shapes) if s.kind == "step" and s.first == 6)
    z, weight = np.zeros((LOGS, 2)), np.zeros((LOGS, 2, 2))
    for n, pattern in enumerate(patterns):
        rest = pattern @ [float(n >= 6), 3.0] + random.standard_normal(SAMPLES)
        z[n], weight[n] = pattern.T @ rest, pattern.T @ pattern
    known = constants(list(range(LOGS)))
    matrix = np.array([shape.values for shape in shapes])
    sums = Sums(z, weight, known, declared=0)
    best = int(np.argmax(sums.by_profile([1], matrix)[0]))
    assert sums.score([0], matrix[place]) > sums.score([1], matrix[best])
