"""A study whose workers and master are killed again and again: `python -m benchmarks.study_killed`.

A dask scheduler and its workers run as processes of their own, `cosim study --scheduler` as another
one. Each time a number of further results has been kept, a worker is killed (SIGKILL) and another
started; a few times the study itself is killed and started again with the same command. At the end
there must be one good result per run, each the same as in a study on threads that nobody disturbed.

    python -m benchmarks.study_killed [--runs 10000] [--kill-every 500] [--stops 2] [--out FOLDER]

Memory is what is resident (RSS) when a tenth, a half and all of the runs are kept.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

STUDY = """scenario = "motor_bench/ST1"
duration = 1.5

[param]
"load.J" = {{ from = 0.05, to = 0.12, count = {count} }}
"""
WORKERS = 2
COST = ("wall [s]", "cpu [s]", "x_real_time")
"""Columns that are of the machine, not of the run."""
LOOK = 0.2
"""Time between two looks at what has been kept [s]."""
PATIENCE = 180.0
"""Time without any new result after which it counts as stuck [s]."""


@dataclass
class Seen:
    """What happened.

    Attributes:
        killed: workers.
        stopped: times that the study itself was killed.
        memory: per stage resident memory of study, scheduler and the largest worker [MB].
    """

    killed: int = 0
    stopped: int = 0
    memory: list[tuple[int, float, float, float]] = field(default_factory=list)


def dask(*arguments: str) -> subprocess.Popen[bytes]:
    """A process of dask."""
    command = [sys.executable, "-m", "dask", *arguments]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def worker(address: str) -> subprocess.Popen[bytes]:
    """One worker with one thread, which nobody restarts."""
    return dask(
        "worker",
        address,
        "--nthreads",
        "1",
        "--no-nanny",
        "--no-dashboard",
        "--death-timeout",
        "60",
    )


def tree(pid: int) -> list[int]:
    """A process and those that it has started (Linux)."""
    begun = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()
    return [pid, *(one for child in begun for one in tree(int(child)))]


def resident(process: subprocess.Popen[bytes]) -> float:
    """Memory of a process and of those that it has started [MB]."""
    pages = [
        int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
        for pid in tree(process.pid)
    ]
    return sum(pages) * os.sysconf("SC_PAGE_SIZE") / 1e6


def study(folder: Path, *arguments: str) -> subprocess.Popen[bytes]:
    """`cosim study` as a process; its answer is in answer.json."""
    command = [sys.executable, "-m", "cosim", "study", str(folder / "study.toml"), "--json"]
    with (folder / "answer.json").open("wb") as answer, (folder / "log.txt").open("ab") as log:
        return subprocess.Popen([*command, *arguments], stdout=answer, stderr=log)


def kept(out: Path) -> int:
    """Results that are on the disk."""
    return (
        sum(1 for entry in os.scandir(out / "runs") if entry.name.endswith(".json"))
        if (out / "runs").is_dir()
        else 0
    )


def disturbed(folder: Path, runs: int, every: int, stops: int) -> Seen:
    """The study with its workers killed, up to its end."""
    seen, out = Seen(), folder / "disturbed"
    file = folder / "scheduler.json"
    scheduler = dask("scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", str(file))
    while not file.exists() or not file.stat().st_size:
        time.sleep(LOOK)
    address = str(json.loads(file.read_text(encoding="utf-8"))["address"])
    workers = [worker(address) for _ in range(WORKERS)]
    arguments = ["--scheduler", address, "--out", str(out)]
    time.sleep(5.0)  # workers announce themselves
    master = study(folder, *arguments)
    stages = [runs // 10, runs // 2, runs - runs // 20]
    stop_at = [runs * (k + 1) // (stops + 1) for k in range(stops)]
    next_kill, last, changed = every, 0, time.monotonic()
    try:
        while master.poll() is None:
            time.sleep(LOOK)
            count = kept(out)
            if count != last:
                last, changed = count, time.monotonic()
            elif time.monotonic() - changed > PATIENCE:
                raise SystemExit(f"no result for {PATIENCE:g} s after {count} of {runs}")
            if stages and count >= stages[0]:
                stages.pop(0)
                largest = max(map(resident, workers))
                seen.memory.append((count, resident(master), resident(scheduler), largest))
                print(seen, file=sys.stderr, flush=True)
            if stop_at and count >= stop_at[0]:
                stop_at.pop(0)
                master.send_signal(signal.SIGKILL)
                master.wait()
                seen.stopped += 1
                master = study(folder, *arguments)
            elif count >= next_kill and count < runs:
                next_kill += every
                workers[0].send_signal(signal.SIGKILL)
                workers[0].wait()
                workers = [*workers[1:], worker(address)]
                seen.killed += 1
    finally:
        for process in (master, *workers, scheduler):
            if process.poll() is None:
                process.kill()
            process.wait()
    return seen


def rows(out: Path) -> dict[str, dict[str, str]]:
    """The table of a study by key, without what belongs to the machine."""
    with (out / "study.csv").open(encoding="utf-8", newline="") as file:
        return {
            row["key"]: {name: value for name, value in row.items() if name not in COST}
            for row in csv.DictReader(file)
        }


def main() -> None:
    """Run both studies and print what was seen."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--kill-every", type=int, default=500, help="results")
    parser.add_argument("--stops", type=int, default=2, help="of the study itself")
    parser.add_argument("--out", type=Path)
    wanted = parser.parse_args()
    folder = wanted.out or Path(tempfile.mkdtemp(prefix="study"))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "study.toml").write_text(STUDY.format(count=wanted.runs), encoding="utf-8")
    begun = time.monotonic()
    seen = disturbed(folder, wanted.runs, wanted.kill_every, wanted.stops)
    took = time.monotonic() - begun
    answer: dict[str, Any] = json.loads((folder / "answer.json").read_text(encoding="utf-8"))
    begun = time.monotonic()
    if study(folder, "--workers", "1", "--out", str(folder / "calm")).wait():
        raise SystemExit((folder / "log.txt").read_text(encoding="utf-8")[-2000:])
    calm_took = time.monotonic() - begun
    disturbed_rows, calm_rows = rows(folder / "disturbed"), rows(folder / "calm")
    same = sum(disturbed_rows.get(key) == row for key, row in calm_rows.items())
    table = Table("what", "seen")
    for what, value in (
        ("runs wanted", wanted.runs),
        ("workers killed", seen.killed),
        ("study killed and resumed", seen.stopped),
        ("results at the end", answer["runs"]),
        ("failed", answer["failed"]),
        ("damaged result files", len(answer["corrupt"])),
        ("made by the last start, found by it", f"{answer['computed']}, {answer['reused']}"),
        ("the same as undisturbed", f"{same} of {len(calm_rows)}"),
        ("time; undisturbed on one thread", f"{took:.0f} s; {calm_took:.0f} s"),
    ):
        table.add_row(what, str(value))
    Console(width=100).print(table)
    memory = Table("runs kept", "study, MB", "scheduler, MB", "largest worker, MB")
    for count, *sizes in seen.memory:
        memory.add_row(str(count), *(f"{size:.0f}" for size in sizes))
    Console(width=100).print(memory)
    print(folder)


if __name__ == "__main__":
    main()
