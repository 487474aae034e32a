"""Models made anew from a fitted one: of some of its effects, and with all of their parameters."""

from __future__ import annotations

from collections.abc import Sequence

from ..calibrate.problem import Problem
from ..errors import CosimError
from .candidates import Candidate
from .late import LateFitter
from .models import GATE, Fitted, compare


def freed(search: LateFitter, fitted: Fitted, base: Fitted) -> Fitted:
    """The model with all parameters of its effects fitted, if unused runs want that.

    Args:
        search: fits and judges.
        fitted: the model.
        base: from which its gain counts.
    """
    problem = fitted.problem
    mine = {p.name: p for p in problem.parameters}
    whole = problem.changed(
        model=search.raw.model, constants=search.raw.constants,
        parameters=[p for p in problem.parameters if p.role != "effect"],
    )  # fmt: skip
    for effect in fitted.effects:
        whole = effect.added_to(whole)
    whole = whole.with_parameters([mine.get(p.name, p) for p in whole.parameters])
    if len(whole.parameters) == len(mine):
        return fitted
    theta = whole.nominal
    for name, value in fitted.estimate.values.items():
        theta[whole.index(name)] = value
    for p in whole.parameters:
        if p.name not in mine:
            theta[whole.index(p.name)] = problem.constants.get(p.name, p.nominal)
    try:
        found = search.fitted(search.simulator.of(whole), theta, fitted.estimate)
        found = search.sharpened(search.again(found, fitted, base), base, draft=True)
    except CosimError as error:
        search.say(f"{fitted.effects[-1].label} with all parameters: {error}")
        return fitted
    gate = compare(search.check_data, fitted.check, found.check, search.checking)
    return found if search.gain(fitted, found) > GATE and gate.passed else fitted


def composed(declared: Problem, fitted: Fitted, effects: Sequence[Candidate]) -> Problem:
    """The problem of a fitted model with some of its effects only, made anew.

    What was held of other effects is forgotten: how sharply a law sticks where the model lacked
    more is no property of it.

    Args:
        declared: without effects.
        fitted: the model.
        effects: which of its effects stay.
    """
    mine = fitted.problem
    kept = {p.name: p for p in mine.parameters}
    problem = mine.changed(
        model=declared.model, constants=declared.constants,
        parameters=[p for p in mine.parameters if p.role != "effect"],
    )  # fmt: skip
    for effect in effects:
        problem = effect.added_to(problem)
    held = {
        name: mine.constants.get(name, value)
        for p in problem.parameters if p.name not in kept
        for name, value in p.set(p.nominal).items()
    }  # fmt: skip
    parameters = [kept[p.name] for p in problem.parameters if p.name in kept]
    return problem.changed(parameters=parameters, constants={**problem.constants, **held})
