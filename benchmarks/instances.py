"""What an FMU costs in small and large systems: `python -m benchmarks.instances [12 1200 12000]`.

Chains of drives (motor, gearbox, disc, each motor following the disc before it), Jacobi at 0.1 ms,
the speed of each disc recorded every tenth step. Processor time per FMU: `build` the system, `bind`
a run (plan, instances, compiled executor), `start` a repetition (reset, initialization), and per
FMU and communication step. A column that grows is work that is not linear in the number of FMUs.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable
from typing import TypeVar

from rich.console import Console
from rich.table import Table

from benchmarks.chain import add_drives
from cosim import Master, System
from cosim.installation.builder import default_provider
from cosim.master.session import Session

T = TypeVar("T")
STEP = 1e-4
WORK = 5_000_000
"""FMU-steps of a run, at least; and at least `STEPS` steps."""
STEPS = 100
ROUNDS = 3
"""The least counts."""


def chain(count: int) -> System:
    """A system of so many FMUs."""
    system = System("chain", default_provider())
    add_drives(system, count // 3, "ideal")
    return system


def cost(action: Callable[[], T]) -> tuple[T, float]:
    """What an action gives, and its processor time [s]."""
    begun = time.process_time()
    return action(), time.process_time() - begun


def least(session: Session) -> float:
    """Processor time of a repetition [s]."""
    return min(cost(session.run)[1] for _ in range(ROUNDS))


def measure(count: int) -> list[str]:
    """A row of the table."""
    steps = max(STEPS, WORK // count)
    record = [f"load{k}.w" for k in range(1, count // 3 + 1)]
    system, build = cost(lambda: chain(count))
    master = Master(system, "jacobi", STEP)
    session, bind = cost(lambda: Session(master, steps * STEP, record=record, every=10))
    with session:
        session.run()
        whole = least(session)
    with Session(master, STEP, record=record) as short:
        start = least(short)
    per_step = (whole - start) / (count * (steps - 1))
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    times = [f"{time / count * 1e6:.0f}" for time in (build, bind, start)]
    return [str(count), *times, f"{per_step * 1e9:.0f}", f"{memory:.0f}"]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("counts", type=int, nargs="*", default=[12, 120, 1200, 12000])
    table = Table("FMUs", "build, µs", "bind, µs", "start, µs", "step, ns", "memory, MB")
    measure(12)  # archives and libraries are opened
    for count in parser.parse_args().counts:
        table.add_row(*measure(count))
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
