"""Initialization of all FMUs together: connected values are exchanged until nothing changes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import AlgebraicLoopError
from .interpreter import Interpreter
from .newton import floor
from .plan import Op, decoded

Vector = NDArray[np.float64]
SWEEPS = 100
"""Exchanges during initialization before a loop is said not to settle."""
SETTLED = 1e-12
"""Relative change at which an algebraic loop counts as settled during initialization."""
LOOPED = 1e-9
"""The same where loops are solved: they are to 1e-10, and other outputs follow from them."""
PATIENCE = 25
"""Exchanges before algebraic loops are solved by Newton's method during initialization."""
RUNAWAY = 1e12
"""Size of a value from which on exchanges are given up."""


def initialize(run: Interpreter) -> None:
    """Initialize all instances together.

    Raises:
        AlgebraicLoopError: initial values do not settle.
        FmuCallError: an FMU refused.
    """
    start = float(run.times[0])
    stop = None if run.outline.endless else float(run.times[-1])
    for instance, block in zip(run.instances, run.inputs, strict=True):
        instance.enter_initialization(start, stop, run.outline.tolerance)
        block.get()  # inputs that nothing sets keep the FMU's start values
    sweep = decoded(run.plan.initial)
    begin = run.values.copy()
    settled, change = _exchange(run, sweep, PATIENCE if run.newtons else SWEEPS, SETTLED)
    if not settled and run.newtons:
        run.values[:] = begin
        _exchange(run, sweep, 1, SETTLED)
        # outputs without feedthrough may follow inputs here, too: their initial states do
        settled, change = _exchange(run, sweep + decoded(run.plan.solving), SWEEPS, LOOPED)
        for index in range(len(run.instances)):
            run.do(Op.COPY, *run.layout.copies[index].tolist())
            run.do(Op.SET, index, 0)
    if not settled:
        raise AlgebraicLoopError(_unsettled(run, change))
    for instance in run.instances:
        instance.exit_initialization()
    for index in range(len(run.instances)):
        run.do(Op.GET, index, 0)
    run.started = True


def _exchange(
    run: Interpreter, sweep: list[tuple[Op, int, int]], sweeps: int, tolerance: float
) -> tuple[bool, Vector]:
    """Exchange connected values until nothing changes: whether they settled, last change."""
    before, floors = np.full_like(run.values, np.nan), floor(run.system, run.layout.names)
    change, size = before, np.ones_like(before)
    for _ in range(sweeps):
        for op, a, b in sweep:
            run.do(op, a, b)
        if np.array_equal(before, run.values):
            return True, change
        change, size = np.abs(run.values - before), np.maximum(np.abs(run.values), floors)
        before = run.values.copy()
        if tolerance > SETTLED and bool(np.all(change <= tolerance * size)):
            return True, change
        if run.newtons and np.any(size > RUNAWAY):
            return False, change
    return bool(np.all(change <= tolerance * size)), change


def _unsettled(run: Interpreter, change: Vector) -> str:
    system = run.system
    worst = int(np.nanargmax(change)) if np.any(np.isfinite(change)) else 0
    loops = system.algebraic_loops()
    text = (
        f"{system.name}: initial values do not settle in {SWEEPS} exchanges at "
        f"t = {run.times[0]:.9g} s; {run.layout.names[worst]} still changes by "
        f"{change[worst]:.3g}"
    )
    for loop in loops:
        text += "\nalgebraic loop:\n" + system.explain_loop(loop)
    return text + (
        "\nTake a component with a state in the loop (an elastic gearbox, a compliant contact)"
        if loops
        else "\nNo algebraic loop is declared; an FMU's declared dependencies may be wrong"
    )
