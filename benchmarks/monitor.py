"""Does monitoring name what changed in a year of logs, with dates, and stay quiet otherwise?

    python -m benchmarks.monitor --seed 1 --out out/monitor
    python -m benchmarks.monitor --seed 1 --years 0 --clean 200 --out out/monitor_clean

Years of 60 logs of the independent motor bench, each bench another one: friction creeps up from log
30 (Coulomb's, or more of the declared viscous one), the encoder is replaced at log 45 (by one with
another zero, scale or latency). Right is a year of which both are named, from the right log on, and
nothing else. Clean years are all of one bench, so that its derivatives are simulated once.

Seeds below `TEST` are for development; a test seed is run once.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.bench_year import (
    ENCODERS,
    FIRST,
    FRICTION,
    Year,
    benches,
    machine,
    measured,
    write_years,
)
from benchmarks.motor_plant import driven
from cosim.monitor import Monitored, monitor, read_series
from cosim.monitor.monitor import baseline_patterns

TEST = 1000
FACTORS = (1.0, 0.5)
NAMES = {
    "coulomb": ("coulomb at load.flange", "coulomb at gearbox.flange_a"), "b": ("b",),
    "zero": ("offset of angle",),
    "scale": ("count scale of all channels at encoder", "scale of all channels at encoder"),
    "latency": ("latency of all channels at encoder",),
}  # fmt: skip
"""Truth -> names that are the same law."""
WARMTHS = 300
"""Temperatures at which the plant is simulated for clean years."""


def years() -> list[Year]:
    """Every friction with every encoder, at both sizes."""
    return [
        Year(friction=friction, encoder=encoder, factor=factor)
        for factor in FACTORS for friction in FRICTION for encoder in ENCODERS
    ]  # fmt: skip


def judged(found: Monitored, year: Year) -> dict[str, Any]:
    """A year compared with its truth."""
    table = found.to_dict()
    names = [log["name"] for log in table["logs"]]
    dates = [log["date"] for log in table["logs"]]
    wanted = {
        "friction": (year.friction, "creep", year.creeps - 1,
                     year.factor * FRICTION.get(year.friction, 0.0)),
        "encoder": (year.encoder, "step", year.replaced - 1,
                    year.factor * ENCODERS.get(year.encoder, 0.0)),
    }  # fmt: skip
    row: dict[str, Any] = {
        "friction": year.friction, "encoder": year.encoder, "factor": year.factor,
        "verdict": table["verdict"], "wall_s": table["wall_s"],
        "changes": [found.sentence(change) for change in found.changes],
    }  # fmt: skip
    used = 0
    for part, (truth, kind, first, size) in wanted.items():
        if not truth:
            continue
        hits = [
            c for c in table["changes"]
            if c["kind"] == kind and c["named"]
            and set(NAMES[truth]) & {c["what"], *c["cannot_tell_from"], *c.get("same", [])}
        ]  # fmt: skip
        row[f"{part} named"] = bool(hits)
        if hits:
            used += 1
            one = hits[0]
            row[f"{part} first log off by"] = names.index(one["first_log"]) - first
            low, high = one["between"]
            row[f"{part} date within"] = bool(low <= dates[first] <= high)
            if one["what"] == NAMES[truth][0]:  # at another place it has another size
                row[f"{part} size over truth"] = one["change"] / size
                row[f"{part} size within"] = bool(one["ci95"][0] <= size <= one["ci95"][1])
    row["others"] = len(table["changes"]) - used
    row["right"] = bool(
        used == sum(bool(t[0]) for t in wanted.values()) and not row["others"]
        and all(row.get(f"{part} first log off by", 0) == 0 for part in wanted)
    )  # fmt: skip
    return row


def changed(seed: int, count: int, out: Path) -> list[dict[str, Any]]:
    """Years in which both happen, each of its own bench."""
    rows = []
    for number, year in enumerate(years()[:count]):
        with tempfile.TemporaryDirectory() as folder:
            ((place, _),) = write_years(Path(folder), [year], 10_000 * seed + number)
            found = monitor(place)
        rows.append(judged(found, year))
        print(json.dumps(rows[-1]), flush=True)
        (out / "years.json").write_text(json.dumps(rows, indent=1) + "\n")
    return rows


def quiet(seed: int, count: int, out: Path) -> list[dict[str, Any]]:
    """Years in which nothing happens, all of one bench.

    The plant is simulated at `WARMTHS` temperatures; a year draws its logs from these without
    repetition, and each log gets noise and rounding of its own.
    """
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        ((place, _),) = write_years(Path(folder), [Year()], 10_000 * seed + 5_000)
        series = read_series(place)
    known = baseline_patterns(series)
    random = np.random.default_rng([seed, 7])
    plain, runs = machine(10_000 * seed + 5_000)
    states = benches(Year(WARMTHS), [FIRST] * WARMTHS, plain, random)
    clean = driven(states, runs)
    for _ in range(count):
        chosen = random.choice(WARMTHS, len(series.logs), replace=False).tolist()
        data = {}
        for log, column in zip(series.logs, chosen, strict=True):
            for name, values in zip(log.runs, clean, strict=True):
                table = measured(values, column, "", 1.0, random)
                data[name] = np.column_stack([table[c.name] for c in series.problem.channels])
        year = replace(series, problem=series.problem.with_data(data))
        begun = time.perf_counter()
        found = monitor(year, known=replace_columns(known))
        rows.append(
            {
                "verdict": found.verdict, "tests": found.found.tests,
                "changes": [found.sentence(change) for change in found.changes],
                "warnings": found.warnings,
                "beyond limits": sum(bool(c.outside) for c in found.charts()),
                "seconds": time.perf_counter() - begun,
            }
        )  # fmt: skip
        if found.changes or len(rows) % 10 == 0:
            alarms = sum(row["verdict"] != "nothing_changed" for row in rows)
            beyond = sum(row["beyond limits"] > 0 for row in rows)
            print(f"{len(rows)} clean years: {alarms} alarms {rows[-1]['changes']}, {beyond} with "
                  "a log beyond its limits", flush=True)  # fmt: skip
            (out / "clean.json").write_text(json.dumps(rows, indent=1) + "\n")
    return rows


def replace_columns(known: Any) -> Any:
    """The patterns with columns of their own, which a finding changes."""
    return replace(
        known, values={name: v.copy() for name, v in known.values.items()}, bent={},
        directions=list(known.directions),
    )  # fmt: skip


def summary(rows: list[dict[str, Any]]) -> str:
    """A line over all years."""
    right = sum(row["right"] for row in rows)
    parts = []
    for part in ("friction", "encoder"):
        named = [row for row in rows if row.get(f"{part} named")]
        exact = sum(row[f"{part} first log off by"] == 0 for row in named)
        dates = sum(row[f"{part} date within"] for row in named)
        ratios = [
            row[f"{part} size over truth"] for row in named if f"{part} size over truth" in row
        ]
        covered = sum(row.get(f"{part} size within", False) for row in named)
        spread = f"{min(ratios):.3f} to {max(ratios):.3f}" if ratios else "-"
        parts.append(
            f"{part}: named {len(named)}, first log exact {exact}, date within its interval "
            f"{dates}, size over truth {spread}, within its interval {covered} of {len(ratios)}"
        )
    wall = float(np.median([row["wall_s"] for row in rows]))
    return f"{right} of {len(rows)} years right; {'; '.join(parts)}; {wall:.0f} s a year"


def main() -> int:
    """Run it; 0 if all is right."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seed", type=int, default=1, help=f"{TEST} and more are test seeds")
    parser.add_argument("--years", type=int, default=len(years()))
    parser.add_argument("--clean", type=int, default=20)
    parser.add_argument("--out", type=Path, default=Path("out/monitor"))
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    rows = changed(given.seed, given.years, given.out) if given.years else []
    clean = quiet(given.seed, given.clean, given.out) if given.clean else []
    if rows:
        print(summary(rows))
    alarms = sum(row["verdict"] != "nothing_changed" for row in clean)
    print(f"{alarms} alarms in {len(clean)} clean years")
    return int(alarms > 0 or not all(row["right"] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
