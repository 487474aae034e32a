"""What an absent effect is spared: its law is not computed, and nothing else changes."""

from __future__ import annotations

import ctypes
import math
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from sources.packaging import native
from sources.packaging.c_code import Wanted, Writer
from sources.packaging.guards import chunks
from sources.packaging.platforms import PLATFORMS, host_platform

WRAPPER = """
#include <math.h>
#include "trigonometry.c"
{code}
__attribute__((visibility("default"))) void law(const double *x, const double *p, double *y) {{
  double k[{kept} + 1];
  f_constants(p, k);
  f_law(x, p, k, y);
}}
"""
STRENGTHS = (1, 2)


def equations() -> ca.Function:
    """A model and two effects on it, of which one reads what the other does.

    The first cannot be computed below x = 0; beside it is a condition on a parameter alone.
    """
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p", 4)
    first = p[1] * ca.sin(x[1]) * ca.log(x[0])
    second = p[2] * ca.tanh(ca.cos(x[1]) + first)
    late = ca.if_else(p[3] > 0, ca.sqrt(x[0]) / p[3], 0.0)
    y = p[0] * x[0] + first + second + late
    slope = ca.jacobian(y, x)
    return ca.Function("f_law", [x, p], [ca.vertcat(y, slope.T)])


@pytest.fixture(scope="module")
def law(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    writer = Writer(strengths=STRENGTHS)
    code = writer.write(Wanted(equations(), ("x", "p"), (("y", None),)))
    text = WRAPPER.format(code=code + writer.constants(), kept=writer.kept)
    trigonometry = (native.C_SOURCES / "trigonometry.c").read_text(encoding="utf-8")
    files = {"law.c": text, "trigonometry.c": trigonometry}
    path: Path = tmp_path_factory.mktemp("law") / f"law{PLATFORMS[host_platform()].suffix}"
    path.write_bytes(native.compile_c(files, "law.c", "law", host_platform()))
    return ctypes.CDLL(str(path))


def of_c(law: ctypes.CDLL, x: tuple[float, ...], p: tuple[float, ...]) -> np.ndarray:
    values = [np.array(x), np.array(p), np.empty(3)]
    law.law(*(ctypes.c_void_p(a.ctypes.data) for a in values))
    return values[2]


@pytest.mark.parametrize("late", [0.0, 2.0])
@pytest.mark.parametrize("second", [0.0, 0.3])
@pytest.mark.parametrize("first", [0.0, -0.7])
def test_laws_that_are_there_are_computed(
    law: ctypes.CDLL, first: float, second: float, late: float
) -> None:
    x, p = (1.7, 0.4), (3.0, first, second, late)
    expected = np.array(equations()(x, p)).ravel()
    # sine and cosine are the project's own, a unit in the last place beside those of casadi
    np.testing.assert_allclose(of_c(law, x, p), expected, rtol=1e-15, atol=1e-15)


def test_what_an_absent_effect_cannot_compute_disturbs_nobody(law: ctypes.CDLL) -> None:
    """log(-1) times a strength of 0, and the root of -1 behind a condition that does not hold."""
    x = (-1.0, 0.4)
    np.testing.assert_array_equal(of_c(law, x, (3.0, 0.0, 0.0, 0.0)), [-3.0, 3.0, 0.0])
    assert math.isfinite(of_c(law, x, (3.0, 0.0, 0.5, 0.0))[0])  # the other effect is there
    assert math.isnan(of_c(law, x, (3.0, 0.1, 0.0, 0.0))[0])  # it is there, and cannot be computed
    assert math.isnan(of_c(law, x, (3.0, 0.0, 0.0, 1.0))[0])


def test_values_of_one_guard_stand_together_behind_what_they_read() -> None:
    """Two laws that are declared in turns, and a sum that reads both."""
    of = {1: (), 2: (), 3: (1,), 4: (2,), 5: (3, 4), 6: (5,)}
    guard = {1: {8}, 2: {9}, 3: {8}, 4: {9}, 5: None, 6: {8}}
    found = chunks(
        list(of), lambda n: None if guard[n] is None else frozenset(guard[n]), of.__getitem__
    )
    assert [chunk.numbers for chunk in found] == [(1, 3), (2, 4), (5,), (6,)]
