"""The scene of a system: those of its FMUs, with the numbers of their parameters put in."""

from __future__ import annotations

import copy
from collections import OrderedDict
from collections.abc import Mapping
from typing import Any

from ..spec.scene import fitted, formulas, names
from ..system.system import Member, System

Scenes = dict[str, list[dict[str, Any]]]
"""Instance -> nodes, whose formulas hold numbers and names of signals (without the instance)."""
MOVING = ("output", "input", "local")
"""Causalities of what may change in a run; a scene takes parameters as they were at its begin."""


def scenes(system: System) -> Scenes:
    """The scenes of a system's instances, as a recording keeps them."""
    found = {}
    for member in system.members.values():
        looks = member.description.extra.get("scene")
        if looks:
            found[member.name] = _looks(member, looks)
    return {instance: nodes for instance, nodes in found.items() if nodes}


_FITTED: OrderedDict[tuple[str, frozenset[tuple[str, float]]], list[dict[str, Any]]] = OrderedDict()
"""Scenes by FMU and parameters, the last ones: a study runs the same ones again and again."""
KEPT = 64


def _looks(member: Member, looks: list[dict[str, Any]]) -> list[dict[str, Any]]:
    numbers = _numbers(member)
    key = member.fmu.digest, frozenset(numbers.items())
    known = _FITTED.get(key)
    if known is None:
        known = fitted(looks, _signals(member).__contains__, numbers)
        while len(_FITTED) >= KEPT:
            _FITTED.popitem(last=False)
        _FITTED[key] = known
    return copy.deepcopy(known)


def _signals(member: Member) -> set[str]:
    return {
        element
        for variable in member.description.variables.values()
        if variable.causality in MOVING
        for element in variable.elements()
    }


def _numbers(member: Member) -> dict[str, float]:
    """Parameters by scalar name."""
    found: dict[str, float] = {}
    for variable in member.description.variables.values():
        if variable.causality in MOVING or variable.causality == "independent":
            continue
        given = member.parameters.get(variable.name, variable.start)
        items = list(given) if isinstance(given, (list, tuple)) else [given]
        for element, item in zip(variable.elements(), items, strict=False):
            own = member.parameters.get(element, item)
            if isinstance(own, (int, float)) and not isinstance(own, bool):
                found[element] = float(own)
    return found


def needs(found: Mapping[str, list[dict[str, Any]]]) -> list[str]:
    """Full names of the signals that scenes show."""
    return list(
        dict.fromkeys(
            f"{instance}.{name}"
            for instance, nodes in found.items()
            for node in nodes
            for formula in formulas([node["pose"], node["shapes"]])
            for name in names(formula)
        )
    )
