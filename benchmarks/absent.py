"""What effects cost an FMU while they are absent: `python -m benchmarks.absent`.

A diagnosis asks for up to four effects at many places in one FMU, all but one of them absent. The
time of a step is told for the component alone, with these effects at strength 0, and with all of
them there.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

from rich.console import Console
from rich.table import Table

from sources.packaging.build import build, collect

from .fmu_step import load_driver, measure

CASES = {
    "crawler.lab/track_contact": [
        *("low_friction_patch@mu_left", "low_friction_patch@mu_lateral"),
        *("mesh_ripple@mu", "mesh_ripple@mu_right", "mesh_ripple@mu_lateral"),
    ],
    "dc_motor.lab_bench/sampled": ["delay@command", "delay@current_sensor", "delay@speed_sensor"],
    "inertia.lab_bench/disc": ["cogging@flange", "coulomb@flange", "harmonic_ripple@flange"],
    "ur5_arm.lab/ticked": [f"cogging@joint_{k}" for k in range(1, 7)],
}
"""What a diagnosis has together in one FMU, with laws that take long."""
STEP = 1e-3
"""Communication step [s]; solvers take theirs."""


def main() -> None:
    """Build, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        driver = load_driver(Path(folder))
        for name, effects in CASES.items():
            full = "+".join([name, *effects])
            strengths = [
                e.name
                for e in collect(full).entries
                if e.part == "parameter" and e.quantity.strength
            ]
            plain, path = build(name, out=Path("fmus")), build(full, out=Path("fmus"))
            absent = dict.fromkeys(strengths, 0.0)
            times = [
                measure(driver, one, STEP, rounds=60, count=200, parameters=values)
                for one, values in ((plain, None), (path, absent), (path, None))
            ]
            rows.append({"variant": name, "effects": effects, "us": times})
    if options.json:
        print(json.dumps(rows))
        return
    table = Table("variant", "effects", "alone [µs]", "absent", "there", title="one step")
    for row in rows:
        alone, absent_us, there = row["us"]
        table.add_row(
            row["variant"],
            str(len(row["effects"])),
            f"{alone:.2f}",
            f"{absent_us:.2f} ({absent_us / alone:.1f} x)",
            f"{there:.2f} ({there / alone:.1f} x)",
        )
    Console().print(table)


if __name__ == "__main__":
    main()
