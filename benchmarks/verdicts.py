"""Verdicts on diagnoses that have been made, decided anew from the fits that they left.

    python -m benchmarks.verdicts out/MB-07 out/MB-09
    python -m benchmarks.verdicts --models out/MB-07

Each argument is a folder of `cosim diagnose` (or its `models.json`). Nothing is simulated, so a
rule that was changed can be tried on all of them at once; with `--models`, all sets are listed, and
why each cannot be named.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from cosim.diagnose.doubts import doubts
from cosim.diagnose.facts import Table
from cosim.diagnose.verdict import above, decide, stands


def main() -> None:
    """Print them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("places", nargs="+", type=Path)
    parser.add_argument("--models", action="store_true", help="list all sets of effects")
    arguments = parser.parse_args()
    for place in arguments.places:
        file = place / "models.json" if place.is_dir() else place
        table = Table.read(json.loads(file.read_text(encoding="utf-8")))
        found = decide(table)
        said = file.with_name("diagnosis.json")
        before = json.loads(said.read_text(encoding="utf-8"))["verdict"] if said.exists() else "?"
        change = found.kind if found.kind == before else f"{before} -> {found.kind}"
        print(f"{file.parent.name}: {change}. {found.reason}")
        for number, model in enumerate(table.models if arguments.models else ()):
            why = doubts(table, model)
            if not why:
                why = ["stands"] if stands(table, number) else ["leaves too much"]
            rest = ", ".join(f"{x.channel} {x.rms:.3g}" for x in above(model)) or "noise"
            rest = "?" if model.rough else rest
            names = " + ".join(sorted(model.labels)) or "declared"
            print(f"  {model.score:14.1f}  {names}: leaves {rest}; {'; '.join(why)}")


if __name__ == "__main__":
    main()
