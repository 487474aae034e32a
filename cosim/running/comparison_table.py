"""What all runs of a scenario say of the same quantities, side by side.

Checks that name a `quantity` appear here: one row per run, one column per `case`, beside the value
that is expected.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ..scenario.checks import Check, CheckResult


@dataclass(frozen=True)
class ComparedQuantity:
    """One quantity over the runs.

    Attributes:
        name, unit: of the quantity; the unit is that of the signals.
        reference: what the values are called that stand beside those of the cases.
        runs: names of the runs that have it.
        cases: names of the columns.
        marks: run -> expected value, or limit.
        values: (case, run) -> what the model gave.
        deviation: how deviations from the marks are shown: "", "absolute" or "relative".
    """

    name: str
    unit: str
    reference: str
    runs: tuple[str, ...]
    cases: tuple[str, ...]
    marks: Mapping[str, float]
    values: Mapping[tuple[str, str], float]
    deviation: str

    def rows(self) -> tuple[list[str], list[list[str]]]:
        """Head and rows of a table: the values, and how far they are from the expected ones."""
        unit = "" if self.unit in ("", "1") else f" [{self.unit}]"
        named = [case or "simulated" for case in self.cases]
        head = [f"{self.name}{unit}", *([self.reference] if self.marks else []), *named]
        rows = []
        for run in self.runs:
            row = [
                run,
                *([f"{self.marks[run]:.4g}" if run in self.marks else ""] * bool(self.marks)),
            ]
            for case in self.cases:
                row.append(self._cell(self.values.get((case, run)), self.marks.get(run)))
            rows.append(row)
        if self.deviation == "relative" and len(self.runs) > 1:
            rows.append(["rms deviation", "", *map(self._rms, self.cases)])
        return head, rows

    def _rms(self, case: str) -> str:
        squares = [
            (value / self.marks[run] - 1.0) ** 2
            for (of, run), value in self.values.items()
            if of == case and run in self.marks
        ]
        return f"{100.0 * math.sqrt(sum(squares) / len(squares)):.2f} %" if squares else ""

    def _cell(self, value: float | None, mark: float | None) -> str:
        if value is None:
            return ""
        if mark is None or not self.deviation:
            return f"{value:.4g}"
        if self.deviation == "relative":
            return f"{value:.4g} ({100.0 * (value / mark - 1.0):+.2f} %)"
        return f"{value:.4g} ({value - mark:+.2g})"


Outcomes = Mapping[str, tuple[tuple[Check, CheckResult], ...]]
"""Run -> its checks with their outcomes."""


def overview(outcomes: Outcomes) -> list[ComparedQuantity]:
    """The quantities of all runs, in the order of the checks."""
    found: dict[str, list[tuple[str, Check, CheckResult]]] = {}
    for run, pairs in outcomes.items():
        for check, result in pairs:
            if check.quantity:
                found.setdefault(check.quantity, []).append((run, check, result))
    return [_quantity(name, items) for name, items in found.items()]


def _quantity(name: str, items: list[tuple[str, Check, CheckResult]]) -> ComparedQuantity:
    marks: dict[str, float] = {}
    for run, check, _ in items:
        if check.expected is not None:
            marks[run] = check.expected
        elif check.reference:
            marks[run] = check.high
    known = any(check.expected is not None for _, check, _ in items)
    relative = any(check.relative for _, check, _ in items)
    return ComparedQuantity(
        name=name,
        unit=items[0][2].measured_unit,
        reference=next((check.reference for _, check, _ in items if check.reference), "expected"),
        runs=tuple(dict.fromkeys(run for run, _, _ in items)),
        cases=tuple(dict.fromkeys(check.case for _, check, _ in items)),
        marks=marks,
        values={
            (check.case, run): result.measured
            for run, check, result in items
            if not math.isnan(result.measured)
        },
        deviation=("relative" if relative else "absolute") if known else "",
    )
