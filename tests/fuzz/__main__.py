"""Fuzz the readers: `python -m tests.fuzz --seconds 3600 --reader npz --seed 7`."""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

from .campaign import GOOD, Statistics, campaign, keep
from .readers import READERS


def table(found: dict[str, Statistics]) -> str:
    """Outcomes of all readers."""
    lines = [f"{'reader':10} {'inputs':>8} {'read':>8} {'refused':>8} {'bad':>6} {'slowest':>8}"]
    for name, item in found.items():
        counts = item.counts
        lines.append(
            f"{name:10} {counts.total():8} {counts['read']:8} {counts['refused']:8} "
            f"{sum(item.bad.values()):6} {item.slowest:7.2f}s"
        )
        lines += [f"    {count:6} x {text}" for text, count in item.bad.items()]
    total = sum(item.counts.total() for item in found.values())
    bad = sum(sum(item.bad.values()) for item in found.values())
    return "\n".join([*lines, f"{total} inputs, {bad} of them bad"])


def main() -> int:
    """Run until the time or the inputs are over; 1 if anything must not be."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--reader", action="append", choices=sorted(READERS), help="[all]")
    parser.add_argument("--seconds", type=float, help="for all readers together")
    parser.add_argument("--inputs", type=int, help="of each reader [1000 without --seconds]")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first input")
    parser.add_argument("--out", type=Path, default=Path("out/fuzz"), help="for counterexamples")
    parser.add_argument("--json", type=Path, help="write the counts there")
    chosen = parser.parse_args()
    inputs = chosen.inputs if chosen.inputs or chosen.seconds else 1000
    shown = time.monotonic()

    def told(found: dict[str, Statistics]) -> None:
        nonlocal shown
        if time.monotonic() - shown > 60.0:
            shown = time.monotonic()
            total = sum(item.counts.total() for item in found.values())
            bad = sum(sum(item.bad.values()) for item in found.values())
            print(f"{total} inputs, {bad} bad", file=sys.stderr, flush=True)

    found = campaign(
        chosen.reader or list(READERS), chosen.seed, inputs=inputs, seconds=chosen.seconds,
        first=chosen.first, told=told,
    )  # fmt: skip
    print(table(found))
    if chosen.json:
        content = {name: dict(item.counts) for name, item in found.items()}
        chosen.json.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    for place in keep(found, chosen.seed, chosen.out):
        print(f"kept: {place}")
    return int(any(set(item.counts) - set(GOOD) for item in found.values()))


if __name__ == "__main__":
    sys.exit(main())
