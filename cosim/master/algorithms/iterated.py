"""Iterated: inputs as mean of begin and end values; steps are repeated until both ends fit.

    u = L (y_k + y_{k+1}) / 2,   (x_{k+1}, y_{k+1}) = step(x_k, u)

Second order in the communication step, and stable where exchange without iteration is not. Fixed
point as long as it contracts, else Newton's method with a Jacobian by differences of whole steps,
which is kept from step to step. Held signals (integers, booleans, discrete ones) are those of t_k.
Needs FMUs that can return to a saved state.

With interpolation = 1 the inputs of FMUs that can follow (FMI 2's canInterpolateInputs, FMI 3's
intermediate update) go in a line from L y_k to L y_{k+1} within the step, with the same mean, and
outputs at its end are those of these inputs. A stiff contact, which follows its velocity within the
step, then has no slip from half of the step's change of velocity, and its own solver sees no jumps.
The first guess is that values change as in the step before.

Options:
    tolerance: relative change of exchanged values at which a step counts as settled; 1e-6 at least
        where one of them is a Float32.
    interpolation: 0: inputs are held at their mean; 1: they move from begin to end where they can.

Source: Kübler and Schiehlen, Two methods of simulator coupling, 2000 (iteration); Busch, Continuous
approximation techniques for co-simulation methods, 2016.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arguments import need_whole
from ...errors import FmuCallError, ValueRangeError
from ...system.system import System
from ..algebraic_loops import consistent, find_loops
from ..extrapolation import means, set_derivatives, smooth
from ..interpreter import Interpreter
from ..kernel.programs import Programs
from ..newton import Newton, floor, single
from ..options import positive, refuse_without_states
from ..plan import Op, Plan, final_operations, initial_sweep, lay_out, operations
from ..rollback import Checkpoint

Vector = NDArray[np.float64]
FIXED_POINT = 12
"""Repetitions before Newton's method takes over."""
FRESH, STEP, ENDS = 0, 1, 2
"""Programs: connected values brought up to date; a step with that, without if inputs move; and then
outputs for given inputs at its end."""


def compile_plan(
    system: System,
    external: Sequence[str],
    observed: Sequence[str],
    *,
    tolerance: float = 1e-8,
    interpolation: int = 0,
) -> Plan:
    """Compile a system."""
    refuse_without_states(system, "iterated")
    need_whole("the order of interpolation", interpolation)
    if interpolation not in (0, 1):
        raise ValueRangeError(f"interpolation of order {interpolation!r}: must be 0 or 1")
    layout = lay_out(system, external, observed)
    loops = find_loops(system, layout)
    fresh = consistent(system, layout, loops, only_loops=False)
    lines, spans = means(system, layout, interpolation)
    everyone = range(len(layout.instances))
    step: list[tuple[int, ...]] = []
    for index in everyone:
        step += [(Op.SET, index), *set_derivatives(lines, spans, index)]
    step += [(Op.STEP, index) for index in everyone]
    if not interpolation:
        step += [*[(Op.GET, index) for index in everyone], *fresh]
    return Plan(
        layout,
        initial_sweep(system, layout),
        operations(step),
        final_operations(fresh),
        tuple(loop for _, loop in loops),
        operations(fresh),
        tuple(lines),
        stepper=partial(
            Iterated, tolerance=positive("tolerance", tolerance), smooth=smooth(system, layout)
        ),
    )


