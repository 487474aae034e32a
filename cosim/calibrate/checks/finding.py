"""What checks of the data say: one vocabulary, and what a mapping lets pass.

A finding is an error (the data cannot be used), a warning, or a note. An error that stops valid
data is let pass by its kind: `[checks] allow = ["spikes"]` in `dataset.toml`; it is a warning then.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ...errors import ScenarioError, listing

KINDS = {
    "absent": "a channel whose column a log does not have",
    "clipped": "a column that ends at a limit which the model goes beyond",
    "clock": "sample times that do not rise, or columns that are late",
    "constant": "a column or an input that never changes",
    "copy": "runs that are copies of each other, or hold a part of their own twice",
    "differs": "a column whose clock, zero or gain is another one from run to run",
    "empty": "a channel without a value",
    "frozen": "a sensor that stands still for a while",
    "gap": "missing rows",
    "gaps": "cells without a number",
    "input": "noise of a column that drives the model",
    "held": "a column whose values stand for several samples each",
    "jitter": "sample times that are not even",
    "jump": "a column that goes on from another value",
    "mixed": "a column that two runs have in common",
    "noise": "a column with more noise than it is said to have, or with far less",
    "prior": "a parameter far from what its prior says",
    "purpose": "no run for a purpose",
    "rate": "a clock that runs fast or slow",
    "reading": "what was assumed in reading",
    "saturated": "a column that stays at its largest or smallest value",
    "short": "too few samples",
    "sign": "a column with the sign turned round",
    "simulation": "a model that does not run",
    "smoothed": "columns without the noise that they are said to have",
    "spikes": "single samples that stand out",
    "start": "a run that begins where the model does not, or with a value that has noise",
    "step": "a communication step that does not divide the sample interval, or the period",
    "swapped": "columns that are exchanged",
    "undriven": "an input that no column drives, though one may be it",
    "unit": "a column in another unit",
    "wrapped": "an angle that begins anew at a turn",
}
"""Names of what may be found."""
LASTING = {"empty", "purpose", "simulation", "short"}
"""Kinds that nothing can be done about by letting them pass."""


@dataclass(frozen=True)
class Finding:
    """A problem of a data set.

    Attributes:
        severity: `error` (cannot be used), `warning` or `note`.
        kind: one of `KINDS`.
        run, column: where; "" for all.
        text: the reason, and what to do.
    """

    severity: str
    kind: str
    run: str
    column: str
    text: str

    def __str__(self) -> str:
        where = " ".join(
            item for item in (f"run {self.run}" if self.run else "", self.column) if item
        )
        way = ""
        if self.severity == "error" and self.kind not in LASTING:
            way = f' (if the data are right: [checks] allow = ["{self.kind}"] in dataset.toml)'
        return f"{self.severity}: {where + ': ' if where else ''}{self.text}{way}"

    def _repr_html_(self) -> str:
        from ...display.html import tag
        from ...display.notebook import view

        where = [f"run {self.run}"] * bool(self.run) + [self.column] * bool(self.column)
        kind = "over" if self.severity == "error" else ""
        text = tag("p", tag("span", self.text, class_=kind))
        return view(f"{self.severity}: {self.kind}", ", ".join(where), text)

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"severity": self.severity, "kind": self.kind, "run": self.run,
                "column": self.column, "text": self.text}  # fmt: skip


@dataclass(frozen=True)
class Source:
    """Where a problem's data come from.

    Attributes:
        path: of the mapping.
        findings: of reading the data.
        allow: kinds of errors that are let pass.
        rate: samples per second that the data set says, None if it says nothing.
        as_logged: whether runs have the sample times of their logs.
        made: channels that the mapping filters or brings to another clock.
        instruments: channels whose noise is that of the sensor, from the rig's sheet.
    """

    path: Path = Path()
    findings: tuple[Finding, ...] = ()
    allow: frozenset[str] = frozenset()
    rate: float | None = None
    as_logged: bool = True
    made: frozenset[str] = frozenset()
    instruments: frozenset[str] = frozenset()


NO_SOURCE = Source()
"""Of data that no mapping was read for."""


def quantity(value: float, unit: str, digits: str = ".4g") -> str:
    """A number with its unit, if it has one."""
    return f"{value:{digits}} {unit}".rstrip()


def check_allowed(kinds: Iterable[str], path: Path) -> frozenset[str]:
    """Kinds that a mapping lets pass.

    Raises:
        ScenarioError: an unknown kind, or one without which nothing can be done.
    """
    for kind in kinds:
        if kind not in KINDS:
            raise ScenarioError(
                f"{path}: [checks] allow: {kind!r} is no kind of finding; {listing(KINDS, kind)}"
            )
        if kind in LASTING:
            raise ScenarioError(f"{path}: [checks] allow: {kind!r} ({KINDS[kind]}) stops any fit")
    return frozenset(kinds)


def passed(findings: Iterable[Finding], allow: frozenset[str]) -> list[Finding]:
    """Findings with the allowed errors as warnings."""
    return [
        replace(f, severity="warning", text=f"{f.text} (allowed)")
        if f.severity == "error" and f.kind in allow else f
        for f in findings
    ]  # fmt: skip


FEW = 3
"""Runs with the same finding that are named one by one."""


def lines(findings: Iterable[Finding]) -> list[str]:
    """Findings for people: the same one of many runs in one line, with the first one's figures."""
    alike: dict[tuple[str, str, str], list[Finding]] = {}
    for finding in findings:
        alike.setdefault((finding.severity, finding.kind, finding.column), []).append(finding)
    found = []
    for group in alike.values():
        runs = list(dict.fromkeys(finding.run for finding in group if finding.run))
        if len(runs) <= FEW:
            found += [str(finding) for finding in group]
        else:
            rest = f" (so, too, in {len(runs) - 1} other runs: {runs[1]}, …, {runs[-1]})"
            found.append(str(replace(group[0], text=group[0].text + rest)))
    return found
