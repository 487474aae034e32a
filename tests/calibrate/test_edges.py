"""Steps that end at bounds, and information that only rounding pretends."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from cosim.calibrate.descent import Descent
from cosim.calibrate.weak import confirmed

# two nearly collinear columns, and a third one that both share something with
MATRIX = np.array([[1.0, 0.99, 0.2], [0.0, 0.1, 0.3], [0.0, 0.0, 1.0], [0.3, 0.31, 0.0]]) * 100.0


def descent(target: np.ndarray, bound: float) -> tuple[Descent, SimpleNamespace]:
    """A point at 0 in a linear problem with residual `target`, values within +-bound."""
    run = Descent.__new__(Descent)
    run.problem = SimpleNamespace(  # type: ignore[assignment]
        lower=np.full(3, -bound), upper=np.full(3, bound), scale=np.ones(3), nominal=np.zeros(3)
    )
    run.theta, run.drawn = np.zeros(3), np.zeros(3, dtype=bool)
    run.products = []
    return run, SimpleNamespace(matrix=MATRIX.T @ MATRIX, gradient=MATRIX.T @ target)


def cost(theta: np.ndarray, target: np.ndarray) -> float:
    return 0.5 * float(np.sum((target - MATRIX @ theta) ** 2))


def test_a_step_that_meets_a_bound_moves_the_others_to_where_that_leaves_the_minimum() -> None:
    target = MATRIX @ np.array([3.0, -2.5, 0.2])
    run, normal = descent(target, 1.0)
    found = run.step(normal, 0.0)
    best = lsq_linear(MATRIX, target, (-1.0, 1.0), tol=1e-14).x
    free = np.linalg.solve(normal.matrix, normal.gradient)
    clipped = np.clip(free, -1.0, 1.0)
    # the ridge of the step moves the minimum by 1e-9 of it
    assert found == pytest.approx(best, abs=1e-6)
    assert cost(found, target) < 0.5 * cost(clipped, target)
    assert run.promised == pytest.approx(cost(np.zeros(3), target) - cost(found, target), rel=1e-6)


def test_a_step_that_meets_none_is_the_newton_step() -> None:
    wanted = np.array([0.3, -0.5, 0.2])
    run, normal = descent(MATRIX @ wanted, 1.0)
    # the ridge of the step moves the minimum by 1e-9 of it
    assert run.step(normal, 0.0) == pytest.approx(wanted, abs=1e-6)


def linear(matrix: np.ndarray) -> SimpleNamespace:
    """A fit at 0 of a model that is linear with this matrix."""
    size = matrix.shape[1]
    item = SimpleNamespace(run="", prior=None)
    slopes = SimpleNamespace(columns=np.arange(size), values=matrix[:, None, :])
    problem = SimpleNamespace(
        lower=np.full(size, -1.0), upper=np.full(size, 1.0), scale=np.ones(size),
        parameters=[item] * size,
    )  # fmt: skip
    simulator = SimpleNamespace(
        residuals=lambda theta, purpose: [("run", -(matrix @ theta)[:, None])]
    )
    return SimpleNamespace(
        problem=problem, simulator=simulator, theta=np.zeros(size),
        residuals=[("run", np.zeros((len(matrix), 1)))],
        purpose="identification", jacobian=[slopes], open=[],
    )  # fmt: skip


def test_what_a_long_step_does_not_show_is_no_information() -> None:
    """Both columns are the same: only rounding makes their difference look known."""
    run = linear(np.array([[1e4, 1e4], [1e4, 1e4]]))
    vectors = np.array([[1.0, 1.0], [-1.0, 1.0]]) / np.sqrt(2.0)
    found, _ = confirmed(run, np.array([100.0, 4e8]), vectors)
    assert found[0] < 1e-12
    assert np.isinf(found[1])  # not weak: not measured


def test_what_a_long_step_shows_stays() -> None:
    run = linear(np.diag([10.0, 2e4]))
    found, _ = confirmed(run, np.array([100.0, 4e8]), np.eye(2))
    # exact in a linear model, but for rounding
    assert found[0] == pytest.approx(100.0, rel=1e-9)


def test_a_direction_that_rounding_has_turned_is_judged_by_what_no_other_can_undo() -> None:
    run = linear(np.array([[1e4, 1e4], [1e4, 1e4]]))
    turn = 1e-3  # towards the direction with information 4e8: it would count as 400
    vectors = np.array([[1.0, 1.0], [-1.0, 1.0]]) / np.sqrt(2.0)
    turned = vectors @ np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    found, back = confirmed(run, np.array([100.0, 4e8]), turned)
    # 1 % of the contamination: Jacobian and information differ by the turn's square
    assert found[0] < 4.0
    # turned back but for the square of the turn
    assert back[:, 0] == pytest.approx(vectors[:, 0], abs=1e-5)


def test_a_point_that_rounds_past_a_bound_is_tried_at_the_bound() -> None:
    run = Descent.__new__(Descent)
    run.problem = SimpleNamespace(  # type: ignore[assignment]
        lower=np.zeros(1), upper=np.array([0.3])
    )
    run.simulator = SimpleNamespace(  # type: ignore[assignment]
        residuals=lambda theta, purpose: [theta]
    )
    run.purpose, run.theta, run.cost = "identification", np.array([0.1]), 1.0
    run.total = lambda theta, residuals: 0.0  # type: ignore[method-assign]
    assert run.attempt(np.nextafter(run.problem.upper, 1.0))
    assert run.theta[0] == 0.3
