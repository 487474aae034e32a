"""Frame calibration recovers known transforms; least squares beats three points under noise."""

from __future__ import annotations

import numpy as np
import pytest

from sources.tools.frame_calibration import kabsch, three_point

POINTS = np.array([[0.0, 0.0, 0.0], [2.0, 0.3, 0.1], [0.6, 1.8, -0.2]])


def known(rng: np.random.Generator) -> np.ndarray:
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    transform = np.eye(4)
    transform[:3, :3] = q * np.sign(np.linalg.det(q))
    transform[:3, 3] = rng.normal(size=3)
    return transform


def moved(transform: np.ndarray, points: np.ndarray) -> np.ndarray:
    size = points.shape[1]
    return points @ transform[:size, :size].T + transform[:size, size]


def test_both_recover_a_known_transform() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        transform = known(rng)
        reference = moved(transform, POINTS)
        # rounding of points of some metres
        np.testing.assert_allclose(three_point(POINTS, reference), transform, atol=1e-14)
        np.testing.assert_allclose(kabsch(POINTS, reference), transform, atol=1e-14)


def test_planar_least_squares() -> None:
    angle, points = 2.4, POINTS[:, :2]
    transform = np.array(
        [[np.cos(angle), -np.sin(angle), 0.3], [np.sin(angle), np.cos(angle), -1.0], [0, 0, 1]]
    )
    np.testing.assert_allclose(kabsch(points, moved(transform, points)), transform, atol=1e-14)


@pytest.mark.slow
def test_least_squares_beats_three_points_under_noise() -> None:
    rng = np.random.default_rng(2)
    triangle = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 2.0, 0.0]])
    errors = {three_point: [], kabsch: []}
    for _ in range(2000):
        noisy = triangle + np.column_stack([0.010 * rng.normal(size=(3, 2)), np.zeros(3)])
        reference = triangle + np.column_stack([0.0005 * rng.normal(size=(3, 2)), np.zeros(3)])
        for method, found in errors.items():
            transform = method(noisy, reference)
            found.append(np.arctan2(transform[1, 0], transform[0, 0]))
    spread = {method: float(np.std(found)) for method, found in errors.items()}
    # 10 mm at both ends of 2 m: sqrt(2) 10/2000 = 7.1 mrad; 2000 draws give 1.6 percent
    assert spread[three_point] == pytest.approx(7.1e-3, rel=0.06)
    assert spread[kabsch] < 0.85 * spread[three_point]


def test_refuses_what_defines_no_frame() -> None:
    line = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]])
    with pytest.raises(ValueError, match="one line"):
        three_point(line, line)
    with pytest.raises(ValueError, match="2 points"):
        kabsch(POINTS[:2], POINTS[:2])
    with pytest.raises(ValueError, match="shapes"):
        kabsch(POINTS, POINTS[:2])


@pytest.mark.parametrize(
    "points",
    [
        [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]],
        [[0, 0, 0], [1, 1, 1], [2, 2, 2 + 1e-12]],
        [[1, 1], [1, 1]],
        [[0, 0], [1, float("nan")], [2, 0]],
    ],
    ids=["line", "rounded line", "one place", "nan"],
)
def test_points_that_define_no_rotation_are_refused(points: list[list[float]]) -> None:
    with pytest.raises(ValueError, match=r"no rotation|not finite"):
        kabsch(points, points)


def test_points_on_a_line_define_a_rotation_of_the_plane() -> None:
    line = np.array([[0.0, 0.0], [1.0, 2.0], [2.0, 4.0]])
    np.testing.assert_allclose(kabsch(line, line), np.eye(3), atol=1e-14)  # rounding
