"""Intervals along valleys that poor derivatives do not show, and derivatives beside jumps."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from cosim.calibrate.descent import Descent
from cosim.calibrate.differences import jacobian, smoothest
from cosim.calibrate.loss import Squares
from cosim.calibrate.normal import Normal
from cosim.calibrate.parts import Sensitivity
from cosim.calibrate.problem import Problem
from cosim.calibrate.simulator import Simulator
from cosim.calibrate.valley import profiled
from tests.problems import simulator

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
    found = profiled(run, normal, covariance, np.eye(3))
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


@pytest.mark.parametrize("edge", [0.004, 5e-5, 0.5])
def test_derivatives_beside_a_jump_come_from_a_finer_step(
    short: Problem, monkeypatch: pytest.MonkeyPatch, edge: float
) -> None:
    """It lies `edge` spans away: inside a step of a hundredth, of any that is tried, or outside."""
    run = short.chosen("identification")[0]
    theta = short.nominal
    place, span = short.index("K_t"), short.scale[short.index("K_t")]
    slope, steps = 50.0, []

    def simulate(self: Simulator, values: np.ndarray, run: object) -> np.ndarray:
        away = (values[place] - theta[place]) / span
        steps.append(abs(away))
        rows = slope * away + (100.0 if away > edge else 0.0)
        return np.full(data.shape, rows) * self.problem.sigma

    data = run.data
    monkeypatch.setattr(Simulator, "simulate", simulate)
    coarse = jacobian(simulator(short), theta, [run.name], columns=[place], relative=1e-2)
    found = smoothest(simulator(short), theta, coarse)
    assert found[0].columns.tolist() == [place]
    told = float(np.nanmax(found[0].values[:, :, 0])) * span
    # exact: the model is linear on both sides of the jump
    assert told == pytest.approx(slope, rel=1e-9)
    assert (found[0] is coarse[0]) is (edge == 0.5)
    finest = {0.004: 1e-3, 5e-5: 1e-4, 0.5: 1e-2}
    assert min(s for s in steps if s) == pytest.approx(finest[edge])
