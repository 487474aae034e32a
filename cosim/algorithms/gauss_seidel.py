"""Gauss-Seidel: instances step one after the other, each with the newest outputs there are.

    for i in order of direct feedthrough:  u_i = (L y)_i,  step i,  fetch y_i

Instances behind others see the end values of the step, so a chain in the order of direct
feedthrough passes a signal on without delay. First order in the communication step; the result
depends on the order.

Source: Kübler and Schiehlen, Two methods of simulator coupling, 2000 (sequential scheme).
"""

from __future__ import annotations

from collections.abc import Sequence

from ..plan import Op, Plan, exchange, final_operations, initial_sweep, lay_out, operations
from ..system import System


def compile_plan(system: System, external: Sequence[str], observed: Sequence[str]) -> Plan:
    """Compile a system."""
    layout = lay_out(system, external, observed)
    position = {name: index for index, name in enumerate(layout.instances)}
    step: list[tuple[int, ...]] = [(Op.EXTERNAL,), (Op.RECORD,)]
    for name in system.order():
        index = position[name]
        step += exchange(layout, index)
        step += [(Op.STEP, index), (Op.GET, index)]
    step.append((Op.ENERGY,))
    return Plan(
        "gauss_seidel", layout, initial_sweep(system, layout), operations(step), final_operations()
    )
