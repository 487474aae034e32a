"""Where the shafts of periodic effects stand when a run begins, and how far they turn.

A law that repeats over the angle of a shaft integrates the shaft's speed where its balance offers
no angle, from 0 in each run; its phase would be another one in each. If that angle moves in
proportion with one of which the log says where it begins,

    theta(t) - theta(0) = c (phi(t) - phi(0))      in all runs,

both are one shaft, or one is geared to the other, and theta(0) = c phi(0).

Over a run in which the shaft turns by T, a law that repeats n times per turn has one cycle more
with n + 2 pi / T: a typical change of n, over much less of which differences are taken.
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


class Shafts(NamedTuple):
    """What is known of the shafts of periodic effects (see `problem.shaft`).

    Attributes:
        gears: shaft -> angle that says where it stands when a run begins, and the ratio.
        turns: angle over which an effect repeats -> how far it turns in a run at most [rad].
    """

    gears: dict[str, tuple[str, float]]
    turns: dict[str, float]


def followed_shafts(
    simulator: Simulator, theta: Vector, changes: Iterable[Mapping[str, str]]
) -> Shafts:
    """Shafts of effects, followed through the runs.

    Args:
        simulator: of the declared system.
        theta: its parameters.
        changes: variants that carry the effects, as of `Problem.with_effects`.
    """
    problem = simulator.problem
    stated = _stated(problem)
    runs = problem.chosen("identification")
    found = Shafts({}, {})
    asked: set[str] = set()
    for change in changes:
        try:
            changed = problem.with_effects(change)
        except UnbuiltError:
            continue  # the round that asks for these effects says so
        integrated = {shaft(name): name for name in angles(problem, changed)}
        shown = {shaft(name): name for name in _repeated(problem, changed)}
        own = {p: n for p, n in integrated.items() if p not in asked and stated}
        outputs = {p: n for p, n in shown.items() if p not in asked}
        asked |= {*own, *outputs}
        if not own and not outputs:
            continue
        point = changed.nominal
        point[: theta.size] = theta
        names = [*own.values(), *outputs.values(), *stated]
        paths = followed(simulator.of(changed), point, runs, names)
        for k, place in enumerate(own):
            gears = [
                _gear(name, [path[:, k] for path in known], [path[:, j] for path in known])
                for j, name in enumerate(stated, start=len(own) + len(outputs))
                if (known := [p for p, run in zip(paths, runs, strict=True) if name in run.starts])
            ]
            best = min(gears, key=lambda gear: gear.misfit, default=None)
            if best is not None and best.misfit <= TOGETHER:
                found.gears[place] = (best.name, best.ratio)
        for k, place in enumerate(outputs, start=len(own)):
            turned = max(float(np.ptp(path[:, k])) for path in paths)
            whole = place.partition("[")[0]  # effects on several shafts are one to a parameter
            found.turns[whole] = max(found.turns.get(whole, 0.0), turned)
    return found


def _repeated(before: Problem, after: Problem) -> Iterator[str]:
    """Angles over which effects repeat that only the second problem's system has."""
    known = {p.name for p in before.parameters}
    for p in after.parameters:
        if p.hints.cycles and p.name not in known:
            member, variables = after.plain().variables(p.hints.cycles)
            yield from (f"{member.name}.{element}" for v in variables for element in v.elements())


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
