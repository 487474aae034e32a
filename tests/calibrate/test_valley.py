"""Intervals along valleys that poor derivatives do not show, and derivatives beside jumps."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from cosim.calibrate.broyden import Broyden
from cosim.calibrate.descent import Descent
from cosim.calibrate.differences import jacobian
from cosim.calibrate.felt import felt
from cosim.calibrate.loss import Squares
from cosim.calibrate.making_up import PATIENT, made_up
from cosim.calibrate.normal import Normal
from cosim.calibrate.parts import Sensitivity
from cosim.calibrate.problem import Problem
from cosim.calibrate.simulator import Simulator
from cosim.calibrate.valley import profiled
from tests.problems import simulator

Vector = NDArray[np.float64]
RANDOM = np.random.default_rng(8)
TRUE = RANDOM.standard_normal((400, 3)) * np.array([300.0, 300.0, 30.0])
WRONG = RANDOM.standard_normal((400, 3)) * np.array([40.0, 40.0, 1.0])
"""Of derivatives, as the ticks at which something sticks make it: a tenth of them."""


def at_minimum(matrix: np.ndarray) -> Descent:
    """A fit at 0 of a model that is linear with a matrix, its derivatives wrong by a tenth."""
    parameters = [SimpleNamespace(run="", prior=None, role="declared") for _ in range(3)]
    times = np.linspace(0.0, 10.0, len(matrix))
    run = Descent.__new__(Descent)
    run.problem = SimpleNamespace(  # type: ignore[assignment]
        lower=np.full(3, -1.0), upper=np.full(3, 0.5), scale=np.ones(3), nominal=np.zeros(3),
        parameters=parameters, run=lambda name: SimpleNamespace(times=times),
    )  # fmt: skip
    run.simulator = SimpleNamespace(  # type: ignore[assignment]
        residuals=lambda theta, purpose: [("run", -(matrix @ theta)[:, None])]
    )
    run.theta, run.purpose, run.loss = np.zeros(3), "identification", Squares()
    run.drawn = np.zeros(3, dtype=bool)
    run.residuals, run.cost = [("run", np.zeros((len(matrix), 1)))], 0.0
    values = (matrix + WRONG)[:, None, :]
    run.jacobian = [Sensitivity("run", np.arange(3), values, None)]
    return run


def deviations(run: Descent) -> tuple[np.ndarray, np.ndarray]:
    """Standard deviations by the derivatives, and with the parameters moved."""
    normal = Normal(run.problem, run.theta, run.jacobian, run.residuals)
    covariance = np.linalg.inv(normal.matrix)
    found = profiled(run, covariance, np.eye(len(covariance)))
    return np.sqrt(np.diag(covariance)), np.sqrt(np.diag(found))


def test_a_valley_is_followed_though_derivatives_show_none() -> None:
    """The first two act together, 1 to 0.3: only wrong derivatives tell them apart."""
    matrix = TRUE.copy()
    matrix[:, 1] = -matrix[:, 0] / 0.3
    claimed, found = deviations(at_minimum(matrix))
    assert claimed[0] < 0.003
    # open up to the bound one span away, which counts as two deviations
    assert found[0] == pytest.approx(0.5, rel=0.05)
    assert found[1] == pytest.approx(0.15, rel=0.05)
    # the third has nothing to do with it
    assert found[2] == pytest.approx(claimed[2], rel=0.05)


def test_what_the_data_tell_stays_told() -> None:
    claimed, found = deviations(at_minimum(TRUE))
    # a tenth is the error of the derivatives
    assert found == pytest.approx(claimed, rel=0.1)
    truth = np.sqrt(np.diag(np.linalg.inv(TRUE.T @ TRUE)))
    assert found == pytest.approx(truth, rel=0.2)


def counted(run: Descent, jump: float) -> int:
    """Simulations that following the first parameter takes where all but the minimum may jump."""
    simulate, seen = run.simulator.residuals, []

    def residuals(theta: Vector, purpose: str) -> list[tuple[str, Vector]]:
        seen.append(theta)
        ((name, rows),) = simulate(theta, purpose)
        return [(name, rows + jump * (-1.0) ** len(seen))]

    run.simulator.residuals = residuals  # type: ignore[method-assign, assignment]
    normal = Normal(run.problem, run.theta, run.jacobian, run.residuals)
    slopes = Broyden(run.problem, run.jacobian, run.loss)
    change = np.array([2.0 / math.sqrt(normal.matrix[0, 0]), 0.0, 0.0])
    made_up(run, slopes, 0, change)
    return len(seen)


def test_what_has_gone_astray_beside_jumps_is_given_up() -> None:
    """A jump of 3 sigma in all samples costs 1800 nats whatever the others do."""
    assert counted(at_minimum(TRUE), 3.0) <= 2 + PATIENT


def test_small_jumps_are_borne() -> None:
    """The twin: one of 0.4 sigma costs 32 nats, from which the others may come back."""
    assert counted(at_minimum(TRUE), 0.4) > 2 + PATIENT


def jumping(
    short: Problem,
    monkeypatch: pytest.MonkeyPatch,
    jumps: float,
    limit: float = np.inf,
    little: float = 0.0,
) -> list[Vector]:
    """Information on two directions of two parameters: by the Jacobian, and by steps felt alike.

    The model is linear and the parameters act together: hardly anything changes when they differ.

    Args:
        short, monkeypatch: of the test.
        jumps: RMS over the noise of what each change of parameters changes besides.
        limit: sum of the parameters' changes [spans] from which twice the noise is added.
        little: RMS over the noise of what a span of their difference changes.
    """
    run = short.chosen("identification")[0]
    theta = short.nominal
    columns = sorted([short.index("K_t"), short.index("R_a")])
    span = short.scale[columns]
    shape = np.random.default_rng(1).standard_normal(run.data.shape)
    shape[::2] = 0.0  # there it only jumps: what turns directions is not what this is about
    random = np.random.default_rng(2)
    faint = np.where(shape == 0.0, 0.0, random.standard_normal(shape.shape))

    def simulate(self: Simulator, values: Vector, run: object) -> Vector:
        moved = (values[columns] - theta[columns]) / span
        away, other = float(np.sum(moved)), float(moved[0] - moved[1])
        scatter = random.standard_normal(shape.shape) * (shape == 0.0) * np.any(values != theta)
        steep = shape * (20.0 * away + 2.0 * (away > limit)) + little * faint * other
        return (steep + jumps * scatter) * short.sigma

    monkeypatch.setattr(Simulator, "simulate", simulate)
    found = jacobian(simulator(short), theta, [run.name], columns=columns, relative=1e-2)[0]
    told = []
    for _ in range(3):
        flat = (found.values * span).reshape(-1, 2)
        told.append(np.linalg.eigvalsh(flat.T @ flat) / (2.0 * float(np.sum((20.0 * shape) ** 2))))
        (found,) = felt(simulator(short), theta, [found], {run.name})
    return told


def test_jumps_are_little_of_what_steps_felt_alike_show(
    short: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    by_span, once, twice = jumping(short, monkeypatch, 0.03)
    # squares of 0.03 of noise on both sides of 0.01 spans are 4.5, of 2 * 20^2
    assert by_span[0] == pytest.approx(4.5 / 800.0, rel=0.05)
    # what no longer step changes by more than jumps do changes nothing
    assert (once[0], twice[0]) == pytest.approx((0.0, 0.0), abs=1e-12)
    # over 0.3 of noise jumps are a tenth, whose square is taken as information
    assert twice[1] == pytest.approx(1.0, rel=0.02)


def test_what_little_is_told_beside_no_jumps_stays_told(
    short: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The twin: a step of which more is seen than jumps leave counts."""
    by_span, _, twice = jumping(short, monkeypatch, 0.2)
    # 0.2 of noise over 0.1 spans is beyond what sticking leaves: it counts, a hundredth of before
    assert 0.0 < twice[0] < 0.02 * by_span[0]


