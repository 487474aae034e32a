"""How a run with extrapolation begins: trial steps tell how outputs move at the start.

Extrapolation needs values of the past, and at the start there are none. Inputs that are held over
the first step make an error as large as that of a method without extrapolation. So two steps are
gone on trial, all FMUs return to where they were, and the past is that of the parabola through the
outputs:

    y(-h) = 3 y(0) - 3 y(h) + y(2 h),   y(-2 h) = 6 y(0) - 8 y(h) + 3 y(2 h)
    y(-3 h) = 10 y(0) - 15 y(h) + 6 y(2 h)

The second trial begins with the past from the first. Where an FMU fails in the second step of the
first trial, or asks to end the run, which it may do because inputs were held, the past is that of
the line through the first two values; the run itself tells whether it does. Runs of a single step,
and systems with an FMU that cannot return to a saved state, start with held inputs; algorithms that
repeat steps need none.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import AlgebraicLoopError, FmuCallError
from .interpreter import Interpreter
from .plan import Op, decoded
from .rollback import restore, saved

Vector = NDArray[np.float64]
TRIALS = 2
"""The first trial begins with held inputs, which the second corrects; a third changes nothing."""


def find_past(run: Interpreter) -> None:
    """Fill the history of the extrapolated inputs before the first step.

    Raises:
        FmuCallError: an FMU failed in the trial, and can do no more.
    """
    means = run.plan.means
    able = all(item.description.can("canGetAndSetFMUState") for item in run.instances)
    if not means or not able or run.times.size < 3 or run.plan.stepper is not None:
        return
    step = decoded(run.plan.step)
    sources = [mean.source for mean in means]
    past = None
    with saved(run) as before:
        for _ in range(TRIALS):
            seen, failed = [], False
            try:
                for run.index in range(2):
                    for op, a, b in step:
                        if op not in (Op.RECORD, Op.ENERGY):
                            run.do(op, a, b)
                    seen.append(run.history[0].copy())
                seen.append(run.values[sources])
            except (FmuCallError, AlgebraicLoopError):
                if any(instance.dead for instance in run.instances):
                    raise
                failed = True
            if not failed:
                past = _parabola(*seen)
            elif past is None and run.index == 1:
                past = _line(seen[0], run.history[0].copy())
            restore(run, before)
            run.index, run.past[0] = 0, 0
            if past is not None:
                run.history[:3], run.past[0] = past, 3
            for instance in run.instances:
                instance.time = float(run.times[0])
            if failed:
                return


def _parabola(now: Vector, first: Vector, second: Vector) -> list[Vector]:
    """Values before the start, newest first, from those there and after one and two steps."""
    return [
        3.0 * now - 3.0 * first + second,
        6.0 * now - 8.0 * first + 3.0 * second,
        10.0 * now - 15.0 * first + 6.0 * second,
    ]


def _line(now: Vector, first: Vector) -> list[Vector]:
    """The same from those at the start and after one step."""
    return [now + steps * (now - first) for steps in (1.0, 2.0, 3.0)]
