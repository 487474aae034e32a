"""Derivatives that learn from steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.calibrate.broyden import Broyden
from cosim.calibrate.felt import SHORTEST
from cosim.calibrate.loss import Squares
from cosim.calibrate.parts import Sensitivity
from cosim.calibrate.problem import Problem

RANDOM = np.random.default_rng(2)


@pytest.mark.parametrize(("length", "learns"), [(2.0, True), (0.5, False)])
def test_what_a_long_step_changed_is_known_and_nothing_else(
    short: Problem, length: float, learns: bool
) -> None:
    """Two parameters that undo each other, and derivatives that claim to tell them apart."""
    run = replace(short.chosen("identification")[0])
    columns = np.array([0, 1])
    scale = short.scale[columns]
    one = RANDOM.standard_normal(run.data.shape)
    true = np.stack([one, -one], axis=2) / scale
    wrong = 0.1 * RANDOM.standard_normal(true.shape) / scale
    rough = 0.02 * RANDOM.standard_normal(true.shape) / scale
    slopes = Broyden(short, [Sensitivity(run.name, columns, true + wrong, rough)], Squares())
    step = np.zeros(short.nominal.size)
    step[columns] = length * SHORTEST * scale  # along what changes nothing
    residuals = [(run.name, np.zeros(run.data.shape))]
    slopes.learn(step, residuals, residuals)
    matrix = slopes.normal(short.nominal, residuals).matrix[:2, :2]
    valley, across = np.array([1.0, 1.0]), np.array([1.0, -1.0])
    whole = float(np.sum((true @ (scale * across)) ** 2))
    # what learning takes off across is what was wrong of it: 0.1 of noise in 2
    assert across @ matrix @ across == pytest.approx(whole, rel=0.1)
    if learns:
        assert valley @ matrix @ valley == pytest.approx(0.0, abs=1e-9 * whole)
    else:
        assert valley @ matrix @ valley > 1e-3 * whole
