"""What a twin's calls cost beside the same steps in a run: `python -m benchmarks.twin_calls`.

Least time of several rounds, in microseconds. `run` is the cost of a communication step of
`cosim.run`'s executor, `step` that of `twin.step()`, one communication step per call.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from rich.console import Console
from rich.table import Table

import cosim
from cosim.master.twin import Twin

CASES = {
    "motor_bench/ST1": ("motor.w_ref", "load.w"),
    "crawler/SET1_1": ("contact.w2", "contact.x"),
    "omni_base/closed": (None, "base.x"),
    "mobile_manipulator/IY": (None, "base.x"),
}
"""Run: an input that is set, an output that is got."""
ROUNDS, CALLS = 20, 200


def least(function: Callable[[], object], calls: int = CALLS) -> float:
    """Least time per call over some rounds [µs]."""
    best = float("inf")
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        for _ in range(calls):
            function()
        best = min(best, (time.perf_counter() - begun) / calls)
    return 1e6 * best


def costs(twin: Twin, given: str | None, got: str) -> list[float]:
    """Costs of run, step, set, get, save with drop, restore, fork [µs]."""
    step = twin.master.step
    twin.step()
    in_one = least(lambda: twin.step(CALLS * step), 1) / CALLS
    single = least(twin.step)
    put = least(lambda: twin.set(given, 1.0)) if given else float("nan")
    get = least(lambda: twin.get(got))
    save = least(lambda: twin.drop(twin.save()), 20)
    saved = twin.save()
    back = least(lambda: twin.restore(saved), 20)
    fork = least(lambda: twin.fork().close(), 1)
    return [in_one, single, put, get, save, back, fork]


def main() -> None:
    """Print the table."""
    table = Table("system", "run", "step", "set", "get", "save", "restore", "fork")
    for name, (given, got) in CASES.items():
        with cosim.open(name, duration=float("inf")) as twin:
            row = costs(twin, given, got)
        table.add_row(name, *("–" if value != value else f"{value:.3g}" for value in row))
    Console().print(table)


if __name__ == "__main__":
    main()
