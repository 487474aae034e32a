"""Adaptive: Jacobi with steps whose error is controlled by repeating them.

Every step is gone at once and in two halves. The difference estimates the error of the halves,
which are kept:

    e = max_i |y_i(h/2, h/2) - y_i(h)| / (tolerance max(|y_i|, nominal_i))

A second measure is the energy that the coupling invented in the step, the sum over a power bond of
what both ends say they took, relative to what went over it. A step is accepted if neither is above
its tolerance; the next one is 0.9 e^(-1/2) as long. The communication step is the raster of
recorded values, which are interpolated by the parabola through begin, middle and end; a step never
goes over a change of an external input. Needs FMUs that can return to a saved state.

Options:
    tolerance: relative error of one step.
    energy: relative energy that the coupling may invent in one step.
    longest: longest step [s]; 100 communication steps if not given.

Source: Schierz, Arnold and Clauß, Co-simulation with communication step size control in an
FMI-compatible master algorithm, 2012; Sadjina et al., Energy conservation and power bonds in
co-simulations, 2017.
"""

from __future__ import annotations

from collections.abc import Sequence

from ...system.system import System
from ..algebraic_loops import consistent, find_loops
from ..extrapolation import positive, refuse_without_states, smooth
from ..plan import Iteration, Op, Plan, final_operations, initial_sweep, lay_out, operations


def compile_plan(
    system: System,
    external: Sequence[str],
    observed: Sequence[str],
    *,
    tolerance: float = 1e-4,
    energy: float = 0.1,
    longest: float | None = None,
) -> Plan:
    """Compile a system."""
    refuse_without_states(system, "adaptive", variable=True)
    layout = lay_out(system, external, observed)
    loops = find_loops(system, layout)
    fresh = consistent(system, layout, loops, only_loops=False)
    everyone = range(len(layout.instances))
    step = [
        (Op.COPY, 0, len(layout.copy_source)),
        *[(op, index) for op in (Op.SET, Op.STEP, Op.GET) for index in everyone],
    ]
    return Plan(
        "adaptive",
        layout,
        initial_sweep(system, layout),
        operations(step),
        final_operations(fresh),
        tuple(loop for _, loop in loops),
        operations(fresh),
        iteration=Iteration(
            positive("tolerance", tolerance),
            smooth(system, layout),
            positive("energy", energy),
            None if longest is None else positive("longest", longest),
            adaptive=True,
        ),
    )
