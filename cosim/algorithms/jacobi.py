"""Jacobi: all inputs from the outputs at t_k, held over the step; then all instances step.

    u_k = L y_k,   (x_{k+1}, y_{k+1}) = step(x_k, u_k)

First order in the communication step. An output with direct feedthrough is that of the held inputs,
so a chain of n such instances delays a signal by n steps. Independent of the order of instances.

Source: Kübler and Schiehlen, Two methods of simulator coupling, 2000 (parallel scheme).
"""

from __future__ import annotations

from collections.abc import Sequence

from ..plan import Op, Plan, final_operations, initial_sweep, lay_out, operations
from ..system import System


def compile_plan(system: System, external: Sequence[str], observed: Sequence[str]) -> Plan:
    """Compile a system."""
    layout = lay_out(system, external, observed)
    everyone = range(len(layout.instances))
    step = [
        (Op.EXTERNAL,),
        (Op.RECORD,),
        (Op.COPY, 0, len(layout.copy_source)),
        *[(Op.SET, index) for index in everyone],
        *[(Op.STEP, index) for index in everyone],
        *[(Op.GET, index) for index in everyone],
        (Op.ENERGY,),
    ]
    return Plan(
        "jacobi", layout, initial_sweep(system, layout), operations(step), final_operations()
    )
