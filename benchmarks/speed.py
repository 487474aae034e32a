"""How much faster than real time a scenario runs, and where the time goes.

    python -m benchmarks.speed [RUN] [--step SECONDS] [--solver-step SECONDS]
                               [--duration SECONDS] [--repeats N]

Set-up is left out. One core: least processor time of several runs. Two at once: two prepared runs
in two threads against one after the other, wall time, best of several; beside it what two SHA-256
gained, which is what the machine had to give at the time. Shares: half way into the run each FMU
alone is given the same inputs again and again (set, slopes of 0, step, get); what is left is the
kernel, outputs that are fetched anew, and caches that are cold.
"""

from __future__ import annotations

import argparse
import copy
import hashlib
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from benchmarks.coupling import limit_solvers, of_scenario
from cosim.master import kernel
from cosim.master.initialization import initialize
from cosim.master.master import Master
from cosim.master.plan import Op, operations
from cosim.master.session import Session

RECORD = ["base.x"]


def prepared(
    name: str, duration: float, step: float | None = None, solver_step: float | None = None
) -> tuple[Master, dict[str, Any]]:
    """The master of a run and how its sessions are made.

    Args:
        name: of the run.
        duration: simulated time [s].
        step: communication step in place of the run's own [s].
        solver_step: longest step of the solvers inside, in place of their own [s].
    """
    case = of_scenario(name)
    if case.usual is None:
        raise ValueError(f"{name} is no run of a scenario")
    algorithm, options, usual = case.usual
    if solver_step is not None:
        limit_solvers(case.system, solver_step)
    settings = {"duration": duration, "inputs": case.inputs, "record": RECORD, "every": 5}
    return Master(case.system, algorithm, step or usual, options=options), settings


def least(function: Callable[[], object], repeats: int, clock: Callable[[], float]) -> float:
    """Least time of several calls [s]."""
    best = float("inf")
    for _ in range(repeats):
        begin = clock()
        function()
        best = min(best, clock() - begin)
    return best


def at_once(work: Sequence[Callable[[], object]]) -> None:
    """Do these in threads."""
    threads = [threading.Thread(target=item) for item in work]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def shares(master: Master, settings: dict[str, Any], repeats: int) -> dict[str, float]:
    """Processor time per communication step of each FMU [s]."""
    found = {}
    with Session(master, **settings) as session:
        run = session._run
        session._execution.restart()
        initialize(run)
        half = session.count // 2
        session._stepper.advance(half)
        run.derivatives.slope[:] = run.derivatives.curve[:] = (
            0.0  # else each step begins with a jump back
        )
        steps = min(50, (session.count - half) // repeats)  # near the state of the run
        for index, name in enumerate(run.layout.instances):
            derivatives = [
                (a, b) for op, a, b in run.plan.step.tolist()
                if op == Op.SET_DERIVATIVES and run.plan.means[a].instance == index
            ]  # fmt: skip
            own = [(Op.SET, index, 0), *((Op.SET_DERIVATIVES, a, b) for a, b in derivatives)]
            rows = [*own, (Op.STEP, index, 0), (Op.GET, index, 0)]
            only = copy.copy(run)
            only.plan = replace(run.plan, step=operations(rows))
            alone = kernel.Kernel(only)
            alone.run.index = half
            times = []
            for _ in range(repeats):
                begin = time.process_time()
                alone.advance(int(alone.run.index) + steps)
                times.append(time.process_time() - begin)
            found[name] = min(times) / steps
    return found


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", nargs="?", default="mobile_manipulator/IY")
    parser.add_argument("--step", type=float, help="communication step [s], not the run's own")
    parser.add_argument("--solver-step", type=float, help="longest step of solvers inside [s]")
    parser.add_argument("--duration", type=float, default=30.0, help="simulated time [s]")
    parser.add_argument("--repeats", type=int, default=5)
    arguments = parser.parse_args()
    master, settings = prepared(
        arguments.run, arguments.duration, arguments.step, arguments.solver_step
    )
    duration, steps = arguments.duration, round(arguments.duration / master.step)
    with Session(master, **settings) as first, Session(master, **settings) as second:
        alone = least(first.run, arguments.repeats, time.process_time)
        digest = partial(hashlib.sha256, bytes(round(alone * 4e8)))  # about as long as a run
        gains = []
        for work in ([first.run, second.run], [digest, digest]):
            single = least(work[0], arguments.repeats, time.perf_counter)
            double = least(partial(at_once, work), arguments.repeats, time.perf_counter)
            gains.append(2 * single / double)
    options = "".join(f" {key} {value}" for key, value in master.options.items())
    print(f"{arguments.run}, {duration:g} s, {master.algorithm}{options}, {master.step * 1e3:g} ms")
    print(f"one core: {duration / alone:.0f} x real time ({alone / steps * 1e6:.1f} us per step)")
    print(
        f"two at once in threads: {gains[0]:.2f} x as fast as one after the other "
        f"(two SHA-256, what the machine had to give: {gains[1]:.2f})"
    )
    costs = shares(master, settings, 5)
    costs["kernel"] = max(alone / steps - sum(costs.values()), 0.0)
    for name, cost in sorted(costs.items(), key=lambda item: -item[1]):
        print(f"  {name:<16s}{cost * 1e6:>8.2f} us{cost * steps / alone:>8.1%}")


if __name__ == "__main__":
    main()
