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

from collections.abc import Sequence

from ...system.system import System
from ..algebraic_loops import consistent, find_loops
from ..extrapolation import positive, refuse_without_states, smooth
from ..plan import Iteration, Op, Plan, final_operations, initial_sweep, lay_out, operations


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
        operations([(Op.EXTERNAL,), *fresh, (Op.RECORD,), (Op.ITERATE,)]),
        final_operations(fresh),
        tuple(loop for _, loop in loops),
        operations(fresh),
        iteration=Iteration(positive("tolerance", tolerance), smooth(system, layout)),
    )
