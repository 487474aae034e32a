"""Models made anew from a fitted one, of some of its effects."""

from __future__ import annotations

from collections.abc import Sequence

from ..calibrate.problem import Problem
from .candidates import Candidate
from .models import Fitted


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
        model=declared.model, constants=declared.constants, held=declared.held,
        parameters=[p for p in mine.parameters if p.role != "effect"],
    )  # fmt: skip
    for effect in effects:
        problem = effect.added_to(problem)
    problem = problem.hold(
        {
            p.name: mine.held.get(p.name, p.nominal)
            for p in problem.parameters if p.name not in kept
        }
    )  # fmt: skip
    return problem.with_parameters([kept[name] for name in problem.names])
