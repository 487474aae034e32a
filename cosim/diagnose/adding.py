"""What the diagnosed model is made of, so that users can run it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from ..calibrate.parts import LOGGED
from ..calibrate.problem import Problem
from ..installation import places
from .models import Fitted

WIDE = 3.0
"""Bounds of a value that was found, over it: wide enough for another machine of the same kind."""


def made_of(problem: Problem, fitted: Fitted | None) -> dict[str, Any]:
    """Variants that differ from the declared ones, and calibrated values, by full names.

    Values of single runs are left out. `logged` has those that a mapping sets: clocks, and what is
    wrong with columns.

    Args:
        problem: as declared.
        fitted: the model, None where there is none.
    """
    table: dict[str, Any] = {
        "scenario": scenario_of(problem),
        "variants": {},
        "values": {},
        "logged": {},
    }
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
            for name, own in parameter.set(value).items():
                table["logged" if name.startswith(LOGGED) else "values"][name] = own
    given = {n: v for n, v in estimate.problem.constants.items() if n not in problem.constants}
    mine = tuple(f"{item.place}." for item in fitted.effects)
    held = {n: v for n, v in given.items() if n.startswith(mine) and not n.startswith(LOGGED)}
    table["values"] = held | table["values"]
    return table


def lines_of(
    model: Mapping[str, Mapping[str, Any]], places: Collection[str]
) -> tuple[list[str], list[str]]:
    """What to write in the system file, and in the mapping, for the model that was found.

    Args:
        model: as of `made_of`.
        places: of what was found, whose values are new.
    """
    mine = tuple(f"{place}." for place in places)
    new = {n: v for n, v in model["values"].items() if n.startswith(mine)}
    system = []
    if model["variants"]:
        system = ["[instances]", *(f'{n} = "{v}"' for n, v in model["variants"].items())]
        system += ["[parameters]", *(f'"{n}" = {v:.6g}' for n, v in new.items())] if new else []
    mapping = []
    for target, value in {**new, **model["logged"]}.items():
        ends = sorted((value / WIDE, value * WIDE)) if value else [-1.0, 1.0]
        mapping += [
            "[[parameter]]", f'name = "{target.replace(":", " ")}"', f"nominal = {value:.6g}",
            f"min = {ends[0]:.3g}", f"max = {ends[1]:.3g}", f'targets = "{target}"',
        ]  # fmt: skip
    return system, mapping


def scenario_of(problem: Problem) -> str:
    """The scenario beside the mapping, "" if there is none."""
    path = problem.source.path.parent / "scenario.toml"
    if not path.is_file():
        return ""
    folder = path.parent.resolve()
    home = places.scenarios().resolve()
    return folder.relative_to(home).as_posix() if folder.is_relative_to(home) else str(path)
