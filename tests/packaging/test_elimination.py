"""The unrolled elimination against numpy, and the Python twin's functions against C."""

from __future__ import annotations

import ctypes
import itertools
import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import casadi as ca
import numpy as np
import pytest

from sources.packaging import c_code, c_functions, native, runtime
from sources.packaging.elimination import Elimination, eliminate
from sources.packaging.platforms import PLATFORMS, host_platform


def run(elimination: Elimination, j: np.ndarray, d: float, b: np.ndarray) -> np.ndarray:
    w, b = np.zeros(elimination.size), b.copy()
    names = {"w": w, "j": j, "d": d, "b": b}
    for place, elements in elimination.asked.items():
        w[place] = any(j[list(elements)] != 0.0)
    for block in (*elimination.factor, *elimination.solve):
        if all(w[place] for place in block.flags):
            for statement in block.statements:
                exec(statement, {}, names)
    return b


def random_pattern(rng: np.random.Generator, n: int, density: float) -> list[tuple[int, int]]:
    return [
        (int(i), int(k)) for i, k in zip(*np.nonzero(rng.random((n, n)) < density), strict=True)
    ]


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 2, 5, 12, 30])
@pytest.mark.parametrize("density", [0.0, 0.1, 0.4, 1.0])
def test_solution_is_that_of_numpy(n: int, density: float) -> None:
    rng = np.random.default_rng(n)
    for _ in range(5):
        pattern = random_pattern(rng, n, density)
        elimination = eliminate(n, pattern)
        j = rng.normal(size=len(pattern))
        jacobian = np.zeros((n, n))
        for value, place in zip(j, pattern, strict=True):
            jacobian[place] = value
        d = 2.0 * n  # like 2/h of the solver: dominates the diagonal, so that no pivot is needed
        b = rng.normal(size=n)
        matrix = d * np.eye(n) - jacobian
        # rounding of some n^3 operations on a matrix of condition about 2
        np.testing.assert_allclose(
            run(elimination, j, d, b), np.linalg.solve(matrix, b), rtol=0, atol=1e-14
        )


def test_only_nonzeros_and_fill_are_stored() -> None:
    """An arrow that points to the end fills nothing, one that points to the start everything."""
    n = 8
    end = [(i, n - 1) for i in range(n)] + [(n - 1, i) for i in range(n - 1)]
    start = [(i, 0) for i in range(n)] + [(0, i) for i in range(1, n)]
    assert eliminate(n, end).size == 3 * n - 2
    assert eliminate(n, start).size == n * n


def test_states_appended_later_leave_every_rounding_alone() -> None:
    """Those of an effect of strength 0, coupled to nothing: bit for bit the same solution."""
    rng = np.random.default_rng(1)
    n, more = 6, 3
    pattern = random_pattern(rng, n, 0.5)
    j, b = rng.normal(size=len(pattern)), rng.normal(size=n)
    plain = run(eliminate(n, pattern), j, 20.0, b)
    extended = pattern + [(n + i, k) for i in range(more) for k in range(n)]
    extended += [(k, n + i) for i in range(more) for k in range(n)]
    values = np.concatenate([j, np.zeros(2 * more * n)])
    right = np.concatenate([b, rng.normal(size=more)])
    np.testing.assert_array_equal(
        run(eliminate(n + more, extended), values, 20.0, right)[:n], plain
    )


@pytest.mark.parametrize("there", [(), (1,), (2,), (1, 2)])
def test_states_of_absent_effects_cost_no_fill(there: tuple[int, ...]) -> None:
    """Two effects that fill the matrix between them: each is left out while it acts on nothing."""
    rng = np.random.default_rng(3)
    groups = [0, 0, 0, 1, 1, 2, 2]
    n = len(groups)
    pattern = [
        (i, k)
        for i, k in itertools.product(range(n), range(n))
        if 0 in (groups[i], groups[k]) or groups[i] == groups[k]
    ]
    j = rng.normal(size=len(pattern))
    jacobian = np.zeros((n, n))
    for place, (i, k) in enumerate(pattern):
        if groups[k] and groups[i] != groups[k] and groups[k] not in there:
            j[place] = 0.0
        jacobian[i, k] = j[place]
    b = rng.normal(size=n)
    elimination = eliminate(n, pattern, groups)
    found = run(elimination, j, 2.0 * n, b)
    # what is left out are products with zeros: not one bit is another
    np.testing.assert_array_equal(found, run(eliminate(n, pattern), j, 2.0 * n, b))
    # rounding of some n^3 operations on a matrix of condition about 2
    np.testing.assert_allclose(
        found, np.linalg.solve(2.0 * n * np.eye(n) - jacobian, b), rtol=0, atol=1e-14
    )
    assert any(len(block.flags) == 2 for block in elimination.factor)  # between the effects


def test_a_singular_matrix_gives_no_finite_solution() -> None:
    with np.errstate(divide="ignore", invalid="ignore"):
        found = run(eliminate(1, [(0, 0)]), np.array([2.0]), np.float64(2.0), np.array([1.0]))
    assert not np.isfinite(found).any()


# -- functions of C in Python ---------------------------------------------------------------------

