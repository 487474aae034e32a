"""How long a new interpreter takes until the package, a run or the command line answers.

    python -m benchmarks.startup [--repeats N]

Wall and processor time, the least of several; the bare interpreter's are the first row.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PROGRAMS = {
    "python": ["-c", "pass"],
    "import numpy": ["-c", "import numpy"],
    "import cosim": ["-c", "import cosim"],
    "from cosim import run": ["-c", "from cosim import run"],
    "cosim --help": ["-m", "cosim", "--help"],
    "cosim fmus list": ["-m", "cosim", "fmus", "list"],
    "cosim scenarios": ["-m", "cosim", "scenarios"],
    "cosim run --help": ["-m", "cosim", "run", "--help"],
}


def least(arguments: list[str], repeats: int) -> tuple[float, float]:
    """Least wall and processor time of a program [s]."""
    walls, processors = [], []
    for _ in range(repeats):
        before, begun = os.times(), time.perf_counter()
        subprocess.run([sys.executable, *arguments], check=True, capture_output=True, cwd=ROOT)
        walls.append(time.perf_counter() - begun)
        after = os.times()
        processors.append(
            after.children_user - before.children_user
            + after.children_system - before.children_system
        )  # fmt: skip
    return min(walls), min(processors)


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=7)
    repeats = parser.parse_args().repeats
    for name, arguments in PROGRAMS.items():
        wall, processor = least(arguments, repeats)
        print(f"{name:<24s}{wall:>6.2f} s{processor:>8.2f} s of processor")


if __name__ == "__main__":
    main()
