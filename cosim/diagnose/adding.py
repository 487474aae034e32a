"""What the diagnosed model is made of, so that users can run it."""

from __future__ import annotations

from typing import Any

from ..calibrate.parts import LOGGED
from ..calibrate.problem import Problem
from ..installation import places
from .models import Fitted


def made_of(problem: Problem, fitted: Fitted | None) -> dict[str, Any]:
    """Variants that differ from the declared ones, and calibrated values, by full names.

    Values of single runs are left out.

    Args:
        problem: as declared.
        fitted: the model, None where there is none.
    """
    table: dict[str, Any] = {"scenario": scenario_of(problem), "variants": {}, "values": {}}
    if fitted is None:
        return table
    declared, model = problem.instances, problem.model
    for item in fitted.effects:
        model = model.changed(item.change)
    table["variants"] = {
        name: variant for name, variant in model.instances.items() if variant != declared[name]
    }
    estimate = fitted.estimate
    for parameter, value in zip(estimate.problem.parameters, estimate.theta.tolist(), strict=True):
        if parameter.role != "nuisance" and not parameter.run:
            own = parameter.set(value).items()
            table["values"].update((n, v) for n, v in own if not n.startswith(LOGGED))
    given = {n: v for n, v in estimate.problem.constants.items() if n not in problem.constants}
    mine = tuple(f"{item.place}." for item in fitted.effects)
    held = {n: v for n, v in given.items() if n.startswith(mine) and not n.startswith(LOGGED)}
    table["values"] = held | table["values"]
    return table


def scenario_of(problem: Problem) -> str:
    """The scenario beside the mapping, "" if there is none."""
    path = problem.source.path.parent / "scenario.toml"
    if not path.is_file():
        return ""
    folder = path.parent.resolve()
    home = places.scenarios().resolve()
    return folder.relative_to(home).as_posix() if folder.is_relative_to(home) else str(path)
