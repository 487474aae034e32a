"""Pivot torques of the omnidirectional base paper: what its formulas and numbers give."""

from __future__ import annotations

import numpy as np
import pytest

from sources.tools.pivot import (
    area_moment,
    edge_moment,
    footprint_length,
    line_moment,
    mass_for_coefficient,
    rolling_coefficient,
    saturated_moment,
)

MU, LOAD, WIDTH = 0.35, 250 * 9.81 / 3, 0.040
PRINTED = 0.0282
SUNK = footprint_length(0.100, LOAD / 340_000)


def test_footprint() -> None:
    assert pytest.approx(0.0436, abs=5e-5) == SUNK
    # the printed 28.2 mm belong to a deflection of 1.0 mm, not to the printed 2.4 mm
    assert footprint_length(0.100, 1.0e-3) == pytest.approx(PRINTED, abs=1e-4)


@pytest.mark.parametrize(
    ("length", "line", "area", "uniform", "edge"),
    [(PRINTED, 1.51, 3.46, 3.77, 4.03), (SUNK, 2.34, 4.01, 4.58, 6.24)],
)
def test_table_of_moments(
    length: float, line: float, area: float, uniform: float, edge: float
) -> None:
    got = (
        line_moment(MU, LOAD, length),
        area_moment(MU, LOAD, length, WIDTH),
        area_moment(MU, LOAD, length, WIDTH, "uniform"),
        edge_moment(MU, LOAD, length),
    )
    np.testing.assert_allclose(got, (line, area, uniform, edge), atol=5.1e-3)  # two decimals


def test_the_printed_six_newton_metres_are_not_the_printed_formula() -> None:
    # what does give 6 N.m: the whole weight on one wheel, or arms from the edge of the patch
    assert line_moment(MU, LOAD, PRINTED) < 2.0
    assert pytest.approx(6.05, abs=5e-3) == MU * 3 * LOAD * PRINTED / 4
    assert edge_moment(MU, LOAD, SUNK) == pytest.approx(6.24, abs=5e-3)


def test_area_moment_against_a_plain_sum() -> None:
    n = 400
    x, y = ((np.arange(n) + 0.5) / n - 0.5 for _ in range(2))
    pressure = 1.5 * (1 - (2 * x[:, None]) ** 2)
    arm = np.hypot(x[:, None] * PRINTED, y[None, :] * WIDTH)
    plain = MU * LOAD * np.mean(pressure * arm)
    # midpoint sum with a kink in the middle
    assert area_moment(MU, LOAD, PRINTED, WIDTH) == pytest.approx(plain, rel=1e-4)
    # a narrow patch is the line
    narrow = area_moment(MU, LOAD, PRINTED, 1e-6)
    assert narrow == pytest.approx(line_moment(MU, LOAD, PRINTED), rel=1e-4)


def test_exponent_of_k_res() -> None:
    for exponent, k, mass in ((2.5, 1.041, 84.9), (5 / 3, 0.954, 90.3), (3.0, 1.097, 83.15)):
        assert rolling_coefficient(250 / 3, exponent) == pytest.approx(k, abs=5e-4)
        assert mass_for_coefficient(1.09, exponent) == pytest.approx(mass, abs=0.05)
    # the printed 1.09 is p = 5/2 at 85 kg
    assert round(rolling_coefficient(85.0), 2) == 1.09


def test_saturated_moment() -> None:
    assert saturated_moment(1.0, 6.0, 0.3, 1.0) == pytest.approx(-0.3, rel=2e-3)  # K w/v
    assert saturated_moment(1.0, 6.0, 50.0, 0.0) == pytest.approx(-6.0, rel=1e-3)  # M_pa
    for spin in (-2.0, 0.0, 0.7):
        assert saturated_moment(1.0, 6.0, spin, 0.3) * spin <= 0.0
    # in the paper's unit, N.cm2, the law would never come near M_pa: 1.1e-4 N.m at 1 1/m
    assert abs(saturated_moment(1.09e-4, 6.0, 1.0, 1.0)) == pytest.approx(1.09e-4, rel=1e-6)
