"""What must hold in a scenario: a measure of a recording or comparison against a limit."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data.comparison import Comparison, Reference, within
from ..data.recording import Recording
from ..errors import ValueRangeError
from ..system.variants import change

Vector = NDArray[np.float64]
CHECK_KEYS = {
    "name", "source", "of", "signal", "signals", "comparison", "after", "before", "expected",
    "relative", "limit", "minus", "per", "quantity", "case", "reference", "holds_for",
}  # fmt: skip

_SIGNAL: dict[str, Callable[[Vector], float]] = {
    "initial": lambda v: float(v[0]),
    "final": lambda v: float(v[-1]),
    "minimum": lambda v: float(np.min(v)),
    "maximum": lambda v: float(np.max(v)),
    "peak": lambda v: float(np.max(np.abs(v))),
    "mean": lambda v: float(np.mean(v)),
    "rms": lambda v: float(np.sqrt(np.mean(v**2))),
    "span": lambda v: float(np.max(v) - np.min(v)),
}
_PATH = ("circle_radius", "path_length", "distance")
_COMPARISON = ("rms", "max")


@dataclass(frozen=True)
class Check:
    """A measure and its limit.

    Attributes:
        name, source: what it says and where the limit comes from.
        of: the measure.
        signals: one signal, two of a path, or none for the energy residual.
        comparison: name of the comparison, "" if the measure is of signals.
        after, before: times between which it is taken [s].
        expected: subtracted from the measure (its magnitude is then checked), None if nothing.
        relative: divide the deviation by the expected value.
        low, high: the limit, inclusive.
        minus: signal that is subtracted from the signal before it is measured, "" for none.
        per: divides the measure.
        quantity, case: checks of one quantity appear together in the overview of all runs, one
            column per case; "" if it does not appear there.
        reference: what the expected value is called there, or the upper limit if nothing is
            expected; "" leaves the limit out.
        holds_for: instance -> short forms of the variants for which it holds, whatever the others
            are; None for the variants that the scenario declares, all of them.
    """

    name: str
    source: str
    of: str
    signals: tuple[str, ...]
    comparison: str
    after: float
    before: float
    expected: float | None
    relative: bool
    low: float
    high: float
    minus: str = ""
    per: float | None = None
    quantity: str = ""
    case: str = ""
    reference: str = ""
    holds_for: Mapping[str, tuple[str, ...]] | None = None

    @property
    def needs(self) -> tuple[str, ...]:
        """Signals that have to be recorded for it."""
        return (*self.signals, self.minus) if self.minus else self.signals

    def unfit(self, declared: Mapping[str, str], used: Mapping[str, str]) -> str:
        """Why it says nothing of a run with other variants than declared; "" if it does."""
        if self.holds_for is None:
            allowed = {name: {variant} for name, variant in declared.items()}
        else:
            allowed = {
                name: {change(declared[name], short) for short in shorts}
                for name, shorts in self.holds_for.items()
            }
        return ", ".join(
            f"{name} is {used[name]}, it holds for {' or '.join(sorted(variants))}"
            for name, variants in allowed.items()
            if used[name] not in variants
        )

    def unreached(self, recording: Recording, end: float) -> str:
        """Why it says nothing of a run that an FMU ended before `end` [s]; "" if it does."""
        last = float(recording.time[-1])
        if last >= end or self.after <= last:
            return ""
        return f"the run ended at {last:.9g} s, before its window begins at {self.after:.9g} s"


@dataclass(frozen=True)
class CheckResult:
    """A check's outcome; `value` must lie within `limit` (an upper bound, or [low, high]).

    `unit` is that of `value`; `measured` is the measure before the expected value was subtracted.
    `unfit` says why it is not judged, "" if it is; `ok` says then whether it would be met.
    """

    name: str
    value: float
    limit: float | list[float]
    ok: bool
    source: str
    measured: float
    unit: str
    measured_unit: str = ""
    unfit: str = ""

    @property
    def failed(self) -> bool:
        """Judged, and not met."""
        return not self.ok and not self.unfit

    def to_dict(self) -> dict[str, Any]:
        """As in `cosim run --json`."""
        return {
            "name": self.name,
            "value": None if math.isnan(self.value) else self.value,
            "limit": self.limit,
            "ok": None if self.unfit else self.ok,
            "source": self.source,
            "measured": None if math.isnan(self.measured) else self.measured,
            "unit": self.unit,
            **({"not_judged": self.unfit} if self.unfit else {}),
        }


def read_check(entry: Mapping[str, Any], references: Mapping[str, Reference]) -> Check:
    """A check from its table in a scenario.

    Raises:
        ValueError: incomplete or contradictory.
    """
    name = str(entry.get("name", ""))
    of = str(entry.get("of", ""))
    comparison = str(entry.get("comparison", ""))
    signals = tuple(entry.get("signals", [entry["signal"]] if "signal" in entry else []))
    what = f"check {name!r}"
    if not name or "limit" not in entry:
        raise ValueError(f"{what}: name and limit are needed")
    if comparison and comparison not in references:
        raise ValueError(f"{what}: there is no comparison {comparison!r}")
    wanted: tuple[str, ...]
    if comparison:
        wanted = _COMPARISON
    elif len(signals) == 1:
        wanted = tuple(_SIGNAL)
    elif len(signals) == 2:
        wanted = _PATH
    else:
        wanted = ("energy_residual",)
    if of not in wanted:
        raise ValueError(f"{what}: of = {of!r} is not one of {', '.join(wanted)}")
    minus = str(entry.get("minus", ""))
    if minus and len(signals) != 1:
        raise ValueError(f"{what}: minus goes with one signal")
    per = float(entry["per"]) if "per" in entry else None
    if per is not None and not per > 0.0:
        raise ValueError(f"{what}: per = {per} must be positive")
    limit = entry["limit"]
    expected = float(entry["expected"]) if "expected" in entry else None
    if isinstance(limit, list):
        low, high = float(limit[0]), float(limit[1])
    else:
        low, high = float("-inf"), float(limit)
    if entry.get("relative") and not expected:
        raise ValueError(f"{what}: relative needs an expected value other than 0")
    return Check(
        name=name,
        source=str(entry.get("source", "")),
        of=of,
        signals=signals,
        comparison=comparison,
        after=float(entry.get("after", float("-inf"))),
        before=float(entry.get("before", float("inf"))),
        expected=expected,
        relative=bool(entry.get("relative", False)),
        low=low,
        high=high,
        minus=minus,
        per=per,
        quantity=str(entry.get("quantity", "")),
        case=str(entry.get("case", "")),
        reference=str(entry.get("reference", "")),
        holds_for=None if "holds_for" not in entry else _shorts(entry["holds_for"]),
    )


def _shorts(entry: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    return {name: (one,) if isinstance(one, str) else tuple(one) for name, one in entry.items()}


def circle_radius(x: Vector, y: Vector) -> float:
    """Radius of the least-squares circle through points (Kasa's linear fit)."""
    matrix = np.column_stack([x, y, np.ones_like(x)])
    solution, *_ = np.linalg.lstsq(matrix, x**2 + y**2, rcond=None)
    a, b = solution[0] / 2.0, solution[1] / 2.0
    return float(np.sqrt(solution[2] + a**2 + b**2))


def _some(check: Check, inside: NDArray[np.bool_]) -> None:
    if not inside.any():
        raise ValueRangeError(
            f"check {check.name!r}: nothing was recorded between {check.after:g} s and "
            f"{check.before:g} s"
        )


def _exact(column: NDArray[Any]) -> NDArray[Any]:
    """Integers of 64 bits as Python's: their squares and differences do not wrap around."""
    return column.astype(object) if column.dtype.kind in "iu" else column


def _measure(
    check: Check, recording: Recording, comparisons: Mapping[str, Comparison]
) -> tuple[float, str]:
    if check.comparison:
        comparison = comparisons[check.comparison]
        inside = within(comparison.times, check.after, check.before)
        _some(check, inside)
        differences = comparison.differences[inside]
        value = np.sqrt(np.mean(differences**2)) if check.of == "rms" else np.max(abs(differences))
        return float(value), comparison.unit
    if check.of == "energy_residual":
        return abs(recording.energy_residual), "J"
    inside = within(recording.time, check.after, check.before)
    _some(check, inside)
    columns = [_exact(recording[name][inside]) for name in check.signals]
    if check.minus:
        columns[0] = columns[0] - _exact(recording.like(check.minus, check.signals[0])[inside])
    unit = recording.units.get(check.signals[0], "")
    if len(columns) == 1:
        return _SIGNAL[check.of](columns[0]), unit
    columns = [column.astype(np.float64) for column in columns]
    if check.of == "circle_radius":
        return circle_radius(*columns), unit
    steps = np.hypot(np.diff(columns[0]), np.diff(columns[1]))
    ends = np.hypot(columns[0][-1] - columns[0][0], columns[1][-1] - columns[1][0])
    return float(np.sum(steps) if check.of == "path_length" else ends), unit


def evaluate(
    check: Check, recording: Recording, comparisons: Mapping[str, Comparison], unfit: str = ""
) -> CheckResult:
    """Evaluate a check.

    Args:
        check: what to evaluate.
        recording, comparisons: of the run.
        unfit: why it is not judged; what was not recorded is then not a number.

    Raises:
        UnknownNameError: a signal was not recorded.
    """
    unknown = not set(check.needs) <= set(recording.names) or check.after > recording.time[-1]
    if unfit and unknown:
        measured, unit = math.nan, ""
    else:
        measured, unit = _measure(check, recording, comparisons)
    if check.per is not None:
        measured, unit = measured / check.per, "1"
    value, measured_unit = measured, unit
    if check.expected is not None:
        value = abs(measured - check.expected)
        if check.relative:
            value, unit = value / abs(check.expected), "1"
    limit = check.high if check.low == float("-inf") else [check.low, check.high]
    return CheckResult(
        name=check.name,
        value=value,
        limit=limit,
        ok=bool(check.low <= value <= check.high),
        source=check.source,
        measured=measured,
        unit=unit,
        measured_unit=measured_unit,
        unfit=unfit,
    )


def met(checks: Iterable[CheckResult]) -> str:
    """How many checks are met of those that are judged."""
    judged = [check for check in checks if not check.unfit]
    if not judged:
        return "no checks"
    return f"{sum(check.ok for check in judged)} of {len(judged)} checks met"
