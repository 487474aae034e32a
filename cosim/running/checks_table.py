"""Outcomes of checks as a table for notebooks."""

from __future__ import annotations

from collections.abc import Sequence

from ..scenario.checks import CheckResult


def checks_html(name: str, checks: Sequence[CheckResult]) -> str:
    """Checks for a notebook; "" without any."""
    from ..display.html import Cell, number, table, unit
    from ..display.notebook import view

    if not checks:
        return ""
    rows = []
    for check in checks:
        limit = check.limit if isinstance(check.limit, list) else [check.limit]
        outcome = "not judged" if check.unfit else "ok" if check.ok else "FAILED"
        kind = "over" if check.failed else "" if check.unfit else "good"
        rows.append(
            [check.name, check.value, " to ".join(map(number, limit)), unit(check.unit),
             Cell(outcome, kind=kind), Cell(check.source, kind="text")]
        )  # fmt: skip
    met = sum(check.ok and not check.unfit for check in checks)
    head = ["check", "value", "limit", "unit", "", "source"]
    return view(name, f"{met} of {len(checks)} checks met", table(head, rows))
