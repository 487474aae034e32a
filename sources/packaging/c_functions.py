"""Functions of the python FMUs that follow C; what is below the line is copied into every slave."""

import math as _math
from typing import Any

# -- run time ---------------------------------------------------------------------------------
# Functions that follow C where Python raises: division by zero, overflow, domain errors.


def _div(a: float, b: float) -> float:
    if b != 0.0:
        return a / b
    if a == 0.0 or a != a:
        return _math.nan
    return _math.copysign(_math.inf, a) * _math.copysign(1.0, b)


def _guarded(function: Any, *values: float) -> float:
    try:
        return float(function(*values))
    except OverflowError:
        return _math.inf
    except ValueError:
        return _math.nan


def _pow(a: float, b: float) -> float:
    if a == 0.0 and b < 0.0:
        return _math.copysign(_math.inf, a) if _odd(b) else _math.inf
    try:
        return _math.pow(a, b)
    except OverflowError:
        return -_math.inf if a < 0.0 and _odd(b) else _math.inf
    except ValueError:
        return _math.nan


def _odd(b: float) -> bool:
    return _math.isfinite(b) and abs(_math.fmod(b, 2.0)) == 1.0


_FAR = 1.6e6


def _sine_cosine(x: float) -> tuple[float, float]:
    """As in trigonometry.c, operation by operation."""
    if not abs(x) < _FAR:
        if not -_math.inf < x < _math.inf:
            return _math.nan, _math.nan
        return _math.sin(x), _math.cos(x)
    n = (x * 6.36619772367581382433e-01 + 6755399441055744.0) - 6755399441055744.0
    a = x - n * 1.57079632673412561417e00
    b = n * 6.07710050630396597660e-11
    r = a - b
    c = n * 2.02226624879595063154e-21 - ((a - r) - b)
    y = r - c
    rest = (r - y) - c
    z = y * y
    w = z * z
    half = 0.5 * z
    one = 1.0 - half
    v = z * y
    odd = (
        8.33333333332248946124e-03
        + z * (-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06)
        + z * w * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
    )
    even = z * (
        4.16666666666666019037e-02
        + z * (-1.38888888888741095749e-03 + z * 2.48015872894767294178e-05)
    ) + w * w * (
        -2.75573143513906633035e-07
        + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)
    )
    s = y - ((z * (0.5 * rest - v * odd) - rest) - v * -1.66666666666666324348e-01)
    q = one + (((1.0 - one) - half) + (z * even - y * rest))
    quadrant = int(n) % 4
    first, second = (q, s) if quadrant % 2 else (s, q)
    return (-first if quadrant >= 2 else first), (-second if quadrant in (1, 2) else second)


def _sin(a: float) -> float:
    return _sine_cosine(a)[0]


def _cos(a: float) -> float:
    return _sine_cosine(a)[1]


def _tan(a: float) -> float:
    return _math.tan(a) if -_math.inf < a < _math.inf else _math.nan


def _asin(a: float) -> float:
    return _math.asin(a) if -1.0 <= a <= 1.0 else _math.nan


def _acos(a: float) -> float:
    return _math.acos(a) if -1.0 <= a <= 1.0 else _math.nan


def _exp(a: float) -> float:
    return _guarded(_math.exp, a)


def _sinh(a: float) -> float:
    return _math.copysign(_guarded(_math.sinh, a), a)


def _cosh(a: float) -> float:
    return _guarded(_math.cosh, a)


def _log(a: float) -> float:
    return -_math.inf if a == 0.0 else _guarded(_math.log, a)


def _log1p(a: float) -> float:
    return -_math.inf if a == -1.0 else _guarded(_math.log1p, a)


def _expm1(a: float) -> float:
    return _guarded(_math.expm1, a)


def _sqrt(a: float) -> float:
    return _guarded(_math.sqrt, a)


def _fmod(a: float, b: float) -> float:
    return _guarded(_math.fmod, a, b)


def _floor(a: float) -> float:
    return _math.copysign(_math.floor(a), a) if _math.isfinite(a) else a


def _ceil(a: float) -> float:
    return _math.copysign(_math.ceil(a), a) if _math.isfinite(a) else a


def _sign(a: float) -> float:
    return -1.0 if a < 0.0 else 1.0 if a > 0.0 else a


def _fmin(a: float, b: float) -> float:
    return a if a < b else b


def _fmax(a: float, b: float) -> float:
    return a if a > b else b
