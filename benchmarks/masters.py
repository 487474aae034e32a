"""Cost of a co-simulation step in our master and in others: `python -m benchmarks.masters`.

Twelve FMUs (four drives of motor, gearbox and disc, each motor following the disc of the drive
before it: feedback inside each drive, 23 connections, 8 power bonds), Jacobi, 0.1 ms, ten signals
recorded every 100th step. The FMUs are cheap on purpose (a speed source, a ratio with efficiency, a
disc, each with its own solver), because what is measured is what a master adds to them.

Every master runs the same SSP archive in a process of its own. All runs are interleaved in rounds
and timed by CPU time (all threads), set-up left out; the ratio is to the C loop of the same round,
and the median of the rounds counts. The results are compared with those of the C loop.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.chain import DRIVES, EVERY, RECORD, STEP, build_chain
from cosim import Master, ssp
from cosim.master.kernel import SOURCES, cache_folder, library_name
from cosim.master.session import Session
from sources.packaging.kernel import build_kernel
from sources.packaging.platforms import host_platform

FMUS = 3 * DRIVES


@dataclass(frozen=True)
class Entry:
    """A master in the table.

    Attributes:
        client: of `benchmarks.chain`.
        fmi: version of the FMUs.
        steps: per round.
        tolerance: largest relative difference of final speeds and angles to the C loop.
        module: that must be installed.
    """

    title: str
    client: str
    fmi: int
    steps: int
    tolerance: float
    module: str = ""


# Same arithmetic in the same order: no difference at all. libcosim counts time in nanoseconds and
# Ecos adds up steps, so the steps differ in their last bits; the system is stable.
ENTRIES = [
    Entry("C loop written for this system", "floor", 2, 100_000, 0.0),
    Entry("C loop written for this system", "floor", 3, 100_000, 0.0),
    Entry("cosim, compiled kernel", "kernel", 2, 100_000, 0.0),
    Entry("cosim, compiled kernel", "kernel", 3, 100_000, 0.0),
    Entry("cosim, executor in Python", "python", 2, 2_000, 0.0),
    Entry("FMPy, loop in Python", "fmpy", 2, 2_000, 0.0, "fmpy"),
    Entry("FMPy, loop in Python", "fmpy", 3, 2_000, 0.0, "fmpy"),
    Entry("libcosim (libcosimpy)", "libcosim", 2, 5_000, 1e-9, "libcosimpy"),
    Entry("Ecos (ecospy)", "ecos", 2, 10_000, 1e-9, "ecospy"),
    Entry("Ecos (ecospy)", "ecos", 3, 10_000, 1e-9, "ecospy"),
]


class Client:
    """A process that runs the chain."""

    def __init__(self, entry: Entry, path: Path) -> None:
        self.entry = entry
        self.process = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.chain", entry.client, str(path)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        self._read()

    def _read(self) -> Any:
        assert self.process.stdout is not None and self.process.stderr is not None
        for line in self.process.stdout:
            if line.startswith("{"):  # other tools print, too
                return json.loads(line)
        raise RuntimeError(f"{self.entry.title}: {self.process.stderr.read()[-2000:]}")

    def run(self, count: int) -> Any:
        """Run the chain from its start."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{count}\n")
        self.process.stdin.flush()
        return self._read()

    def close(self) -> None:
        """End the process."""
        self.process.kill()
        self.process.wait()


def per_step(answer: Any, key: str = "cpu") -> float:
    """Time per FMU-step [ns]."""
    return float(answer[key]) / (answer["steps"] * FMUS) * 1e9


