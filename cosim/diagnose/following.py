"""A model moved along the log by free efforts.

Where a model is far from the data, what a law does to it says nothing of what the law does to the
machine: friction acts on another speed, an unbalance at another angle. So efforts u(t) are added at
a few balances, chosen one after another, that make the model follow what was measured,

    minimize |y - f(u)|^2 + |W^-1 u|^2 / s^2,    u piecewise linear in time, W a random walk,

run by run, by Gauss-Newton steps; s follows from the evidence, as in `localise`. Along this motion
each law acts as it does on the machine, and what the missing laws do to the model values is

    r + F u    to first order,    F: responses to the efforts, r: what they leave,

since laws and efforts take each other's place without moving anything: first orders hold, however
far off the model was.

Not modelled: efforts faster than the finest knots; they move little, and stay in r.

Source: weak-constraint estimation (Tremolet, Q. J. R. Meteorol. Soc. 132, 2006).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..calibrate.parts import MeasuredRun
from ..calibrate.problem import Problem
from ..calibrate.reach import apart
from ..calibrate.simulator import Simulator
from ..data.signals import Signal, Table
from ..errors import FmuCallError, VariantError
from .linear import SampleStack
from .localise import SIZES
from .models import OPEN
from .secant import model_values

Vector = NDArray[np.float64]
EFFORT = "applied_effort"
KNOTS = (17, 33, 65)
"""Of an effort over a run, each time twice as dense, until the model follows."""
STEPS, FALLS = 3, 0.7
"""Gauss-Newton steps with the same knots at most; one that leaves more than this share of the mean
square is the last one with them, and so it is with denser knots, and with further places."""
SHARES = (1.0, 0.5, 0.25, 0.125)
"""Of a step, of which the first is taken that comes nearer to the data."""
CHANGE, TRIALS = 3.0, 8
"""Largest change by one knot, over the noise, at which responses are taken: far above what solvers
round, far below what the model is off. Found within a factor of 3, in so many trials at most."""
PLACES = 3
"""Where efforts enter at most: each costs as many simulations again."""
SIDE = 0.02
"""Share of the efforts by which they are changed to see what they do together."""


@dataclass(frozen=True)
class Followed:
    """A model on the motion of the log.

    Attributes:
        simulator: of it, efforts among the inputs of its runs.
        theta: its parameters.
        places: where efforts enter.
        model: model values over sigma.
        wanted: what missing laws do to the model values over sigma, to first order.
        left: mean square over the noise's that the efforts leave.
    """

    simulator: Simulator
    theta: Vector
    places: tuple[str, ...]
    model: Vector
    wanted: Vector
    left: float


def follow(
    simulator: Simulator,
    theta: Vector,
    stack: SampleStack,
    first: tuple[str, str],
    among: Sequence[tuple[str, str]],
    element: str = "",
) -> Followed:
    """Move a model along some runs by efforts at as few balances as that takes.

    Args:
        simulator: of the model.
        theta: its parameters.
        stack: of the runs.
        first: instance and port of a balance where an effort enters in any case.
        among: others where efforts may enter.
        element: of a vector balance, the only one of the first balance where an effort enters.

    Raises:
        CosimError: it cannot be simulated.
    """
    rows = dict(simulator.residuals(theta, stack.names))
    name = max(stack.names, key=lambda n: float(np.nanmean(rows[n] ** 2)))
    inputs = _inputs(simulator.problem, [first, *among])
    if element:
        inputs = [i for i in inputs if i[:2] != first or i.name.endswith(f"[{element}]")]
    every = _Bench(simulator, theta, inputs)
    kept = every.chosen(every.simulator.problem.run(name))
    every.simulator.close()
    bench = _Bench(simulator, theta, kept)
    problem = bench.simulator.problem
    efforts = bench.simulator.spread(bench.followed, [problem.run(n) for n in stack.names])
    runs, wanted, left = [], [], []
    for name, u in zip(stack.names, efforts, strict=True):
        run = problem.run(name)
        here, more, less = bench.residuals(run, [u, (1.0 + SIDE) * u, (1.0 - SIDE) * u])
        left.append(here)
        wanted.append(here + (less - more) / (2.0 * SIDE))
        runs.append(replace(run, inputs={**run.inputs, **bench.inputs(run, u)}))
    bench.simulator.close()
    moved = simulator.of(problem.changed(runs=runs))
    return Followed(
        moved, theta, tuple(".".join(place[:2]) for place in kept),
        model_values(moved, theta, stack), np.concatenate(wanted),
        float(np.mean(np.concatenate(left) ** 2)),
    )  # fmt: skip


def _inputs(problem: Problem, among: Sequence[tuple[str, str]]) -> list[Input]:
    """Inputs of efforts at all elements of the balances that can take any."""
    found: list[Input] = []
    for instance, port in dict.fromkeys(among):
        try:
            probed = problem.with_effects({instance: f"+{EFFORT}@{port}"})
            variables = probed.system().members[instance].description.variables
        except VariantError:
            continue  # a mass centre or the direction of gravity
        own = f"{port}.{EFFORT}.u"
        for variable in variables.values():
            if variable.name == own or variable.name.startswith(f"{own}["):
                found += [Input(instance, port, element) for element in variable.elements()]
    return found


class Input(NamedTuple):
    """Where an effort enters.

    Attributes:
        instance, port: balance.
        name: of the FMU's input.
    """

    instance: str
    port: str
    name: str


class _Bench:
    """Simulates runs of a model with efforts at some places."""

    def __init__(self, simulator: Simulator, theta: Vector, places: Sequence[Input]) -> None:
        problem = simulator.problem
        ports = list(dict.fromkeys((place.instance, place.port) for place in places))
        changes: dict[str, str] = {}
        for instance, port in ports:
            changes[instance] = changes.get(instance, "") + f"+{EFFORT}@{port}"
        problem = problem.with_effects(changes)
        problem = problem.hold({f"{i}.{port}.{EFFORT}.g": 1.0 for i, port in ports})
        self.plain, self.places = simulator, list(places)
        self.names = [f"{place.instance}.{place.name}" for place in places]
        none = dict.fromkeys(self.names, _effort(np.zeros(2), (0.0, 1.0)))
        runs = [replace(run, inputs={**run.inputs, **none}) for run in problem.runs]
        self.simulator = simulator.of(problem.changed(runs=runs))
        self.theta = theta

    def chosen(self, run: MeasuredRun) -> list[Input]:
        """Places at which efforts make the model follow a run, the first one at the first balance.

        Which one comes next is told by first orders around the motion so far.
        """
        u = np.zeros((len(self.names), KNOTS[0]))
        (residual,) = self.residuals(run, [u])
        kept: list[int] = []
        offered = [k for k, p in enumerate(self.places) if p[:2] == self.places[0][:2]]
        while offered and len(kept) < PLACES and float(np.mean(residual**2)) > OPEN:
            some = [*kept, self._next(run, u, residual, kept, offered)]
            bench = _Bench(self.plain, self.theta, [self.places[k] for k in some])
            same = bench.simulator.problem.run(run.name)
            efforts = bench.followed(same)
            (after,) = bench.residuals(same, [efforts])
            bench.simulator.close()
            if kept and float(after @ after) > FALLS * float(residual @ residual):
                break
            kept, residual = some, after
            u = np.zeros((len(self.names), efforts.shape[1]))
            u[kept] = efforts
            offered = [k for k in range(len(self.names)) if k not in kept]
        return [self.places[k] for k in kept]

    def _next(
        self, run: MeasuredRun, u: Vector, residual: Vector, kept: list[int], offered: list[int]
    ) -> int:
        """The place at which an effort brings the model nearest, beside those that are kept."""
        if len(offered) == 1:
            return offered[0]
        responses = self._responses(run, u, residual, KNOTS[0])

        def left(place: int) -> float:
            some = [*kept, place]
            columns = np.hstack([responses[k] for k in some])
            step = _step(columns, residual, np.zeros((len(some), KNOTS[0])))
            rest = residual - columns @ step.ravel()
            return float(rest @ rest)

        return min(offered, key=left)

    def inputs(self, run: MeasuredRun, u: Vector) -> dict[str, Signal]:
        """Efforts (places, knots) as inputs of a run."""
        shift = max(channel.shift for channel in self.simulator.problem.channels)
        span = float(run.times[0]) - run.lead, float(run.times[-1]) + shift
        return {name: _effort(row, span) for name, row in zip(self.names, u, strict=True)}

    def residuals(self, run: MeasuredRun, efforts: Sequence[Vector]) -> list[Vector]:
        """Of the measured samples of a run, once for each set of efforts."""
        given = [self.inputs(run, u) for u in efforts]
        good = np.isfinite(run.data)
        sigma = self.simulator.problem.sigma
        return [
            run.white(apart(run, read, sigma))[good]
            for read in self.simulator.driven(self.theta, run, given)
        ]

    def followed(self, run: MeasuredRun) -> Vector:
        """Efforts with which the model follows a run."""
        u = np.zeros((len(self.names), KNOTS[0]))
        (residual,) = self.residuals(run, [u])
        for count in KNOTS:
            u, coarse = _refined(u, count), float(np.mean(residual**2))
            for _ in range(STEPS):
                before = float(np.mean(residual**2))
                if before < OPEN:
                    return u
                responses = np.hstack(self._responses(run, u, residual, count))
                step = _step(responses, residual, u)
                for share in SHARES:
                    try:
                        (found,) = self.residuals(run, [u + share * step])
                    except FmuCallError:
                        continue
                    if float(np.mean(found**2)) < before:
                        u, residual = u + share * step, found
                        break
                if float(np.mean(residual**2)) > FALLS * before:
                    break
            if count > KNOTS[0] and float(np.mean(residual**2)) > FALLS * coarse:
                return u  # what is left is not the motion: a sensor's error, say
        return u

    def _responses(self, run: MeasuredRun, u: Vector, residual: Vector, count: int) -> list[Vector]:
        """Derivatives of the model values to each of so many knots of each place."""
        found = []
        for place in range(u.shape[0]):
            size = self._size(run, u, place, residual)
            moved = []
            for knot in range(count):
                hat = _refined(size * np.eye(1, count, knot), u.shape[1])
                other = u.copy()
                other[place] += hat[0]
                moved.append(other)
            columns = [(residual - row) / size for row in self.residuals(run, moved)]
            found.append(np.column_stack(columns))
        return found

    def _size(self, run: MeasuredRun, u: Vector, place: int, residual: Vector) -> float:
        """Of a change of one knot that shows and is small."""
        size = 1e-2
        for _ in range(TRIALS):
            other = u.copy()
            other[place, u.shape[1] // 3] += size
            try:
                (found,) = self.residuals(run, [other])
                largest = float(np.max(np.abs(found - residual)))
            except FmuCallError:
                largest = np.inf
            if CHANGE / 3.0 < largest < CHANGE * 3.0:
                break
            size *= float(np.clip(CHANGE / max(largest, 1e-12), 1e-4, 1e4))
        return size


def _step(responses: Vector, residual: Vector, u: Vector) -> Vector:
    """Gauss-Newton step of the efforts.

    Args:
        responses: (samples, places x knots).
        residual: what is left now.
        u: efforts (places, knots).
    """
    places, count = u.shape
    walk = np.tril(np.ones((count, count)))
    walk[:, 0] *= np.sqrt(count)  # begins anywhere within where it leads to
    back, turned = [], []
    for place in range(places):
        part = responses[:, place * count : (place + 1) * count] @ walk
        size = float(np.sqrt(np.mean(np.sum(part**2, axis=0)))) or 1.0
        back.append(walk / size)
        turned.append(part / size)
    matrix, target = np.hstack(turned), residual + responses @ u.ravel()
    values, vectors = np.linalg.eigh(matrix.T @ matrix)
    values = np.maximum(values, 0.0)
    share = vectors.T @ (matrix.T @ target)

    def evidence(size: float) -> float:
        grown = size**2 * values
        return 0.5 * float(np.sum(share**2 * size**2 / (1.0 + grown)) - np.sum(np.log1p(grown)))

    best = max((float(size) for size in _SIZES), key=evidence)
    found = vectors @ (best**2 / (1.0 + best**2 * values) * share)
    wanted = [w @ found[k * count : (k + 1) * count] for k, w in enumerate(back)]
    return np.array(wanted) - u


_SIZES = SIZES * 1e2
"""Of the walk over the size at which one knot shows as much as the noise: a model may be five
orders of magnitude off."""


def _refined(u: Vector, count: int) -> Vector:
    """The same efforts on more knots."""
    old, new = np.linspace(0.0, 1.0, u.shape[1]), np.linspace(0.0, 1.0, count)
    return np.array([np.interp(new, old, row) for row in u])


def _effort(values: Vector, span: tuple[float, float]) -> Signal:
    """An effort over a run, linear between equally spaced knots."""
    times = np.linspace(*span, values.size)
    return Table(times, values, interpolation="linear", text="effort", extend=True)
