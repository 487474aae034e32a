"""Inputs that move within a step: what FMUs are told of them before it, or asked for within it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..fmu.instance import Instance
from ..fmu.variables import Variable
from ..system.system import System
from .plan import Op, Plan

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Call:
    """Derivatives of one order of one instance's inputs.

    Attributes:
        instance: position.
        references: of the inputs.
        orders: of the derivatives, one per input.
        values: the derivatives, a part of `InputDerivatives.slope` or `InputDerivatives.curve`.
    """

    instance: int
    references: NDArray[np.uint32]
    orders: NDArray[np.int32]
    values: Vector


def asked_for(plan: Plan, system: System) -> list[list[Variable]]:
    """Per instance the whole inputs for which it may ask within a step."""
    found: list[dict[str, Variable]] = [{} for _ in plan.layout.instances]
    for mean in plan.means:
        if mean.moving and not mean.told and mean.parts == 1:
            owner, _, name = plan.layout.names[mean.target].partition(".")
            variable = system.members[owner].description.whole(name)
            found[mean.instance][variable.name] = variable
    return [list(variables.values()) for variables in found]


class InputDerivatives:
    """Derivatives of the inputs that move, at the begin of the step.

    Args:
        plan: of the run.
        instances: whose inputs they are.
        exchanged: all values of the run; those of moving inputs are those at the begin.

    Attributes:
        average: mean over the step, per mean of the plan (of bonds and of those that are held).
        slope, curve: first and second derivative, likewise.
        calls: per SET_DERIVATIVES operation (first, behind last mean), what FMUs of FMI 2 are told.
    """

    def __init__(self, plan: Plan, instances: Sequence[Instance], exchanged: Vector) -> None:
        self._instances = instances
        count = len(plan.means)
        self.average, self.slope, self.curve = np.zeros(count), np.zeros(count), np.zeros(count)
        self.calls: dict[tuple[int, int], tuple[Call, ...]] = {}
        layout = plan.layout
        for first, last in {(a, b) for op, a, b in plan.step.tolist() if op == Op.SET_DERIVATIVES}:
            means = plan.means[first:last]
            index = means[0].instance
            instance = instances[index]
            begin = len(layout.instances[index]) + 1
            references = np.array(
                [
                    instance.description.find(layout.names[m.target][begin:]).reference
                    for m in means
                ],
                dtype=np.uint32,
            )
            derivatives = [self.slope, self.curve][: max(mean.order for mean in means)]
            self.calls[first, last] = tuple(
                Call(
                    index,
                    references,
                    np.full(len(means), order, dtype=np.int32),
                    values[first:last],
                )
                for order, values in enumerate(derivatives, start=1)
            )

        places = {mean.target: place for place, mean in enumerate(plan.means)}
        slots = {name: slot for slot, name in enumerate(layout.names)}
        for owner, instance in zip(layout.instances, instances, strict=True):
            if instance.moved is not None:
                own = [slots[f"{owner}.{name}"] for name in instance.moved.names]
                held = [places.get(slot, -1) for slot in own]
                instance.moved.follow(
                    exchanged, self.slope, self.curve,
                    np.array(own, dtype=np.int64), np.array(held, dtype=np.int64),
                )  # fmt: skip

    def tell(self, first: int, last: int) -> None:
        """Tell an instance how its inputs move."""
        for call in self.calls[first, last]:
            self._instances[call.instance].set_input_derivatives(
                call.references, call.orders, call.values
            )