def measure(paths: dict[int, Path], rounds: int, only: list[str] | None) -> list[dict[str, Any]]:
    """Interleaved rounds of all clients."""
    clients = [
        Client(entry, paths[entry.fmi])
        for entry in ENTRIES
        if entry.client == "floor" or only is None or entry.client in only
    ]
    answers: dict[Entry, list[Any]] = {client.entry: [] for client in clients}
    try:
        for _ in range(rounds):
            for client in clients:
                answers[client.entry].append(client.run(client.entry.steps))
        floors = {e.fmi: e for e in answers if e.client == "floor"}
        expected: dict[int, list[float]] = {}
        for client in clients:
            if client.entry.client == "floor" and client.entry.fmi == 2:
                for steps in {entry.steps for entry in answers}:
                    expected[steps] = client.run(steps)["final"]
    finally:
        for client in clients:
            client.close()
    rows = []
    for entry, found in answers.items():
        pairs = zip(found[-1]["final"], expected[entry.steps], strict=True)
        difference = max(abs(a - b) / abs(b) for a, b in pairs)
        if difference > entry.tolerance:
            raise SystemExit(
                f"{entry.title}, FMI {entry.fmi}: final speeds and angles differ by "
                f"{difference:.3g} from the C loop, more than {entry.tolerance:g}"
            )
        times = [per_step(answer) for answer in found]
        base = [per_step(answer) for answer in answers[floors[entry.fmi]]]
        rows.append(
            {
                "master": entry.title,
                "fmi": entry.fmi,
                "steps": entry.steps,
                "ns_per_fmu_step": statistics.median(times),
                "least_ns": min(times),
                "wall_ns": statistics.median(per_step(answer, "wall") for answer in found),
                "ratio": statistics.median(a / b for a, b in zip(times, base, strict=True)),
                "least_ratio": min(times) / min(base),
                "difference": difference,
            }
        )
    return rows


def threads(path: Path, rounds: int, steps: int = 10_000) -> dict[str, float]:
    """Two runs one after the other against two at once in threads (the kernel frees the GIL).

    The same is done with SHA-256, which frees the GIL too: what that gains is what the machine
    had to give at the time. Least times of many short rounds.
    """
    sessions = [
        Session(Master(ssp.read(path), "jacobi", STEP), steps * STEP, record=RECORD, every=EVERY)
        for _ in range(2)
    ]
    content = bytes(7_000_000)  # takes about as long as a run
    work: dict[str, list[Callable[[], object]]] = {
        "runs": [session.run for session in sessions],
        "control": [partial(hashlib.sha256, content)] * 2,
    }
    spent: dict[str, list[tuple[float, float]]] = {name: [] for name in work}
    for _ in range(rounds):
        for name, jobs in work.items():
            started = time.perf_counter()
            for job in jobs:
                job()
            alone = time.perf_counter() - started
            worker = threading.Thread(target=jobs[1])
            started = time.perf_counter()
            worker.start()
            jobs[0]()
            worker.join()
            spent[name].append((alone, time.perf_counter() - started))
    return {
        name: min(alone for alone, _ in found) / min(together for _, together in found)
        for name, found in spent.items()
    }


def main() -> None:
    """Build, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--motor", default="ideal", help="fidelity of dc_motor")
    parser.add_argument("--only", action="append", help="only these clients (and the C loop)")
    options = parser.parse_args()
    build_kernel(SOURCES, cache_folder() / library_name(), host_platform())
    with tempfile.TemporaryDirectory() as folder:
        paths = {
            fmi: ssp.write(
                build_chain(fmi, options.motor, Path("fmus")), Path(folder) / f"chain{fmi}.ssp"
            )
            for fmi in (2, 3)
        }
        rows = measure(paths, options.rounds, options.only)
        pair = threads(paths[2], 40 * options.rounds)
    if options.json:
        print(json.dumps({"rows": rows, "threads": pair}))
        return
    table = Table(
        "master", "FMI", "steps", "ns per FMU-step", "least", "wall", "x C loop", "differs by"
    )
    for row in rows:
        table.add_row(
            row["master"], str(row["fmi"]), str(row["steps"]), f"{row['ns_per_fmu_step']:.1f}",
            f"{row['least_ns']:.1f}", f"{row['wall_ns']:.1f}", f"{row['ratio']:.2f}",
            f"{row['difference']:.1g}",
        )  # fmt: skip
    console = Console()
    console.print(table)
    console.print(
        f"two runs at once in threads: {pair['runs']:.2f} times as fast as one after the other "
        f"(two SHA-256 at the same time: {pair['control']:.2f})"
    )


if __name__ == "__main__":
    main()