class Iterated:
    """A `plan.Stepper` whose inputs are the means of begin and end values.

    Args:
        run: what steps.
        tolerance: relative change of exchanged values at which they count as settled.
        smooth: per copy, whether its values are continuous in time.
    """

    looks_ahead = False

    def __init__(self, run: Interpreter, tolerance: float, smooth: NDArray[np.bool_]) -> None:
        self.run = run
        self.sources = np.unique(run.layout.copy_source[smooth])
        names = [run.layout.names[slot] for slot in self.sources]
        both = [*names, *(run.layout.names[slot] for slot in run.layout.copy_target[smooth])]
        self.newton = Newton(floor(run.system, names), single(run.system, both), tolerance)
        self.tolerance = self.newton.tolerance
        everyone = range(len(run.instances))
        ends = operations([(op, index) for op in (Op.SET, Op.GET) for index in everyone])
        self.programs = Programs(run, run.plan.solving, run.plan.step, ends)
        lines = [mean for mean in run.plan.means if mean.moving]
        self.line = np.array([run.plan.means.index(mean) for mean in lines], dtype=np.int64)
        self.line_source = np.array([mean.source for mean in lines], dtype=np.int64)
        self.line_target = np.array([mean.target for mean in lines], dtype=np.int64)
        self.line_gain = np.array([mean.gain for mean in lines])
        self.line_offset = np.array([mean.offset for mean in lines])
        self.held = np.zeros(0)
        self.change = np.zeros(self.sources.size)
        self.repetitions = 0

    def advance(self, last: int) -> None:
        """Go on up to a communication point."""
        run = self.run
        while run.index < last:
            run.do(Op.EXTERNAL, 0, 0)
            self.programs.do(FRESH, run.instants[run.index])
            run.do(Op.RECORD, 0, 0)
            self.step()
            run.index += 1

    def restart(self) -> None:
        """Forget what earlier steps were like."""
        self.newton.valid[0] = 0
        self.change[:] = 0.0
        self.repetitions = 0

    def save(self) -> tuple[Vector, Vector, int, int]:
        """Jacobian and changes that are kept from step to step, and how many steps there were."""
        kept = self.newton.inverse.copy(), self.change.copy()
        return *kept, int(self.newton.valid[0]), self.repetitions

    def restore(self, memory: tuple[Vector, Vector, int, int]) -> None:
        """Return to them."""
        self.newton.inverse[:], self.change[:], self.newton.valid[0], self.repetitions = memory

    def steps(self) -> int:
        """Steps of the whole system that were made, repeated ones too."""
        return self.repetitions

    def report(self) -> Mapping[str, Any]:
        """Nothing to say; instances are told of warnings."""
        self.programs.report()
        return {}

    def step(self) -> None:
        """One communication step."""
        run = self.run
        begin = run.values.copy()
        guess = (begin[self.sources] + self.change).tolist()
        with self.programs.saved() as before:
            end = list(guess)
            settled = not self.newton.valid[0] and self.fixed_point(before, begin, end)
            if not settled:
                end = list(guess)
                settled = self.newton.solve(lambda z: self.attempt(before, begin, z), end)
            if not settled:
                raise FmuCallError(
                    f"{run.system.name}: the step of {run.step:.9g} s does not "
                    "settle, neither by repetition nor by Newton's method; take a smaller "
                    "communication step"
                )
        if run.plan.means:
            self.change = np.array(end) - begin[self.sources]
        run.account(self.held[run.layout.bond_input - self.input_slots.start])

    @property
    def input_slots(self) -> slice:
        """Where inputs stand among the values."""
        inputs = self.run.layout.inputs
        return slice(int(inputs[0, 0]), int(inputs[-1, 1]))

    def fixed_point(self, before: Checkpoint, begin: Vector, end: list[float]) -> bool:
        """Repeat the step with the end values of the last repetition; whether that settled."""
        last = np.inf
        for _ in range(FIXED_POINT):
            found = self.attempt(before, begin, end)
            ends = zip(found, end, self.newton.floor.tolist(), strict=True)
            size = max((abs(a - b) / max(least, abs(b)) for a, b, least in ends), default=0.0)
            end[:] = found
            if size <= self.tolerance:
                return True
            if not size < last:
                return False
            last = size
        return False

    def attempt(self, before: Checkpoint, begin: Vector, end: list[float]) -> list[float]:
        """End values of a step with inputs from given end values."""
        run, layout = self.run, self.run.layout
        self.programs.restore(before)
        self.repetitions += 1
        values = run.values
        values[self.sources] = 0.5 * (begin[self.sources] + np.array(end))
        values[layout.copy_target] = (
            values[layout.copy_source] * layout.copy_gain + layout.copy_offset
        )
        self.held = values[self.input_slots].copy()
        time = run.instants[run.index]
        size = run.size(time, run.step)
        if run.plan.means:
            values[self.sources] = end
            first, last = begin[self.line_source], values[self.line_source]
            values[self.line_target] = first * self.line_gain + self.line_offset
            run.derivatives.slope[self.line] = (last - first) * (self.line_gain / size)
        self.programs.do(STEP, time, size)
        if run.plan.means:
            # outputs of the inputs' end values as they are assumed: a stiff contact turns what is
            # left between those and the new ones into large forces, on which nothing converges
            values[layout.copy_target] = (
                values[layout.copy_source] * layout.copy_gain + layout.copy_offset
            )
            self.programs.do(ENDS, time + size)
        found: list[float] = values[self.sources].tolist()
        return found
