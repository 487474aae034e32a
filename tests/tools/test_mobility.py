"""The five types of wheeled robots and their admissible velocities."""

from __future__ import annotations

import numpy as np
import pytest

from sources.tools.mobility import TYPES, Wheel, admissible_velocities, classify

L = 0.4
PI = np.pi
AXLE = [Wheel("fixed", L, 0.0), Wheel("fixed", L, PI)]
CASES = {
    (3, 0): [Wheel("caster", L, a) for a in (0.0, 2.1, 4.2)],
    (2, 0): [*AXLE, Wheel("caster", L, 1.5 * PI)],
    (2, 1): [Wheel("steerable", 0.0, 0.0), Wheel("caster", L, 2.0), Wheel("caster", L, 4.0)],
    (1, 1): [*AXLE, Wheel("steerable", L, 1.5 * PI)],
    (1, 2): [Wheel("steerable", L, 0.0), Wheel("steerable", L, PI), Wheel("caster", L, 1.5 * PI)],
}


def sigma(kind: tuple[int, int], beta: tuple[float, ...]) -> np.ndarray:
    """Admissible velocities, as the omnidirectional base paper lists them."""
    if kind == (3, 0):
        return np.eye(3)
    if kind == (2, 0):
        return np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]).T
    if kind == (2, 1):
        return np.array([[-np.sin(beta[0]), np.cos(beta[0]), 0.0], [0.0, 0.0, 1.0]]).T
    if kind == (1, 1):
        return np.array([[0.0, L * np.sin(beta[0]), np.cos(beta[0])]]).T
    b1, b2 = beta  # last element: sin(b2 - b1), printed as sin(b1 - b2)
    return np.array([[-2 * L * np.sin(b1) * np.sin(b2), L * np.sin(b1 + b2), np.sin(b2 - b1)]]).T


@pytest.mark.parametrize("kind", TYPES)
def test_five_types(kind: tuple[int, int]) -> None:
    mobility = classify(CASES[kind])
    assert (mobility.delta_m, mobility.delta_s) == kind
    assert sum(kind) == mobility.delta_M


@pytest.mark.parametrize("kind", TYPES)
def test_admissible_velocities(kind: tuple[int, int]) -> None:
    for beta in ((0.3, 1.1), (-0.8, 2.0)):
        angles = beta[: sum(w.kind == "steerable" for w in CASES[kind])]
        found, listed = admissible_velocities(CASES[kind], angles), sigma(kind, angles)
        assert found.shape == (3, kind[0]) == listed.shape
        # the listed columns lie in the found space: rounding
        outside = listed - found @ (found.T @ listed)
        assert np.abs(outside).max() < 1e-12


def test_a_third_steerable_wheel_follows_the_other_two() -> None:
    wheels = [Wheel("steerable", L, a) for a in (0.0, 2.1, 4.2)]
    assert (classify(wheels).delta_m, classify(wheels).delta_s) == (1, 2)


def test_fixed_wheels_on_two_axles_are_refused() -> None:
    with pytest.raises(ValueError, match="rank 2"):
        classify([*AXLE, Wheel("fixed", L, 1.0, 0.5)])
