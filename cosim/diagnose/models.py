"""Fitted models, and which of two is better on the same data."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..calibrate.estimate import Estimate
from ..calibrate.parts import Parameter
from ..calibrate.problem import Problem
from ..calibrate.simulator import Simulator
from .candidates import Candidate
from .facts import Value
from .linear import SampleStack
from .signature import Signature
from .values import Values

Vector = NDArray[np.float64]
LEVEL = 0.01
"""Family-wise probability of naming an effect on data that lack none."""
GATE = math.log(1.0 / LEVEL)
"""Log likelihood that unused data must gain where two models are compared [nats]. The likelihood
ratio of two fixed models has mean 1 if the simpler one is true, so it exceeds 1/LEVEL with at most
the probability LEVEL. A verdict asks for more, by the number of candidates: `verdict.threshold`."""
GATE_Z = 2.0
"""Standard deviations by which it must differ from 0, residuals correlated within blocks: one in
forty by chance, beside a gain that must exceed `GATE`, which counts residuals as white."""
OPEN = 4.0
"""Mean square over the noise's from which the best model of a round evidently lacks more: twice the
noise; one that is stated wrongly is mostly less far off."""


@dataclass
class Fitted:
    """A model fitted to the identification runs.

    Attributes:
        effects: what was added to the declared system.
        estimate: parameters.
        values: what it gives in all runs.
        signature: score of the effect that was added last.
        gate: gain on unused runs against the model that it was last compared with: that of the
            round before, if a round has fitted it.
    """

    effects: tuple[Candidate, ...]
    estimate: Estimate
    values: Values
    signature: Signature | None = None
    gate: Gate | None = None

    @property
    def fit(self) -> Vector:
        """Model values over sigma in identification runs."""
        return self.values.fit

    @property
    def check(self) -> Vector:
        """The same in validation runs."""
        return self.values.check

    @property
    def labels(self) -> frozenset[str]:
        """Of its effects."""
        return frozenset(c.label for c in self.effects)

    @property
    def problem(self) -> Problem:
        """What was fitted."""
        return self.estimate.problem

    @property
    def simulator(self) -> Simulator:
        """Of what was fitted."""
        return self.estimate.simulator

    @property
    def free(self) -> int:
        """Number of parameters that were fitted."""
        return int(self.estimate.theta.size)

    @property
    def quantity(self) -> str:
        """Name of the last effect's strength among its parameters, "" without one."""
        if self.signature is None:
            return ""
        return self.signature.strength.name.removeprefix(self.effects[-1].prefix)

    @property
    def complexity(self) -> int:
        """Number of parameters that were fitted or tried from a list: cogging with one cycle per
        turn is an unbalance that had its number of cycles chosen.
        """
        fixed = self.signature.fixed if self.signature is not None else {}
        return self.free + len(set(fixed) - set(self.problem.names))


@dataclass(frozen=True)
class Gate:
    """Two models on the same runs.

    Attributes:
        gain: log likelihood of the second less that of the first [nats].
        z: in robust standard deviations.
    """

    gain: float
    z: float

    @property
    def passed(self) -> bool:
        """Whether the second is better, with no other to choose from."""
        return self.gain > GATE and self.z > GATE_Z


def compare(data: Vector, first: Vector, second: Vector, stack: SampleStack) -> Gate:
    """Compare two sets of model values against data (all over sigma).

    Where runs may turn unstable, windows that are far off count as in `loss.Windowed`. z tests
    whether the data move from the first towards the second: both are fixed beforehand.
    """
    residual, rest = data - first, data - second
    gain = stack.cost(residual) - stack.cost(rest)
    root = stack.root(residual, rest)
    direction, residual = root * (second - first), root * residual
    square = float(direction @ direction)
    if square <= 0.0:
        return Gate(0.0, 0.0)
    # middle of the two: positive where the second is nearer
    middle = residual - 0.5 * direction
    amplitude = float(direction @ middle)
    sums = stack.sums(direction * (residual - direction * float(direction @ residual) / square))
    return Gate(gain, amplitude / math.sqrt(max(float(sums @ sums), square)))


def value_of(parameter: Parameter, estimate: Estimate) -> Value:
    """A parameter with what an estimate says of the one of this name."""
    i, p = estimate.problem.index(parameter.name), parameter
    return Value(
        p.name, p.unit, float(estimate.theta[i]), float(estimate.low[i]), float(estimate.high[i]),
        p.minimum, p.maximum, bool(estimate.identifiable[i]),
    )  # fmt: skip


def more_general(first: Fitted, second: Fitted) -> bool:
    """Whether a model has more parameters for what it adds at the same place.

    Places where an effect does the same are one place.
    """
    item = second.signature
    same = {label.partition(" at ")[2] for label in (item.same if item is not None else ())}
    places = {second.effects[-1].place, *same}
    return first.effects[-1].place in places and first.complexity > second.complexity


def is_open(estimate: Estimate) -> bool:
    """Whether a fitted model evidently lacks something."""
    return 2.0 * estimate.robust > OPEN * estimate.count


def absent(fitted: Fitted, effect: Candidate) -> dict[str, float]:
    """Values of an effect's parameters with which it does nothing."""
    return {
        p.name: p.absent if p.strength else value
        for p, value in zip(fitted.problem.parameters, fitted.estimate.theta.tolist(), strict=True)
        if p.name.startswith(effect.prefix)
    }
