"""Which shapes of a law are simulated: those that its parameters say nature has.

A parameter that tells nothing but near its right value (a time constant, cycles per turn, a place
on the floor) is tried over its range, one parameter at a time.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..calibrate.parts import Parameter
from ..calibrate.simulator import Simulator
from .linear import SampleStack
from .orders import peaks, spectrum
from .probes import Probe
from .visits import followed, visited

Vector = NDArray[np.float64]
PLACES = 24
"""Places along a run that are tried: half a metre apart on a path of 12 m."""
APART = 10.0**0.5
"""Factor between the sizes that are tried. At the frequency where it shows most, a first-order lag
with a time constant that is wrong by a factor f has a cosine of 2 sqrt(f) / (1 + f) with the right
one: 0.96 at f = sqrt(APART), the worst between two tries, which hides 8 % of what it explains."""


def choices(
    probe: Probe,
    simulator: Simulator,
    theta: Vector,
    stack: SampleStack,
    seen: tuple[SampleStack, Vector],
) -> list[dict[str, float]]:
    """Values of a candidate's parameters to try, by name.

    Args:
        probe: the candidate in its system.
        simulator: of the system without it.
        theta: its parameters.
        stack: of the runs that are looked at.
        seen: runs whose residual over the noise tells how often something repeats; the more, the
            better, since an order shows where its shaft turns slowly enough.
    """
    found = []
    for p in probe.others:
        found += [{p.name: value} for value in (*p.hints.tries, *sizes(p))]
        if p.hints.cycles:
            found += [{p.name: n} for n in _orders(probe, p, simulator, theta, *seen)]
    visits = [(p.name, p.hints.visits) for p in probe.others if p.hints.visits]
    if visits:
        names, variables = zip(*visits, strict=True)
        points = visited(simulator, theta, stack.runs, variables, PLACES)
        found += [dict(zip(names, point.tolist(), strict=True)) for point in points]
    return found


def sizes(parameter: Parameter) -> list[float]:
    """Sizes of a parameter that nature leaves open over decades, none of others.

    They are evenly spaced in the logarithm, within its bounds; the FMU's own value is tried anyway.
    """
    if not parameter.hints.decades:
        return []
    low, high = parameter.hints.decades
    low, high = max(low, parameter.minimum), min(high, parameter.maximum)
    count = max(1, round(math.log(high / low) / math.log(APART)))
    values = [low * (high / low) ** (k / count) for k in range(count + 1)]
    return [value for value in values if value != parameter.nominal]


def _orders(
    probe: Probe,
    parameter: Parameter,
    simulator: Simulator,
    theta: Vector,
    stack: SampleStack,
    residual: Vector,
) -> list[float]:
    """Cycles per turn that the residual has over the angle of the effect, which is absent.

    Of an effect on several shafts, over any of their angles.
    """
    whole = probe.problem.nominal
    whole[: theta.size] = theta
    member, variables = probe.problem.system().variables(parameter.hints.cycles)
    names = [f"{member.name}.{element}" for v in variables for element in v.elements()]
    paths = followed(simulator.of(probe.problem), whole, stack.runs, names)
    times, residuals = [run.times for run in stack.runs], stack.by_run(residual)
    power = [spectrum(times, [path[:, k] for path in paths], residuals) for k in range(len(names))]
    return peaks(np.sum(power, axis=0))
