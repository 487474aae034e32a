"""How a run with extrapolation begins: trial steps tell how outputs move at the start.

Extrapolation needs values of the past, and at the start there are none. Inputs that are held over
the first step make an error as large as that of a method without extrapolation. So two steps are
gone on trial, all FMUs return to where they were, and the past is that of the parabola through the
outputs:

    y(-h) = 3 y(0) - 3 y(h) + y(2 h),   y(-2 h) = 6 y(0) - 8 y(h) + 3 y(2 h)
    y(-3 h) = 10 y(0) - 15 y(h) + 6 y(2 h)

The second trial begins with the past from the first. Runs of a single step, and systems with an FMU
that cannot return to a saved state, start with held inputs; algorithms that repeat steps need none.
"""

from __future__ import annotations

from ..errors import EndRequest
from .interpreter import Interpreter
from .plan import Op, decoded
from .rollback import restore, saved

TRIALS = 2
"""The first trial begins with held inputs, which the second corrects; a third changes nothing."""


def find_past(run: Interpreter) -> None:
    """Fill the history of the extrapolated inputs before the first step.

    Raises:
        FmuCallError: an FMU failed in the trial.
    """
    means = run.plan.means
    able = all(item.description.can("canGetAndSetFMUState") for item in run.instances)
    if not means or not able or run.times.size < 3 or run.plan.stepper is not None:
        return
    step = decoded(run.plan.step)
    sources = [mean.source for mean in means]
    with saved(run) as before:
        for _ in range(TRIALS):
            seen = []
            try:
                for run.index in range(2):
                    for op, a, b in step:
                        if op not in (Op.RECORD, Op.ENERGY):
                            run.do(op, a, b)
                    seen.append(run.history[0].copy())
                seen.append(run.values[sources])
            except EndRequest:  # the run itself will end there
                run.past[0] = 0
            else:
                run.history[0] = 3.0 * seen[0] - 3.0 * seen[1] + seen[2]
                run.history[1] = 6.0 * seen[0] - 8.0 * seen[1] + 3.0 * seen[2]
                run.history[2] = 10.0 * seen[0] - 15.0 * seen[1] + 6.0 * seen[2]
                run.past[0] = 3
            restore(run, before)
            run.index = 0
            for instance in run.instances:
                instance.time = float(run.times[0])