BINARY = ("pow", "fmod", "fmin", "fmax", "atan2", "copysign", "hypot")
UNARY = (
    *("exp", "expm1", "log", "log1p", "sqrt", "sin", "cos", "tan", "asin", "acos", "atan"),
    *("sinh", "cosh", "tanh", "asinh", "floor", "ceil"),
)
CHOICES = {
    "fmin": c_code.FORMS[ca.OP_FMIN].format("x", "y"),
    "fmax": c_code.FORMS[ca.OP_FMAX].format("x", "y"),
}
OWN = {"sin": "own_sin", "cos": "own_cos"}
EXPORT = '__attribute__((visibility("default"))) double'
C_SOURCE = "\n".join(
    [
        '#include "trigonometry.c"',
        "static double own_sin(double a) { double s, c; sine_cosine(a, &s, &c); return s; }",
        "static double own_cos(double a) { double s, c; sine_cosine(a, &s, &c); return c; }",
        '__attribute__((visibility("default"))) void c_both(int n, const double *x, double *s, '
        "double *c) { sines_cosines(n, x, s, c); }",
        f"{EXPORT} c_div(double a, double b) {{ return a / b; }}",
        *(
            f"{EXPORT} c_{name}(double x, double y) {{ return {text}; }}"
            for name, text in {**{n: f"{n}(x, y)" for n in BINARY}, **CHOICES}.items()
        ),
        *(f"{EXPORT} c_{name}(double a) {{ return {OWN.get(name, name)}(a); }}" for name in UNARY),
        "",
    ]
)
SPECIAL = (0.0, -0.0, 1.0, -1.0, 0.5, -2.5, 3.0, 1e300, -1e300, 1e-310, 710.0, -750.0)
VALUES = (*SPECIAL, math.inf, -math.inf, math.nan)


@pytest.fixture(scope="module")
def c(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    suffix = PLATFORMS[host_platform()].suffix
    path = tmp_path_factory.mktemp("c") / f"functions{suffix}"
    trigonometry = (native.C_SOURCES / "trigonometry.c").read_text(encoding="utf-8")
    files = {"functions.c": C_SOURCE, "trigonometry.c": trigonometry}
    path.write_bytes(native.compile_c(files, "functions.c", "functions", host_platform()))
    return ctypes.CDLL(str(path))


def same(a: float, b: float) -> bool:
    if math.isnan(a) or math.isnan(b):
        return math.isnan(a) and math.isnan(b)
    return a == b and math.copysign(1, a) == math.copysign(1, b)


def in_python(name: str) -> Callable[..., float]:
    """What the generated Python calls: a guarded function where Python's own raises."""
    return getattr(c_functions, f"_{name}", None) or getattr(math, name)


@pytest.mark.parametrize("name", ["div", *BINARY])
def test_binary_functions_are_those_of_c(c: ctypes.CDLL, name: str) -> None:
    of_c = getattr(c, f"c_{name}")
    of_c.restype, of_c.argtypes = ctypes.c_double, [ctypes.c_double] * 2
    of_python = in_python(name)
    for a, b in itertools.product(VALUES, VALUES):
        assert same(of_python(a, b), of_c(a, b)), (a, b)


@pytest.mark.parametrize("name", UNARY)
def test_unary_functions_are_those_of_c(c: ctypes.CDLL, name: str) -> None:
    of_c = getattr(c, f"c_{name}")
    of_c.restype, of_c.argtypes = ctypes.c_double, [ctypes.c_double]
    of_python = in_python(name)
    for a in VALUES:
        assert same(of_python(a), of_c(a)), a


def angles() -> np.ndarray:
    """Of all sizes, and next to where sine or cosine vanish; their number is even."""
    near = np.arange(-50.0, 50.0) * (math.pi / 2)
    random = np.random.default_rng(1).uniform(-1.0, 1.0, 1000)
    return np.concatenate([near, np.nextafter(near, 1e9), random, 10.0 * random, 1.5e6 * random])


@pytest.mark.parametrize("far", [[], [2e6, -1e300]])
def test_sines_of_many_angles_are_those_of_each_and_of_python(
    c: ctypes.CDLL, far: list[float]
) -> None:
    x = np.append(angles(), far)
    sines, cosines = np.empty_like(x), np.empty_like(x)
    c.c_both(ctypes.c_int(x.size), *(ctypes.c_void_p(a.ctypes.data) for a in (x, sines, cosines)))
    expected = np.array([c_functions._sine_cosine(a) for a in x.tolist()])
    np.testing.assert_array_equal(sines, expected[:, 0])
    np.testing.assert_array_equal(cosines, expected[:, 1])


@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 60, reason="no longer numbers to compare with")
def test_sine_and_cosine_are_right_to_the_last_digit() -> None:
    x = angles()[200:]  # multiples of pi/2 would need still longer numbers
    for k, function in enumerate((np.sin, np.cos)):
        exact = function(x.astype(np.longdouble))
        found = np.array([c_functions._sine_cosine(a)[k] for a in x.tolist()])
        units = np.abs(found - exact) / np.spacing(np.abs(exact.astype(np.float64)))
        assert units.max() < 1.1  # as fdlibm


@pytest.mark.parametrize("a", VALUES)
def test_sign_is_that_of_casadi(a: float) -> None:
    x = ca.SX.sym("x")
    assert same(c_functions._sign(a), float(ca.Function("f", [x], [ca.sign(x)])(a)))


@pytest.mark.parametrize("module", [c_functions, runtime])
def test_run_time_needs_only_the_standard_library(module: ModuleType) -> None:
    """Its text goes into every python FMU, where nothing of ours is installed."""
    code = "import sys; sys.modules['numpy'] = sys.modules['casadi'] = None\n"
    source = Path(str(module.__file__)).read_text(encoding="utf-8")
    result = subprocess.run(
        [sys.executable, "-I", "-c", code + source], capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
