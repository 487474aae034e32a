"""Where a run comes by: values that a parameter like a place on the floor may have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..calibrate.parts import Channel, MeasuredRun
from ..calibrate.simulator import Simulator
from ..errors import UnknownNameError

Vector = NDArray[np.float64]


def followed(
    simulator: Simulator,
    theta: Vector,
    runs: Sequence[MeasuredRun],
    variables: Sequence[str],
) -> list[Vector]:
    """Values of variables in a simulation at the samples of each run, one column per variable.

    Args:
        simulator: of the system.
        theta: its parameters.
        runs: to simulate.
        variables: full names.

    Raises:
        UnknownNameError: the system lacks a variable.
    """
    problem = simulator.problem
    system = problem.system()
    for name in variables:
        system.variables(name)
    names = {run.name for run in runs}
    silent = [
        replace(run, data=np.zeros((run.times.size, len(variables))), noise=None)
        for run in problem.runs
        if run.name in names
    ]
    channels = [Channel(name, "", 1.0, name) for name in variables]
    spy = simulator.limited({}).of(
        problem.changed(runs=silent, channels=channels, relative=())
    )  # fmt: skip
    paths = [spy.simulate(theta, run) for run in silent]
    spy.close()
    return paths


def visited(
    simulator: Simulator,
    theta: Vector,
    runs: Sequence[MeasuredRun],
    variables: Sequence[str],
    most: int,
) -> Vector:
    """Points that the variables come by in a simulation, far from each other.

    Each is the one farthest from those before it, so the first few already span the path.

    Args:
        simulator: of the system.
        theta: its parameters.
        runs: to simulate.
        variables: full names.
        most: number of points.

    Returns:
        one row per point; none if the system lacks a variable.
    """
    try:
        path = np.concatenate(followed(simulator, theta, runs, variables))
    except UnknownNameError:
        return np.empty((0, len(variables)))
    points = [path[0]]
    away = np.linalg.norm(path - path[0], axis=1)
    while len(points) < most and float(away.max()) > 0.0:
        points.append(path[int(np.argmax(away))])
        away = np.minimum(away, np.linalg.norm(path - points[-1], axis=1))
    return np.array(points)
