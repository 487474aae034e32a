"""The functions and the regression of laws from data, on arrays."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest
from scipy.linalg import eigh

from cosim.diagnose.grey_box.basis import ALONG_X, ALONG_Y, Axis, Shape
from cosim.diagnose.grey_box.regression import Gram, Regression, regress, solved
from cosim.diagnose.grey_box.trial import Law, Trial
from cosim.diagnose.models import Fitted
from sources.function import Oracle
from sources.variant import build_model

SPEED = Axis("velocity", -6.0, 5.0, scale=0.6, jump=5e-3)
ANGLE = Axis("angle", 0.0, 2.0 * np.pi, turn=True)
LOAD = Axis("load", -1.0, 2.0)
SAMPLES, NOISE = 600, 0.1


@pytest.mark.parametrize("second", [ANGLE, LOAD], ids=["a circle", "a range"])
def test_the_functions_are_those_of_the_effect(second: Axis) -> None:
    random = np.random.default_rng(1)
    oracle = Oracle(build_model("inertia/disc+fitted_law@flange"))
    shape = Shape("x * y", SPEED, second)
    coefficients = random.standard_normal((ALONG_X + 1) * ALONG_Y)
    signals = {"velocity": "speed", "angle": "angle", "load": "tau"}
    law = {
        "wx_velocity": 1.0, f"wy_{second.signal}": 1.0, "x_first": SPEED.first,
        "x_last": SPEED.last, "x_scale": SPEED.scale, "x_0": SPEED.jump, "y_first": second.first,
        "y_last": second.last, "turn": float(second.turn),
    }  # fmt: skip
    law |= {f"c[{i + 1}]": value for i, value in enumerate(coefficients.tolist())}
    values = {f"flange.fitted_law.{name}": value for name, value in law.items()}
    # beyond the knots too, where the law is held
    for x, y in random.uniform([-8.0, -9.0], [8.0, 9.0], (20, 2)):
        own = oracle.outputs(values | {"speed": x, signals[second.signal]: y})
        expected = shape.design(np.array([x]), np.array([y])) @ coefficients
        # 104 products of size 1: rounding
        assert own["flange.fitted_law.u"] == pytest.approx(expected[0], abs=1e-12)


@pytest.mark.parametrize("form", ["x", "y", "x * y"])
def test_a_narrow_form_is_a_case_of_the_surface(form: str) -> None:
    shape = Shape(form, SPEED if "x" in form else None, ANGLE if "y" in form else None)
    random = np.random.default_rng(2)
    x, y = random.uniform(-6.0, 5.0, 30), random.uniform(-9.0, 9.0, 30)
    free = random.standard_normal(shape.expansion.shape[1])
    if form == "y":  # x is nowhere, where its splines add up to 1
        surface = Shape("x * y", SPEED, ANGLE).design(np.zeros(30), y)
    else:
        surface = Shape("x * y", SPEED, ANGLE).design(x, y)
    # sums of 104 products: rounding
    assert surface @ shape.expansion @ free == pytest.approx(shape.design(x, y) @ free, abs=1e-12)


def grams(
    truth: np.ndarray, seed: int, only: int | None = None, noise: float = NOISE
) -> list[Gram]:
    """Three runs of a sensor that shows a law of speed as it is, beside a slope that is declared.

    Args:
        truth: values of the law where it is seen, by a function of speed.
        seed: of speeds and noise.
        only: run that has the law, all if not given.
        noise: of the sensor; its size is taken for `NOISE`.
    """
    random = np.random.default_rng(seed)
    found = []
    for run in range(3):
        speed = random.uniform(-6.0, 5.0, SAMPLES)
        law = SPEED.along_x(speed) @ truth * (only is None or only == run)
        rest = (law + noise * random.standard_normal(SAMPLES)) / NOISE
        table = np.column_stack([SPEED.along_x(speed) / NOISE, speed / NOISE, rest])
        found.append(Gram(f"{run}", table.T @ table, np.array([False]), SAMPLES))
    return found


def regressed(data: list[Gram], slope: float = 12.0) -> Regression:
    """The law, with a declared slope that is known to one over the root of this [noise]."""
    return regress(data, Shape("x", SPEED).penalties(), np.array([slope]))


TRUTH = np.concatenate([0.3 * np.sin(np.arange(ALONG_X)), [-0.4]])


def test_a_law_is_rebuilt_within_its_band() -> None:
    found = regressed(grams(TRUTH, 3), slope=1e8)
    assert found.evidence > 100.0 and found.expected > 100.0  # e^100 times as likely
    design = SPEED.along_x(np.linspace(-5.9, 4.9, 200))
    deviation = np.sqrt(np.einsum("ij,jk,ik->i", design, found.covariance, design))
    assert np.max(deviation) < 0.05  # an eighth of the law
    # a curve has about a dozen independent points: four standard deviations
    assert np.all(np.abs(design @ (found.value - TRUTH)) < 4.0 * deviation)


def test_a_declared_slope_that_may_be_the_law_widens_its_band() -> None:
    design = SPEED.along_x(np.array([4.0]))
    known, open_ = (
        (design @ regressed(grams(TRUTH, 3), slope).covariance @ design.T)[0, 0] ** 0.5
        for slope in (1e8, 1.0 / (NOISE * 5.0) ** 2)
    )
    assert open_ > 5.0 * known


def test_noise_is_no_law() -> None:
    found = regressed(grams(np.zeros(ALONG_X + 1), 4))
    # e^3: noise does that in one of twenty
    assert found.evidence < 3.0 and found.expected < 3.0


def test_what_one_run_has_alone_is_not_expected_of_others() -> None:
    assert regressed(grams(TRUTH, 5, only=1)).expected < 0.0


def test_a_difference_below_the_noise_is_not_none() -> None:
    """What two models do differently has no noise, so nothing of it is by chance."""
    known = regressed(grams(TRUTH, 3), slope=1e8).prior.law
    small = 0.05 * TRUTH
    data = grams(small, 6, noise=0.0)
    found = solved(data, known, np.array([1e8]))
    at = SPEED.along_x(np.linspace(-5.9, 4.9, 200))
    off, size = (float(np.sqrt(np.mean((at @ c) ** 2))) for c in (found - small, small))
    assert off < 0.3 * size  # 1800 samples at a tenth of the noise, beside a dozen numbers


class Posterior:
    """What a fit of some directions of a law says of them and of a declared slope."""

    def __init__(self, covariance: np.ndarray) -> None:
        self.covariance, self.theta = covariance, np.zeros(covariance.shape[0])
        self.free, self.estimate = self.theta.size, self


@pytest.mark.parametrize("kept", [0, 3, 8, ALONG_X + 1])
def test_what_was_not_fitted_of_a_law_counts_in_all_intervals(kept: int) -> None:
    """However many directions were fitted, intervals are those of the whole law."""
    data = grams(TRUTH, 3)
    found = regressed(data, 1.0 / (NOISE * 5.0) ** 2)
    values, vectors = eigh(found.matrix, found.prior.law)
    fitted, rest = vectors[:, kept:], vectors[:, :kept] / np.sqrt(1.0 + values[:kept])
    whole = np.sum([g.matrix for g in data], axis=0)[:-1, :-1] + found.prior.whole
    joint = np.sqrt(np.diag(np.linalg.inv(whole)))
    turn = np.zeros((whole.shape[0], 1 + fitted.shape[1]))
    turn[-1, 0], turn[:-1, 1:] = 1.0, fitted  # a model has its declared parameters first
    own = np.linalg.inv(turn.T @ whole @ turn)
    trial = Trial(Shape("x", SPEED), tuple(data), found, np.eye(ALONG_X + 1))
    law = Law(trial, cast("Fitted", Posterior(own)), fitted, rest)
    slope = np.hypot(np.sqrt(own[0, 0]), law.declared(np.ones(1)))
    # inverses of matrices of condition 1e7: rounding
    assert slope == pytest.approx(joint[-1:], rel=1e-6)
    assert law.spread(np.eye(ALONG_X + 1)) == pytest.approx(joint[:-1], rel=1e-6)
    if kept > 8:  # the slope was told by nothing that was fitted
        assert np.sqrt(own[0, 0]) < 0.2 * joint[-1]
