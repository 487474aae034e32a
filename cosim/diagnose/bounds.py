"""Parameters that end at a bound of the mapping, and the declared model with these bounds opened.

A bound in the wrong place is a fault like any other: laws and gains of sensors make up for it. So
the declared model that may go on beyond it is a rival of every set of laws.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

from ..calibrate.deferred import corrected
from ..calibrate.fit import CORRECTION, DRAFT, fit
from ..calibrate.parts import Parameter
from ..calibrate.problem import Problem
from ..display.html import unit as shown_unit
from ..errors import CosimError, UnknownNameError
from .facts import Value
from .fitter import Fitter
from .models import Fitted, is_open, value_of

ROOM = 10.0
"""Times as far from 0 that a bound is opened, or as near: an order of magnitude, in which a device
is still of the same kind. A bound of 0 stays: beyond it a mass or a friction is none."""


def opened(fitter: Fitter, declared: Fitted) -> Fitted | None:
    """The declared model fitted with the bounds opened at which its parameters ended.

    None if none did, or nothing can be simulated there.

    Args:
        fitter: fits it; its memo keeps the declared model.
        declared: the fit within the bounds.
    """
    raw, problem = fitter.raw, declared.problem
    wider = [_opened(p, ended(p, declared), problem) for p in problem.parameters]
    if wider == list(problem.parameters):
        return None
    near = fitter.simulator.of(problem.with_parameters(wider))
    try:
        found = fit(near, declared.estimate.theta, effort=DRAFT)
        if is_open(found):  # no rival, and errors of the exchange are small beside what it lacks
            return fitter.judged(found)
        for effort in (DRAFT, CORRECTION):
            begin = found.theta
            simulator = fitter.simulator.of(raw.with_parameters(wider))
            found = fit(corrected(simulator, begin, raw), begin, effort=effort)
        return fitter.judged(found)
    except CosimError as error:
        fitter.say(f"the declared model with its bounds opened: {error}")
        return None


def ended(parameter: Parameter, fitted: Fitted) -> str:
    """The key of the bound at which a declared parameter ended: `min`, `max`, "" if at none."""
    if parameter.role != "declared" or parameter.name not in fitted.estimate.at_bound:
        return ""
    value = fitted.estimate.values[parameter.name]
    return "max" if parameter.maximum - value < value - parameter.minimum else "min"


def beyond(declared: Fitted, found: Fitted) -> tuple[Value, ...]:
    """Values of the opened parameters, with the bounds that the mapping gives them."""
    return tuple(
        value_of(p, found.estimate)
        for p in declared.problem.parameters
        if _opened(p, ended(p, declared), declared.problem) != p
    )


def told(before: Fitted, after: Fitted) -> Iterable[str]:
    """Warnings of declared parameters that ended at a bound."""
    models = [("the declared model", before)]
    if after is not before:
        models.append(("the model with what was found", after))
    where: dict[str, list[str]] = {}
    for model, fitted in models:
        for p in fitted.problem.parameters:
            if key := ended(p, fitted):
                bound = p.maximum if key == "max" else p.minimum
                text = f"{p.name} ({key} = {bound:.4g} {shown_unit(p.unit)}".rstrip() + ")"
                where.setdefault(text, []).append(model)
    together: dict[str, list[str]] = {}
    for text, found in where.items():
        together.setdefault(" and in ".join(found), []).append(text)
    for found_in, names in together.items():
        yield (
            f"{', '.join(names)} ended at {'its bound' if len(names) == 1 else 'their bounds'} in "
            f"{found_in}: laws and other parameters may make up for what lies beyond; give wider "
            "bounds in the mapping if the machine may be there"
        )


def _opened(parameter: Parameter, key: str, problem: Problem) -> Parameter:
    """A parameter with more room at one of its bounds, as far as FMUs take it; steps as before."""
    low, high = parameter.minimum, parameter.maximum
    if key == "max":
        farther = high * (ROOM if high > 0.0 else 1.0 / ROOM)
        high = max(high, min([farther, *(top for _, top in _taken(parameter, problem))]))
    elif key == "min":
        farther = low * (ROOM if low < 0.0 else 1.0 / ROOM)
        low = min(low, max([farther, *(bottom for bottom, _ in _taken(parameter, problem))]))
    if (low, high) == (parameter.minimum, parameter.maximum):
        return parameter
    return replace(parameter, minimum=low, maximum=high, span=parameter.scale)


def _taken(parameter: Parameter, problem: Problem) -> Iterator[tuple[float, float]]:
    """Between which values of a declared parameter what it sets is within the FMUs' bounds."""
    for name, factor in parameter.targets:
        try:
            _, variables = problem.system().variables(name)
        except UnknownNameError:  # an error of the log, which no FMU bounds
            continue
        for variable in variables:
            low = -math.inf if variable.minimum is None else variable.minimum
            high = math.inf if variable.maximum is None else variable.maximum
            yield min(low / factor, high / factor), max(low / factor, high / factor)
