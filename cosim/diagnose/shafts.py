"""Where the shafts of periodic effects stand when a run begins.

A law that repeats over the angle of a shaft integrates the shaft's speed where its balance offers
no angle, from 0 in each run; its phase would be another one in each. If that angle moves in
proportion with one of which the log says where it begins,

    theta(t) - theta(0) = c (phi(t) - phi(0))      in all runs,

both are one shaft, or one is geared to the other, and theta(0) = c phi(0).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..calibrate.problem import Problem, shaft
from ..calibrate.simulator import Simulator
from ..errors import UnbuiltError
from .visits import followed

Vector = NDArray[np.float64]
TOGETHER = 0.01
"""RMS of what is not in proportion, over that of the motion, up to which two angles are one
shaft's: twist and lag of gears are less, slip of wheels on a path with bends is more."""
ANGLE = "rad"


class Gear(NamedTuple):
    """The best partner of an angle: its name, the ratio, and what is not in proportion."""

    name: str
    ratio: float
    misfit: float


def geared(
    simulator: Simulator, theta: Vector, changes: Iterable[Mapping[str, str]]
) -> dict[str, tuple[str, float]]:
    """Shafts of effects that stand where another angle says: shaft -> its name and the ratio.

    Args:
        simulator: of the declared system.
        theta: its parameters.
        changes: variants that carry the effects, as of `Problem.with_effects`.
    """
    problem = simulator.problem
    stated = _stated(problem)
    runs = [run for run in problem.chosen("identification") if set(stated) & set(run.starts)]
    found: dict[str, tuple[str, float]] = {}
    asked: set[str] = set()
    if not runs:
        return found
    for change in changes:
        try:
            changed = problem.with_effects(change)
        except UnbuiltError:
            continue  # the round that asks for these effects says so
        own = {shaft(name): name for name in angles(problem, changed)}
        wanted = {place: name for place, name in own.items() if place not in asked}
        asked |= set(wanted)
        if not wanted:
            continue
        point = changed.nominal
        point[: theta.size] = theta
        paths = followed(simulator.of(changed), point, runs, [*wanted.values(), *stated])
        for k, place in enumerate(wanted):
            gears = [
                _gear(name, [path[:, k] for path in paths], [path[:, j] for path in paths])
                for j, name in enumerate(stated, start=len(wanted))
            ]
            best = min(gears, key=lambda gear: gear.misfit)
            if best.misfit <= TOGETHER:
                found[place] = (best.name, best.ratio)
    return found


def angles(before: Problem, after: Problem) -> Iterator[str]:
    """Angles that only the second problem's system integrates."""
    for name, member in after.plain().members.items():
        known = before.plain().members[name].description.variables
        own = member.description.variables
        for variable in own.values():
            if (
                variable.name not in known
                and variable.symbol == ANGLE
                and f"der({variable.name})" in own
            ):
                yield from (f"{name}.{element}" for element in variable.elements())


def _stated(problem: Problem) -> list[str]:
    """Angles of which runs say where they begin."""
    known = {
        f"{name}.{element}"
        for name, member in problem.plain().members.items()
        for variable in member.description.variables.values()
        if variable.symbol == ANGLE
        for element in variable.elements()
    }
    # runs may state what only an effect has, such as for how long a drive has been on
    return [n for n in dict.fromkeys(n for run in problem.runs for n in run.starts) if n in known]


def _gear(name: str, angle: list[Vector], other: list[Vector]) -> Gear:
    """How well one angle follows another one, run by run from where it begins."""
    moved = np.concatenate([path - path[0] for path in angle])
    turned = np.concatenate([path - path[0] for path in other])
    size, motion = float(turned @ turned), float(moved @ moved)
    if size == 0.0 or motion == 0.0:
        return Gear(name, 0.0, np.inf)
    ratio = float(moved @ turned) / size
    left = moved - ratio * turned
    return Gear(name, ratio, float(np.sqrt((left @ left) / motion)))
