"""Fits go along products: a mass and where it sits make up for each other along a hyperbola."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate.products import FARTHEST, pairs, stepped
from cosim.diagnose.candidates import candidates
from cosim.installation.builder import default_provider
from sources.distribution.contents import declared

RIG = Path(__file__).parents[2] / "scenarios/crawler_bench/dataset.toml"


@pytest.mark.parametrize("change", [[0.3, -0.2], [-0.4, 0.5], [1.0, 0.0]])
def test_a_product_changes_as_its_derivatives_say(change: list[float]) -> None:
    before, step = np.array([0.5, 2.0]), np.array(change)
    mass, place = stepped(before, step, [(1, 0)])
    assert mass == 0.5 + step[0]
    assert mass * place == pytest.approx(1.0 + 0.5 * step[1] + 2.0 * step[0], rel=1e-14)


def test_a_factor_that_vanishes_or_turns_leaves_a_straight_step() -> None:
    for mass in (-0.5, -0.7):
        found = stepped(np.array([0.5, 2.0]), np.array([mass, 0.1]), [(1, 0)])
        np.testing.assert_array_equal(found, [0.5 + mass, 2.1])
    found = stepped(np.array([0.5, 2.0]), np.array([-0.499, 0.1]), [(1, 0)])
    assert found[1] == pytest.approx(2.0 + FARTHEST * 0.1)


def test_one_step_goes_all_along_the_hyperbola() -> None:
    """Of a mass that is known from its product, to a thousandth as well; a straight one misses."""

    def residual(theta: np.ndarray) -> np.ndarray:
        return np.array([1e3 * (theta[0] * theta[1] - 1.0), theta[0] - 1.5])

    before = np.array([0.5, 2.0])
    slope = np.array([[1e3 * before[1], 1e3 * before[0]], [1.0, 0.0]])
    step = -np.linalg.solve(slope, residual(before))
    assert np.abs(residual(before + step)).max() > 1e3
    # rounding of 1e3 times a product
    assert np.abs(residual(stepped(before, step, [(1, 0)]))).max() < 1e-9


def test_a_payloads_place_is_multiplied_with_its_mass() -> None:
    """Each coordinate; nothing of the declared system is."""
    problem = declared(RIG, default_provider())
    assert pairs(problem) == []
    (payload,) = (c for c in candidates(problem) if c.effect == "payload")
    loaded = payload.added_to(problem)
    found = {loaded.names[i]: loaded.names[k] for i, k in pairs(loaded)}
    prefix = "crawler.body.payload."
    assert found == {f"{prefix}position[{i}]": f"{prefix}mass" for i in (1, 2, 3)}
    held = loaded.hold({f"{prefix}mass": 1.0})
    assert pairs(held) == []