def test_what_both_sides_agree_on_is_told_however_little_it_is(
    short: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Over the longest step it changes less than jumps do, and there are none."""
    little = 0.2  # 0.02 of the noise over a tenth of a span: STUCK is 0.05
    for told in jumping(short, monkeypatch, 0.0, little=little):
        # in proportion to the steep direction; 5 %: by chance one shape is a little larger
        assert told[0] == pytest.approx((little / 20.0) ** 2, rel=0.05)


def test_what_jumps_hide_is_not_told(short: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    """The twin: as little, beside jumps that are larger."""
    _, once, twice = jumping(short, monkeypatch, 0.04, little=0.2)
    assert (once[0], twice[0]) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_without_jumps_steps_felt_alike_change_nothing(
    short: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    for told in jumping(short, monkeypatch, 0.0):
        # the model is linear: rounding is left
        assert told == pytest.approx([0.0, 1.0], abs=1e-9)


@pytest.mark.parametrize("limit", [0.004, -0.004])
def test_beside_a_limit_the_other_side_counts(
    short: Problem, monkeypatch: pytest.MonkeyPatch, limit: float
) -> None:
    """A step up to the limit changes half as much as the limit does: no derivative."""
    _, once, twice = jumping(short, monkeypatch, 0.0, limit)
    # exact: the model is linear on the side without the limit
    assert once == pytest.approx([0.0, 1.0], abs=1e-9)
    assert twice == pytest.approx([0.0, 1.0], abs=1e-9)


@pytest.mark.parametrize("jumps", [0.0, 0.03])
def test_what_a_run_alone_has_follows_the_common_parameters(
    short: Problem, monkeypatch: pytest.MonkeyPatch, jumps: float
) -> None:
    """A start value makes up for half of what a common parameter does, in this run only."""
    own = replace(short.parameters[0], name="start", role="nuisance", run="sines")
    problem = short.with_parameters([*short.parameters[:2], own])
    run, theta = problem.run("sines"), problem.nominal
    slopes = np.random.default_rng(4).standard_normal((3, *run.data.shape))
    slopes[2] += slopes[0]
    random = np.random.default_rng(5)

    def simulate(self: Simulator, values: Vector, run: object) -> Vector:
        away = (values - theta) / problem.scale
        scatter = random.standard_normal(run_shape) * np.any(values != theta)
        return (np.tensordot(away, slopes, 1) + jumps * scatter) * problem.sigma

    run_shape = run.data.shape
    monkeypatch.setattr(Simulator, "simulate", simulate)
    found = jacobian(simulator(problem), theta, ["sines"], relative=1e-2)
    for _ in range(2):
        found = felt(simulator(problem), theta, found, {"sines"})
    told = np.moveaxis(found[0].values * problem.scale, 2, 0)
    errors = [np.sqrt(np.mean((a - b) ** 2)) for a, b in zip(told, slopes, strict=True)]
    # jumps of 0.03 on both sides of steps of 0.1 spans leave 0.2; exact without
    assert errors == pytest.approx([0.0, 0.0, 0.0], abs=0.4 if jumps else 1e-6)
