"""Does the diagnosis name undeclared effects, and stay quiet without? Data of an independent plant.

    python -m benchmarks.selftest --repeats 3 --out out/selftest

Every effect of `motor_plant.EFFECTS` is put into benches with other parameters and sizes; half of
the data sets have none. Prints the confusion matrix, false alarms and the coverage of the 95 %
intervals, and writes them as a table.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.motor_plant import EFFECTS, Bench, draw, write_sets
from cosim.calibrate.mapping import read_problem
from cosim.diagnose import diagnose

SHEET = Path(__file__).parents[1] / "scenarios/motor_bench/data/motor_bench.toml"


def benches(repeats: int, clean: int, seed: int) -> list[Bench]:
    """Effects at 0.5, 1 and 2 times their size, and clean ones."""
    random = np.random.default_rng(seed)
    found = [draw(random) for _ in range(clean)]
    for name in EFFECTS:
        if name != "none":
            for index in range(repeats):
                found.append(draw(random, name, (1.0, 2.0, 0.5)[index % 3]))
    return found


def judge(bench: Bench, folder: Path, workers: int) -> dict[str, Any]:
    """Diagnose one data set and compare with the truth."""
    begun = time.perf_counter()
    result = diagnose(read_problem(folder, workers=workers)).to_dict()
    names = [e["effect"] for e in result["effects"]]
    rivals = [e.partition(" at ")[0] for a in result["alternatives"] for e in a["effects"][-1:]]
    covered = {}
    for name, entry in result["parameters"].items():
        last = entry.get("after") or entry["before"]
        if name in bench.parameters and last["identifiable"]:
            low, high = last["ci95"]
            covered[name] = bool(low <= bench.parameters[name] <= high)
    return {
        "truth": bench.effect, "size": bench.size, "verdict": result["verdict"], "named": names,
        "rivals": rivals, "covered": covered, "wall_s": time.perf_counter() - begun,
    }  # fmt: skip


def summary(rows: list[dict[str, Any]]) -> str:
    """Table of outcomes."""
    lines = ["| effect in the data | sets | right | confounded with it | other | missed |",
             "|---|---|---|---|---|---|"]  # fmt: skip
    right = total = 0
    for truth in EFFECTS:
        mine = [r for r in rows if r["truth"] == truth]
        if not mine:
            continue
        same = set(EFFECTS[truth][1])
        counts: Counter[str] = Counter()
        for row in mine:
            if truth == "none":
                counts["other" if row["named"] else "right"] += 1
            elif not row["named"]:
                counts["missed"] += 1
            elif row["verdict"] == "effect_found" and row["named"][0] in same:
                counts["right"] += 1
            elif same & {row["named"][0], *row["rivals"]}:
                counts["confounded"] += 1
            else:
                counts["other"] += 1
        if truth != "none":
            right, total = right + counts["right"], total + len(mine)
        cells = [counts[k] for k in ("right", "confounded", "other", "missed")]
        lines.append(f"| {truth} | {len(mine)} | " + " | ".join(map(str, cells)) + " |")
    clean = [r for r in rows if r["truth"] == "none"]
    alarms = sum(bool(r["named"]) for r in clean)
    inside = [v for r in rows for v in r["covered"].values()]
    lines += [
        "",
        f"Right at the first name: {right} of {total}. "
        f"False alarms: {alarms} of {len(clean)} "
        f"clean sets. 95 % intervals of identifiable parameters that hold the truth: "
        f"{sum(inside)} of {len(inside)}.",
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--clean", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("out/selftest"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    made = benches(arguments.repeats, arguments.clean, arguments.seed)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        places = write_sets(Path(folder), made, SHEET, arguments.seed, arguments.seconds)
        for bench, place in zip(made, places, strict=True):
            rows.append(judge(bench, place, arguments.workers))
            print(json.dumps(rows[-1]), file=sys.stderr, flush=True)
    (arguments.out / "selftest.json").write_text(json.dumps(rows, indent=1), encoding="utf-8")
    table = summary(rows)
    (arguments.out / "selftest.md").write_text(table, encoding="utf-8")
    print(table)


if __name__ == "__main__":
    main()
