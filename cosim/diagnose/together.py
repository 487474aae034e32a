"""Effects fitted together with all declared parameters, from where first orders lead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..calibrate.simulator import Simulator
from ..errors import CosimError
from .candidates import new_parameters
from .models import GATE, Fitted, is_open
from .secant import FLOOR, patience
from .signature import Signature

if TYPE_CHECKING:
    from .fitter import Fitter

Vector = NDArray[np.float64]
USUAL = 2.1
"""Usual values of a strength (see `SearchHints.tries`) by a larger factor away from what its first
order asks for are no places to begin."""
EXACT = 0.1
"""Share of a trial's strength by which the residual may ask for another one, and it is the same."""
DOUBLINGS = 6
"""Times at most that a strength to begin with is doubled."""


def together(
    fitter: Fitter,
    base: Fitted,
    items: Sequence[Signature],
    amplitudes: Sequence[float],
    *,
    again: bool = True,
) -> Fitted | None:
    """Fit the declared parameters and the strengths of some effects together.

    Args:
        fitter: of the search.
        base: model without the effects.
        items: the effects.
        amplitudes: factors on their signatures that the residual asks for.
        again: from nominal values, too, where the base and a quick fit are far off.

    Returns:
        None if they cannot be simulated.
    """
    problem = base.problem
    for item in items:
        problem = item.candidate.added_to(problem)
    _, others = new_parameters(base.problem, problem)
    values, usual, moved = {}, {}, {p.name: p for p in problem.parameters}
    for item, amplitude in zip(items, amplitudes, strict=True):
        strength = item.strength
        value = item.value * (amplitude or 1.0)
        value = float(np.clip(value, strength.minimum, strength.maximum))
        span, least = abs(value) or strength.span, strength.minimum
        if strength.unit == "s":
            least = FLOOR * strength.span
            value = max(value, least)
        values[strength.name] = value
        name = strength.name
        moved[name] = replace(moved[name], span=span, minimum=least)
        usual[name] = [v for v in strength.hints.tries if 1.0 / USUAL < v / value < USUAL]
        if abs(amplitude - 1.0) > EXACT:
            usual[name].append(item.value)  # as simulated: a steep law goes too far from there
    seconds = {item.probe.second: item.second for item in items if item.probe.second}
    problem = problem.with_parameters([moved[p.name] for p in problem.parameters])
    fixed = {name: value for item in items for name, value in item.fixed.items()}
    held = {p.name: fixed.get(p.name, p.nominal) for p in others if p.name not in seconds}
    if held:
        problem = problem.hold(held)
    simulator = base.simulator.of(problem).limited(patience(base.simulator))
    root = fitter.fitting.root(fitter.fit_data - base.fit)
    absorber = fitter.absorber(base, fitter.fitting, root)
    residual = fitter.fit_data - base.fit
    for item, amplitude in zip(items, amplitudes, strict=True):
        residual = residual - amplitude * item.change
    shift = absorber.change(np.asarray(root * residual, dtype=np.float64)) * base.problem.scale
    tenth = {name: 0.1 * value for name, value in values.items()}
    near = [{**values, name: value} for name, found in usual.items() for value in found]
    starts = []
    for factor, begun in ((1.0, values), (0.0, values), (0.0, tenth),
                          *((1.0, v) for v in near)):  # fmt: skip
        theta = problem.nominal
        count = base.estimate.theta.size
        theta[:count] = base.estimate.theta + factor * shift
        for name, value in {**begun, **seconds}.items():
            theta[problem.index(name)] = value
        starts.append(np.clip(theta, problem.lower, problem.upper))
    try:
        costs = [fitter.cost(simulator, theta) for theta in starts]
        start, cost = starts[int(np.argmin(costs))], min(costs)
        if is_open(base.estimate):
            for name in values:
                start, cost = _doubled(fitter, simulator, start, cost, name)
        result = fitter.fitted(simulator, start, base.estimate)
        if again and fitter.far(base) and fitter.far(result):
            kept = fitter.effects(base)
            own = (*values, *seconds)
            kept |= {name: float(starts[0][problem.index(name)]) for name in own}
            anew = fitter.anew(simulator, kept, base)
            if anew is not None and anew.estimate.robust < result.estimate.robust:
                result = anew
    except CosimError as error:
        labels = " + ".join(item.candidate.label for item in items)
        fitter.say(f"{labels} could not be refitted: {error}")
        return None
    result.effects = (*base.effects, *(item.candidate for item in items))
    result.signature = items[-1]
    return result


def _doubled(
    fitter: Fitter, simulator: Simulator, theta: Vector, cost: float, name: str
) -> tuple[Vector, float]:
    """A place to begin with a larger strength, as long as that is better.

    First orders ask for too little of what shifts oscillations, such as play.
    """
    problem = simulator.problem
    place = problem.index(name)
    for _ in range(DOUBLINGS):
        trial = theta.copy()
        trial[place] = np.clip(2.0 * theta[place], problem.lower[place], problem.upper[place])
        now = fitter.cost(simulator, trial)
        if not now < cost - GATE:
            break
        theta, cost = trial, now
    return theta, cost
