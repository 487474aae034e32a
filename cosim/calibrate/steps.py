"""Reads from a mapping how finely its system is run, and how coarsely in a search."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ..errors import ScenarioError
from ..files import flatten
from .parts import Coarse


def steps(table: Mapping[str, Any], where: str) -> tuple[Coarse, float | None]:
    """How a mapping's system is run in a search, and the tick of its rig.

    Args:
        table: the mapping.
        where: of it, for errors.

    Raises:
        ScenarioError: the tick is no whole number of steps, or a search differs from the rest with
            nothing to measure it against.
    """
    step, tick = float(table["step"]), table.get("tick")
    if tick is not None:
        parts = float(tick) / step
        if round(parts) < 1 or not math.isclose(parts, round(parts)):
            raise ScenarioError(
                f"{where}: tick = {tick} s is no whole number of steps of {table['step']} s; the "
                "step must divide the rig's tick"
            )
    coarse, search = table.get("search_step"), table.get("search", {})
    if search and (coarse is None or coarse == table["step"] or tick is None):
        raise ScenarioError(
            f"{where}: [search] needs a search_step other than step = {table['step']} and the "
            "rig's tick: its error is measured against this step"
        )
    parameters = {name: float(v) for name, v in flatten(search.get("parameters", {})).items()}
    if coarse is None:
        return Coarse(step), tick
    return Coarse(float(coarse), search.get("options", {}), parameters), tick
