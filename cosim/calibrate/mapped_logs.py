"""The logs of a data set as a mapping takes them: chosen, taken apart, unbroken."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data.logs import DataSet, Log, LoggedRun
from ..data.segments import pieces, windows
from ..errors import ScenarioError, UnitError, listing
from ..spec.units import Unit
from .checks.finding import Finding
from .checks.smooth import LOUD, noise
from .columns import expand, prepared
from .parts import COINCIDENT
from .scales import known
from .schema import RUN, strict
from .stamps import apart, check_rising

Vector = NDArray[np.float64]
WHOLE = 0.25
"""Share of a count up to which noise is rounded off: half a count is two deviations and more."""
FAINT = 1e-3
"""Share of a column's deviation below which noise that nobody stated is taken for rounding."""
COUNTED = (48620 / 12870 / 12) ** 0.5
"""Noise that differences of whole counts show over a count (`smooth.roughness`): each rounding is
taken back by the next sample, so its differences are of one order more, sqrt(C(18, 9) / C(16, 8))
times as large."""
FEWEST = 2
"""Samples of a window that make an interval; of fewer nothing can be compared."""
LONGEST = 5.0
"""Intervals between samples longer than this many usual ones are gaps in the inputs."""


class MappedLogs:
    """Logs of a data set under a mapping.

    Args:
        path: of the mapping.
        table: the mapping, its base included.
        data: the data set.
        only: entries that runs must have besides those of the mapping.

    Attributes:
        logs, purposes: by the names of runs, pieces and windows.
        units: of the columns; "" or none where unknown.
        noise: of the columns, from the rig's sheet.
        findings: what was assumed, left out, or is lacking.

    Raises:
        ScenarioError, UnknownNameError, UnitError: mapping and logs do not fit.
    """

    def __init__(
        self, path: Path, table: Mapping[str, Any], data: DataSet, only: Mapping[str, Any]
    ) -> None:
        self.path, self.data, self.table = path, data, table
        self.findings: list[Finding] = []
        sheet = {one: unit for name, unit in data.units.items() if unit for one in expand(name)}
        noise = {one: sigma for name, sigma in data.noise.items() for one in expand(name)}
        made = {one for name in table.get("columns", {}) for one in expand(name)}
        # what is made has the unit and noise that the conversion leaves it, none if it has none
        self.units = {one: unit for one, unit in sheet.items() if one not in made}
        self.noise = {one: sigma for one, sigma in noise.items() if one not in made}
        said: dict[str, tuple[str, str]] = {}
        self._carried: dict[str, float] = {}
        self.logs: dict[str, Log] = {}
        self.purposes: dict[str, str] = {}
        lead = float(self.table.get("lead", 0.0))
        chosen = self._chosen({**self.table.get("only", {}), **only})
        for run in chosen:
            strict(
                {k: v for k, v in run.values.items() if k in RUN},
                RUN,
                f"{path}: run {run.name}",
                (),
            )
            whole = data.log(run.name)
            whole = replace(whole, units={**whole.units, **sheet}, noise=noise)
            for name, part in pieces(whole):
                heads = {one: unit for one, unit in part.units.items() if unit}
                part = replace(part, units={**sheet, **heads}, noise={**noise, **part.noise})
                log = prepared(part, self.table, self.path)
                check_rising(log, "time", log.time)
                self._count_gaps(name, log)
                self.findings += [Finding("note", "reading", name, "", note) for note in log.notes]
                self._check_units(name, log, said)
                self.units.update({column: unit for column, unit in log.units.items() if unit})
                self.noise.update(log.noise)
                for one, window in windows(name, log, lead):
                    kept = self._unbroken(one, window, window is not log)
                    if kept is not None:
                        if one in self.logs:  # a piece may be called as another run is
                            raise ScenarioError(
                                f"{path}: two runs are named {one!r}, of entries with rows, each "
                                "or window; give one of the [[run]] another name"
                            )
                        self.logs[one], self.purposes[one] = kept, run.purpose
        if chosen and not self.logs:
            raise ScenarioError(
                f"{path}: no run is left: the inputs are not known where any of the windows begins"
            )

    def _count_gaps(self, name: str, log: Log) -> None:
        """Say how many cells hold no number, of the columns that are used."""
        made = {
            one: str(entry.get("source", one)).replace("{}", str(i))
            for pattern, entry in self.table.get("columns", {}).items()
            for i, one in enumerate(expand(pattern), 1)
        }
        for column in self._used():
            gaps = log.gaps.get(made.get(column, column))
            if gaps is not None:
                severity = "warning" if gaps.row else "note"
                text = f"{gaps}: they are gaps"
                self.findings.append(Finding(severity, "gaps", name, column, text))

    def _used(self) -> list[str]:
        """Columns that channels read and that drive inputs."""
        channels = self.table["channels"].items()
        used = [str(e.get("column", one)) for key, e in channels for one in expand(key)]
        return list(dict.fromkeys([*used, *self.sources()]))

    def _check_units(self, name: str, log: Log, said: dict[str, tuple[str, str]]) -> None:
        """Refuse a column that is in another unit than in a run before.

        Args:
            name, log: of the run.
            said: columns of the runs before -> the first of them that says a unit, and that.

        Raises:
            UnitError: with both runs and units; or a unit is not known.
        """
        for column in self._used():
            unit = log.units.get(column, "")
            if not unit:
                continue
            first, other = said.setdefault(column, (name, unit))
            where = f"{self.path}: run {name}: column {column}"
            if unit == other or _same(known(unit, where), known(other, where)):
                continue
            raise UnitError(
                f"{self.path}: column {column!r} is in {other!r} in run {first}, but in {unit!r} "
                f"in run {name}; give its unit in [columns] ({column} = {{ unit = {other!r} }}), "
                "which converts each run from its own"
            )

    def _chosen(self, wanted: Mapping[str, Any]) -> list[LoggedRun]:
        """The runs with these entries.

        Raises:
            ScenarioError: no run has such an entry; or none has these values, and there is no
                `further` mapping for the others.
        """
        runs = list(self.data.runs.values())
        for key in wanted:
            if not any(key in run.values for run in runs):
                has = sorted({name for run in runs for name in run.values})
                raise ScenarioError(f"{self.path}: only: no run has {key!r}; {listing(has, key)}")
        found = [
            run for run in runs
            if all(run.values.get(key, value) == value for key, value in wanted.items())
        ]  # fmt: skip
        if runs and not found and "further" not in self.table:  # which has a system for the others
            told = " and ".join(f"{key} = {value!r}" for key, value in wanted.items())
            there = sorted({", ".join(f"{key} = {run.values[key]!r}" for key in wanted
                                      if key in run.values) for run in runs})  # fmt: skip
            raise ScenarioError(
                f"{self.path}: only: no run has {told}; there is {'; '.join(there)}"
            )
        return found

    def sources(self) -> list[str]:
        """Columns that drive inputs."""
        found: list[str] = []
        for entry in self.table.get("inputs", {}).values():
            entry = {"column": entry} if isinstance(entry, str) else entry
            if "column" in entry:
                found.append(entry["column"])
            elif "columns" in entry:
                names = entry["columns"]
                found += expand(names) if isinstance(names, str) else names
        return found

    def input_noise(self, column: str, entry: Mapping[str, Any]) -> float:
        """Standard deviation of the noise of a column that drives an input, in its unit.

        As the mapping says it; else as the sheet does, unless the column evidently carries more. A
        sheet's noise that rounding to counts takes off again is none.
        """
        if entry.get("interpolation") == "slope":
            return 0.0  # what is integrated of it is the column itself, as noisy as it is
        if "sigma" in entry:
            return float(entry["sigma"])
        if column not in self._carried:
            # what is held changes at its own times
            columns = [
                log.own[column][1] if column in log.own else log[column]
                for log in self.logs.values()
            ]
            found = noise(columns) or 0.0
            faint = found < FAINT * float(np.nanstd(np.concatenate(columns)))
            self._carried[column] = 0.0 if faint else found
        stated, quantum = self.noise.get(column, 0.0), float(entry.get("quantum", 0.0))
        found, known = self._carried[column], math.hypot(stated, COUNTED * quantum)
        evident = found > LOUD**0.5 * known
        if evident:
            found = math.sqrt(found**2 - (COUNTED * quantum) ** 2)
        sigma = found if evident else stated
        if quantum:
            sigma = math.hypot(sigma, quantum / 12**0.5) if sigma > WHOLE * quantum else 0.0
        if not evident:
            return sigma
        unit = self.units.get(column, "")
        text = (
            f"drives an input and carries noise of about {found:.3g} {unit}, by its differences; "
            "give its sigma in [inputs] if that is known"
        )
        if not any((f.kind, f.column) == ("input", column) for f in self.findings):
            self.findings.append(Finding("note", "input", "", column, text))
        return sigma

    def _unbroken(self, name: str, log: Log, window: bool) -> Log | None:
        """The log up to the first gap in what drives the system.

        What the inputs were in a gap is not known, and with it where the system was after it.

        Args:
            name, log: of the run.
            window: whether it is one of several of a log; None if nothing of it can be used.

        Raises:
            UnknownNameError: there is no such column.
            ScenarioError: what drives an input has no values, or none when the log begins.
        """
        time = log.time
        if window and np.count_nonzero(time >= 0.0) < FEWEST:
            self._left_out(name, "the log has no samples there")
            return None
        longest = self._longest(time)
        until, reason = time.size, ""
        for column in self.sources():
            if column in log.own and np.any(log.own[column][0] <= time[0]):
                continue  # held for any time, on a clock of its own
            values = log[column]
            if values.shape != time.shape:
                raise ScenarioError(f"{self.path}: " + apart(log, column, "time", time.size))
            good = np.flatnonzero(np.isfinite(values))
            if window and (not good.size or time[good[0]] - time[0] > longest):
                self._left_out(name, f"{column} is not known when it begins")
                return None
            if not good.size:
                raise ScenarioError(
                    f"{log.name}: column {column!r} has no values, but drives an input; "
                    f"{log.gaps.get(column, 'it is empty')}"
                )
            breaks = np.flatnonzero(np.diff(time[good]) > longest * (1.0 + COINCIDENT))
            end = good[breaks[0]] + 1 if breaks.size else good[-1] + 1
            if time[good[0]] - time[0] > longest:
                raise ScenarioError(
                    f"{log.name}: column {column!r} drives an input, but begins at "
                    f"{time[good[0]]:.6g} s, {good[0]} rows after the clock; begin there with "
                    "samples, or give the other columns' clock with time"
                )
            last = time[-1] - time[good[-1]]
            if end < until and (breaks.size or last > longest):
                until = int(end)
                gap = time[good[breaks[0] + 1]] - time[good[breaks[0]]] if breaks.size else last
                reason = f"{column} is not known for {gap:.4g} s after {time[end - 1]:.6g} s"
        if until == time.size:
            return log
        if window and np.count_nonzero(time[:until] >= 0.0) < FEWEST:
            self._left_out(name, reason)
            return None
        lost = 1.0 - until / time.size
        text = (
            f"{reason}, so the run ends there ({lost:.0%} of it is not used); give the rest a run "
            "of its own with samples and start values, or bridge such gaps with gap"
        )
        self.findings.append(Finding("warning", "gap", name, "time", text))
        columns = {
            one: values[:until] if values.shape == time.shape else values
            for one, values in log.columns.items()
        }
        return replace(log, columns=columns)

    def first(self, run: str, column: str, where: str) -> float:
        """What a run begins with: the first value of a column, which is said where it is late.

        Raises:
            ScenarioError, UnknownNameError: there is none.
        """
        log = self.logs[run]
        during = log.time >= 0.0
        time, values = log.time[during], log[column][during]
        good = np.flatnonzero(np.isfinite(values))
        if not good.size:
            raise ScenarioError(f"{where}: {log.name} has no value of {column!r}")
        late = float(time[good[0]] - time[0])
        if late > self._longest(time) * (1.0 + COINCIDENT):
            text = (
                f"is measured only from {late:.6g} s ({good[0]} rows) after the run begins, and "
                f"its first value counts as that at the beginning (first:{column}): right if it "
                "stands till then; else begin there with samples"
            )
            finding = Finding("warning", "start", run, column, text)
            if finding not in self.findings:
                self.findings.append(finding)
        return float(values[good[0]])

    def _longest(self, time: Vector) -> float:
        """Gap that is bridged in what samples at these times hold [s]."""
        usual = float(np.median(np.diff(time))) if time.size > 1 else 0.0
        return float(self.table.get("gap", LONGEST * usual))

    def _left_out(self, name: str, reason: str) -> None:
        """Say that a window is not used."""
        text = f"{reason}, so this window is left out"
        self.findings.append(Finding("warning", "gap", name, "time", text))


def _same(one: Unit, other: Unit) -> bool:
    """Whether two units are one, whatever they are called."""
    return replace(one, symbol="") == replace(other, symbol="")
