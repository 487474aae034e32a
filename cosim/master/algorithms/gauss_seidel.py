"""Gauss-Seidel: instances step one after the other, each with the newest outputs there are.

    for i in order of direct feedthrough:  u_i = (L y)_i,  step i,  fetch y_i

Instances behind others see the end values of the step, so a chain in the order of direct
feedthrough passes a signal on without delay. First order in the communication step; the result
depends on the order.

Options:
    extrapolation: order 1 or 2 lets continuous inputs follow the polynomial through the last
        outputs; where the source has stepped already (and has no direct feedthrough, or follows its
        own inputs within the step), its new value counts too. Second order. FMUs that cannot
        interpolate inputs get the mean of the polynomial over the step (weights of Adams and
        Bashforth, of Adams and Moulton).
    inner_steps: instance -> n, with extrapolation, for instances whose inputs cannot move: they go
        n steps per communication step, with their inputs at the mean of the polynomial over each,
        and exchange nothing in between.

Source: Kübler and Schiehlen, Two methods of simulator coupling, 2000 (sequential scheme); Busch,
Continuous approximation techniques for co-simulation methods, 2016 (extrapolation).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ...system.system import System
from ..algebraic_loops import consistent, find_loops, reached
from ..extrapolation import inner_factors, inner_rows, means, set_derivatives
from ..plan import Op, Plan, exchange, final_operations, initial_sweep, lay_out, operations


def compile_plan(
    system: System,
    external: Sequence[str],
    observed: Sequence[str],
    *,
    extrapolation: int = 0,
    inner_steps: Mapping[str, int] | None = None,
) -> Plan:
    """Compile a system."""
    layout = lay_out(system, external, observed)
    position = {name: index for index, name in enumerate(layout.instances)}
    inner = inner_factors(system, inner_steps, extrapolation)
    extrapolated, spans = means(system, layout, extrapolation, system.order(), inner)
    loops = find_loops(system, layout)
    fresh = consistent(system, layout, loops, only_loops=extrapolation == 0)
    # extrapolation: outputs are fetched anew at the end of the step, where their energy counts too.
    # Inputs that moved there would nearly do; but a chain of feedthrough (gearboxes) extrapolates
    # a signal twice then, and the speed loop of a slipping wheel becomes unstable
    again = extrapolation == 0 or reached(system, layout)
    step: list[tuple[int, ...]] = [(Op.EXTERNAL,), *(fresh if again else ()), (Op.RECORD,)]
    if extrapolated:
        step.append((Op.NOTE,))
    for name in system.order():
        index = position[name]
        copy, set_ = exchange(layout, index)
        step.append(copy)
        if spans[index][0] < spans[index][1]:
            step.append((Op.EXTRAPOLATE, *spans[index]))
        if inner[name] > 1:
            step += inner_rows(extrapolated, spans, index, inner[name])
        else:
            step += [set_, *set_derivatives(extrapolated, spans, index), (Op.STEP, index)]
        step.append((Op.GET, index))
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
