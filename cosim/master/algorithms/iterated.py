"""Iterated: inputs as mean of begin and end values; steps are repeated until both ends fit.

    u = L (y_k + y_{k+1}) / 2,   (x_{k+1}, y_{k+1}) = step(x_k, u)

Second order in the communication step, and stable where exchange without iteration is not. Fixed
point as long as it contracts, else Newton's method with a Jacobian by differences of whole steps,
which is kept from step to step. Held signals (integers, booleans, discrete ones) are those of t_k.
Needs FMUs that can return to a saved state.

Options:
    tolerance: relative change of exchanged values at which a step counts as settled.

Source: Kübler and Schiehlen, Two methods of simulator coupling, 2000 (iteration); Busch, Continuous
approximation techniques for co-simulation methods, 2016.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import FmuCallError
from ...system.system import System
from ..algebraic_loops import consistent, find_loops
from ..extrapolation import smooth
from ..interpreter import Interpreter
from ..kernel.programs import Programs
from ..newton import Newton
from ..options import positive, refuse_without_states
from ..plan import Op, Plan, final_operations, initial_sweep, lay_out, operations
from ..rollback import Checkpoint

Vector = NDArray[np.float64]
FIXED_POINT = 12
"""Repetitions before Newton's method takes over."""
FRESH, STEP = 0, 1
"""Programs: connected values brought up to date, and a step with that."""


def compile_plan(
    system: System, external: Sequence[str], observed: Sequence[str], *, tolerance: float = 1e-8
) -> Plan:
    """Compile a system."""
    refuse_without_states(system, "iterated")
    layout = lay_out(system, external, observed)
    loops = find_loops(system, layout)
    fresh = consistent(system, layout, loops, only_loops=False)
    return Plan(
        "iterated",
        layout,
        initial_sweep(system, layout),
        operations([(Op.EXTERNAL,), *fresh, (Op.RECORD,)]),
        final_operations(fresh),
        tuple(loop for _, loop in loops),
        operations(fresh),
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
        self.run, self.tolerance = run, tolerance
        self.sources = np.unique(run.layout.copy_source[smooth])
        self.newton = Newton(self.sources.size, tolerance)
        everyone = range(len(run.instances))
        whole = operations([(op, a) for op in (Op.SET, Op.STEP, Op.GET) for a in everyone])
        fresh = run.plan.solving
        self.programs = Programs(run, fresh, np.concatenate([whole, fresh]))
        self.held = np.zeros(0)
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

    def save(self) -> tuple[Vector, int, int]:
        """The Jacobian that is kept from step to step, and how many steps there were."""
        return self.newton.inverse.copy(), int(self.newton.valid[0]), self.repetitions

    def restore(self, memory: tuple[Vector, int, int]) -> None:
        """Return to them."""
        self.newton.inverse[:], self.newton.valid[0], self.repetitions = memory

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
        with self.programs.saved() as before:
            end = begin[self.sources].tolist()
            settled = not self.newton.valid[0] and self.fixed_point(before, begin, end)
            if not settled:
                end = begin[self.sources].tolist()
                settled = self.newton.solve(lambda z: self.attempt(before, begin, z), end)
            if not settled:
                raise FmuCallError(
                    f"{run.system.name}: the step of {run.step:.9g} s does not "
                    "settle, neither by repetition nor by Newton's method; take a smaller "
                    "communication step"
                )
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
            size = max(
                (abs(a - b) / max(1.0, abs(b)) for a, b in zip(found, end, strict=True)),
                default=0.0,
            )
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
        self.programs.do(STEP, time, run.size(time, run.step))
        found: list[float] = values[self.sources].tolist()
        return found
