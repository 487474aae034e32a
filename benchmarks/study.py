"""Threads and memory of a study of the motor bench.

    python -m benchmarks.study [--runs N] [--repeats N] [--growth N]

Threads: the same runs with one and with two. Beside the wall time it prints, where the system
counts it (Linux), the time of the busiest thread without its waiting for a processor: what other
programs on the machine take away is left out, waiting for the interpreter lock and for the other
thread is not.

Memory: resident memory over the runs of a study that keeps a signal of each.
"""

from __future__ import annotations

import argparse
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from cosim.installation.builder import default_provider
from cosim.study import Progress, parallel, run_study, study_from
from cosim.study.compute import RunnerPool, TaskResult
from cosim.study.planning import StudyPlan, Task, plan_study

SCHEDSTAT = "/proc/self/task/{}/schedstat"


def queued() -> float:
    """Time that this thread has waited for a processor [s]; 0 where it is not counted."""
    path = Path(SCHEDSTAT.format(threading.get_native_id()))
    return int(path.read_text().split()[1]) * 1e-9 if path.exists() else 0.0


def nothing(*_: Task | TaskResult | str) -> None:
    """Results are not looked at."""


def timed(plan: StudyPlan, workers: int) -> tuple[float, float, float]:
    """Wall time, CPU time, and time of the busiest thread without waiting for a processor [s]."""
    busy: dict[int, list[float]] = {}
    compute = parallel.compute

    def watched(*arguments: Any) -> TaskResult:
        sums = busy.setdefault(threading.get_native_id(), [0.0, 0.0])
        begin, waited, cpu = time.perf_counter(), queued(), time.thread_time()
        outcome = compute(*arguments)
        sums[0] += time.perf_counter() - begin - (queued() - waited)
        sums[1] += time.thread_time() - cpu
        return outcome

    parallel.compute = watched
    try:
        begin = time.perf_counter()
        pool = RunnerPool(plan.provider, workers)
        parallel.in_threads(plan.tasks.values(), pool, workers, nothing, nothing)
        wall = time.perf_counter() - begin
    finally:
        parallel.compute = compute
    return wall, sum(s[1] for s in busy.values()), max(s[0] for s in busy.values())


def threads(runs: int, repeats: int) -> None:
    """Print times with one thread and with two, alternating."""
    axis = {"load.J": {"from": 0.07, "to": 0.09, "count": runs}}
    plan = plan_study(
        study_from({"scenario": "motor_bench/ST1", "param": axis}), default_provider()
    )
    found: dict[int, list[tuple[float, float, float]]] = {1: [], 2: []}
    for _ in range(repeats):
        for workers, times in found.items():
            times.append(timed(plan, workers))
    print(f"{runs} runs of 7 s, best of {repeats}; s")
    print("threads   wall    CPU   busiest thread without waiting for a processor")
    best = {w: [min(column) for column in zip(*times, strict=True)] for w, times in found.items()}
    for workers, (wall, cpu, alone) in best.items():
        print(f"{workers:7d} {wall:6.2f} {cpu:6.2f} {alone:8.2f}")
    wall, _, alone = (a / b for a, b in zip(best[1], best[2], strict=True))
    print(f"  ratio {wall:6.2f}        {alone:8.2f}")


def memory(runs: int) -> None:
    """Print resident memory over the runs of a study."""
    table = {
        "scenario": "motor_bench/ST1",
        "duration": 0.1,
        "param": {"load.J": {"uniform": [0.07, 0.09]}},
        "sample": {"count": runs},
        "keep": ["load.w"],
    }
    shown = {0, 1, 10, *(runs * k // 10 for k in range(1, 11))}

    def told(state: Progress) -> None:
        if state.done in shown:
            pages = int(Path("/proc/self/statm").read_text().split()[1])
            print(f"after run {state.done:5d}: {pages * 4096 / 1e6:6.1f} MB")

    with tempfile.TemporaryDirectory() as folder:
        run_study(study_from(table), out=folder, workers=2, progress=told, picture=False)


def main() -> None:
    """Run both."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=24)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--growth", type=int, default=1000)
    options = parser.parse_args()
    threads(options.runs, options.repeats)
    if Path("/proc/self/statm").exists():
        memory(options.growth)


if __name__ == "__main__":
    main()
