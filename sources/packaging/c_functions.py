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


def _sin(a: float) -> float:
    return _math.sin(a) if -_math.inf < a < _math.inf else _math.nan


def _cos(a: float) -> float:
    return _math.cos(a) if -_math.inf < a < _math.inf else _math.nan


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
