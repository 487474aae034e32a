"""A parameter is moved, and the others follow to where that costs least.

Also how fits go along curved valleys: the parameter that a step moves most is moved by itself,
farther and farther, and the others find the floor.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import FmuCallError
from .broyden import Broyden
from .loss import Loss
from .parts import Sensitivity
from .problem import Problem
from .simulator import Simulator

Vector = NDArray[np.float64]
FOLLOWED, SLIGHT = 20, 0.1
"""Steps of the others (Broyden's end in twice as many as there are directions, D. M. Gay 1979;
jumps or bends blur ten at most), and the fall of the cost [nats] that ends them."""
LOST, PATIENT = 80.0, 6
"""Rise of the cost [nats] at which a parameter has gone astray, ten times the one at which it has
gone far enough (`valley.SEEN`), and steps in a row that end it there if none has halved the rise:
of 34 moves beside jumps that six steps end, three came back within twenty, by a lucky step."""
LONGER = 10.0
"""Multiple of a step that promises nothing: rounded derivatives claim to know, and then promise too
little of, what hardly changes anything."""
BEGUN, FARTHEST = 0.03, 2.0
"""Shares of the step along a valley that are walked first, where it is still nearly straight, and
at most: the quadratic has its minimum at 1."""


class Point(Protocol):
    """A point on its way to the minimum; see `descent.Descent`."""

    problem: Problem
    simulator: Simulator
    purpose: str | list[str]
    loss: Loss
    theta: Vector
    residuals: list[tuple[str, Vector]]
    cost: float
    jacobian: list[Sensitivity]

    def total(self, theta: Vector, residuals: list[tuple[str, Vector]]) -> float:
        """Cost there."""
        ...

    def meet(self, theta: Vector, residuals: list[tuple[str, Vector]], cost: float) -> None:
        """Note it for `lowered`."""
        ...

    def attempt(self, theta: Vector) -> bool:
        """Go there if it is better."""
        ...


def walk(run: Point, step: Vector) -> None:
    """Go along a valley as long as it falls.

    Args:
        run: with derivatives there that are right across the valley.
        step: of the parameters, in their units, that leads along it at first.
    """
    p = run.problem
    common = np.array([not item.run for item in p.parameters])
    way = step / p.scale
    k = int(np.argmax(np.where(common, np.abs(way), 0.0)))
    slopes = Broyden(p, run.jacobian, run.loss)
    share, begun, lowest, goal = BEGUN, run.theta, 0.0, run.theta
    while share <= FARTHEST:
        try:
            theta, rise = made_up(run, slopes, k, share * way)
        except FmuCallError:
            break
        if not rise < lowest:
            break
        lowest, goal, way = rise, theta, (theta - begun) / (share * p.scale)
        share *= 2.0
    run.attempt(goal)


def made_up(run: Point, slopes: Broyden, k: int, change: Vector) -> tuple[Vector, float]:
    """Where the other parameters go when one is moved, and by how much the cost rises [nats].

    The derivatives learn from all steps, good and bad.
    """
    p = run.problem
    theta = np.clip(run.theta + change * p.scale, p.lower, p.upper)
    residuals = run.simulator.residuals(theta, run.purpose)
    cost = run.total(theta, residuals)
    slopes.learn(theta - run.theta, run.residuals, residuals)
    halved, idle = cost - run.cost, 0
    for _ in range(FOLLOWED):
        normal = slopes.normal(theta, residuals)
        step = undone(normal.matrix, normal.gradient, k)
        last = 0.5 * float(normal.gradient @ step) < SLIGHT
        there = np.clip(theta + (LONGER if last else 1.0) * step * p.scale, p.lower, p.upper)
        moved = run.simulator.residuals(there, run.purpose)
        slopes.learn(there - theta, residuals, moved)
        if (after := run.total(there, moved)) < cost:
            last &= cost - after < SLIGHT
            theta, residuals, cost = there, moved, after
        idle += 1
        if cost - run.cost < max(0.5 * halved, LOST):
            halved, idle = cost - run.cost, 0
        if last or idle == PATIENT:
            break
    run.meet(theta, residuals, cost)
    return theta, cost - run.cost


def undone(matrix: Vector, wanted: Vector, k: int) -> Vector:
    """Change of all parameters but one that the normal equations ask for."""
    others = np.flatnonzero(np.arange(wanted.size) != k)
    inverse = np.linalg.pinv(matrix[np.ix_(others, others)], 1e-12, hermitian=True)
    change = np.zeros(wanted.size)
    change[others] = inverse @ wanted[others]
    return change
