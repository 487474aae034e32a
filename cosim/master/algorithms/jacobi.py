"""Jacobi: all inputs from the outputs at t_k, held over the step; then all instances step.

    u_k = L y_k,   (x_{k+1}, y_{k+1}) = step(x_k, u_k)

First order in the communication step. An output with direct feedthrough is that of the held inputs,
so a chain of n such instances delays a signal by n steps. Independent of the order of instances.
Relays (adapters between two FMUs) are no such instances: their outputs are fetched anew at t_k.

Options:
    extrapolation: order 1 or 2 lets continuous inputs follow the polynomial through the last
        outputs, and outputs with direct feedthrough are fetched anew at t_k; second order in the
        communication step. FMUs that cannot interpolate inputs get the mean of the polynomial over
        the step (weights of Adams and Bashforth).
    substeps: instance -> n, for instances that go n steps per communication step and exchange at
        each; what comes from slower instances is held. The energy of their power bonds is not
        accounted for.
    inner_steps: instance -> n, with extrapolation, for instances whose inputs cannot move: they go
        n steps per communication step, with their inputs at the mean of the polynomial over each,
        and exchange nothing in between.

Source: Kübler and Schiehlen, Two methods of simulator coupling, 2000 (parallel scheme); Busch,
Continuous approximation techniques for co-simulation methods, 2016 (extrapolation).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ...system.system import System
from ..algebraic_loops import consistent, find_loops, reached, relayed
from ..extrapolation import (
    factors,
    inner_factors,
    inner_rows,
    means,
    set_derivatives,
    side_by_side,
    without_parts,
)
from ..plan import Op, Plan, final_operations, initial_sweep, lay_out, operations


def compile_plan(
    system: System,
    external: Sequence[str],
    observed: Sequence[str],
    *,
    extrapolation: int = 0,
    substeps: Mapping[str, int] | None = None,
    inner_steps: Mapping[str, int] | None = None,
) -> Plan:
    """Compile a system."""
    parts = factors(system, substeps)
    layout = without_parts(lay_out(system, external, observed), parts)
    everyone = range(len(layout.instances))
    inner = inner_factors(system, inner_steps, extrapolation, substeps)
    extrapolated, spans = means(system, layout, extrapolation, inner=inner)
    loops = find_loops(system, layout)
    fresh = consistent(system, layout, loops, only_loops=extrapolation == 0)
    if extrapolation == 0:
        passed = relayed(system, layout)
        fresh = [*passed, *fresh, *(passed if fresh else ())]
    # extrapolation: outputs are fetched anew at the end of the step, where their energy counts too
    again = extrapolation == 0 or reached(system, layout)
    step: list[tuple[int, ...]] = [(Op.EXTERNAL,), *(fresh if again else ()), (Op.RECORD,)]
    if extrapolated:
        step.append((Op.NOTE,))
    if max(parts.values()) > 1:
        step += side_by_side(layout, parts, extrapolated, spans, inner)
    else:
        step.append((Op.COPY, 0, len(layout.copy_source)))
        if extrapolated:
            step.append((Op.EXTRAPOLATE, 0, len(extrapolated)))
        step += [(Op.SET, index) for index in everyone]
        for index in everyone:
            step += set_derivatives(extrapolated, spans, index)
        for index, factor in enumerate(inner[name] for name in layout.instances):
            in_parts = inner_rows(extrapolated, spans, index, factor)
            step += in_parts if factor > 1 else [(Op.STEP, index)]
        step += [(Op.GET, index) for index in everyone]
    step += [(Op.HOLD,), *fresh, (Op.ENERGY, 1)] if extrapolated else [(Op.ENERGY,)]
    return Plan(
        layout,
        initial_sweep(system, layout),
        operations(step),
        final_operations(fresh),
        tuple(loop for _, loop in loops),
        operations(consistent(system, layout, loops, only_loops=False)),
        tuple(extrapolated),
    )
