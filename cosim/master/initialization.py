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
LOOPED = 10.0
"""The same where loops are solved, in what they are solved to: other outputs follow from them."""
PATIENCE = 25
"""Exchanges before algebraic loops are solved by Newton's method during initialization."""
RUNAWAY = 1e12
"""Size of a loop's value from which on plain exchange is given up for Newton's method."""


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
        looped = LOOPED * max(newton.tolerance for newton in run.newtons)
        settled, change = _exchange(run, sweep + decoded(run.plan.solving), SWEEPS, looped)
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
    """Exchange connected values until nothing changes: whether they settled, last change.

    Other values, such as those that are recorded alone, have no part in it: nothing follows from
    them. Their changes are 0.
    """
    layout = run.layout
    exchanged = np.unique(np.concatenate([layout.copy_source, layout.copy_target]))
    looped = np.isin(exchanged, [slot for loop in run.plan.loops for slot in loop.sources])
    floors = floor(run.system, (layout.names[slot] for slot in exchanged))
    changes, before = np.zeros_like(run.values), np.full(exchanged.size, np.nan)
    for number in range(sweeps):
        for op, a, b in sweep:
            run.do(op, a, b)
        now = run.values[exchanged]
        same = (now == before) | (np.isnan(now) & np.isnan(before))
        with np.errstate(invalid="ignore"):
            change = np.where(same, 0.0, np.abs(now - before))
        size, before = np.maximum(np.abs(now), floors), now
        changes[exchanged] = change
        close = same if tolerance <= SETTLED else same | (change <= tolerance * size)
        if number and bool(np.all(close)):
            return True, changes
        if run.newtons and tolerance <= SETTLED and np.any(size[looped] > RUNAWAY):
            return False, changes
    return bool(np.all(same | (change <= tolerance * size))), changes


def _unsettled(run: Interpreter, change: Vector) -> str:
    system = run.system
    odd = np.flatnonzero(~np.isfinite(change))
    worst = int(odd[0]) if odd.size else int(np.argmax(change))
    name, value = run.layout.names[worst], run.values[worst]
    loops = system.algebraic_loops()
    text = (
        f"{system.name}: initial values do not settle in {SWEEPS} exchanges at "
        f"t = {run.times[0]:.9g} s; {name} "
        + (f"is {value}" if odd.size else f"still changes by {change[worst]:.3g}")
    )
    for loop in loops:
        text += "\nalgebraic loop:\n" + system.explain_loop(loop)
    return text + (
        "\nTake a component with a state in the loop (an elastic gearbox, a compliant contact)"
        if loops
        else "\nNo algebraic loop is declared; an FMU's declared dependencies may be wrong"
    )
