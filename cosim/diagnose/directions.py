"""What every law of the catalogue does to the model values along the motion of the log.

Each law is simulated at strengths so small that it hardly moves anything (see `following`), over
the shapes that `choices` gives; what calibration can absorb there is taken away.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..calibrate.differences import jacobian
from ..calibrate.known import STEP
from ..calibrate.problem import Problem
from ..errors import CosimError, UnbuiltError
from .candidates import Candidate
from .choices import choices
from .following import Followed
from .linear import ABSORBED, Absorber, SampleStack
from .probes import Batch, Probe, batches
from .secant import RUNAWAY, SECONDS, model_values, patience

Vector = NDArray[np.float64]
SMALL, LARGE, AIM, TRIALS = 0.5, 10.0, 3.0, 7
"""RMS over the noise in some channel of some run that a law should add (between the first two, the
third is aimed at, in so many trials): above what solvers round, where first orders hold."""
FIRST = 0.01
"""Share of a typical strength that is tried first."""


@dataclass(frozen=True)
class Direction:
    """A law of one shape.

    Attributes:
        probe: the candidate in the system that was simulated.
        fixed: its parameters that have another value than its FMU's.
        change: of the model values over sigma by its strength, per unit; a second column by the
            second parameter, where two simulations tell one (see `SearchHints.mix`).
        rest: what of it calibration cannot absorb.
        size: strength at which it was taken.
    """

    probe: Probe
    fixed: Mapping[str, float]
    change: NDArray[np.float32]
    rest: NDArray[np.float32]
    size: float

    @property
    def candidate(self) -> Candidate:
        """Which."""
        return self.probe.candidate

    def parameters(self, values: Vector) -> dict[str, float]:
        """Parameter -> value for factors on its columns, within bounds."""
        p, mix = self.probe.strength, self.probe.mix
        strength, found = float(values[0]), dict(self.fixed)
        if mix == "turn":
            found[self.probe.second] = float(np.arctan2(values[1], values[0]))
            strength = float(np.hypot(values[0], values[1]))
        elif mix == "shift":
            low, high = self.probe.reach
            share = float(values[1] / values[0]) if values[0] else 0.0
            found[self.probe.second] = float(np.clip(share, low, high))
        found[p.name] = float(np.clip(p.absent + strength, p.minimum, p.maximum))
        return found


class Responses:
    """Takes directions along a motion.

    Args:
        followed: the model on that motion.
        stack: of its runs.

    Attributes:
        declared: derivatives by the declared parameters, scaled.
        wanted: what missing laws do, without what calibration can absorb.
    """

    def __init__(self, followed: Followed, stack: SampleStack) -> None:
        self.followed, self.stack = followed, stack
        self.simulator = followed.simulator
        slopes = jacobian(self.simulator, followed.theta, stack.names, central=False, relative=STEP)
        problem = self.simulator.problem
        self.declared = stack.matrix(slopes, problem.scale)
        self.absorber = Absorber(self.declared, problem)
        self.wanted = self.absorber.rest(followed.wanted)

    def of(self, known: Sequence[Candidate]) -> list[Direction]:
        """Directions of all candidates that do something there."""

        def taken(batch: Batch) -> list[Direction]:
            probes = batch.probes(self.simulator.problem)
            found = [d for probe in probes for d in self._shapes(probe)]
            for problem in {id(p.problem): p.problem for p in probes}.values():
                self.simulator.of(problem).close()
            return found

        with ThreadPoolExecutor(self.simulator.workers) as pool:
            groups = list(pool.map(taken, batches(known, self.simulator.problem)))
        return [d for group in groups for d in group]

    def _shapes(self, probe: Probe) -> list[Direction]:
        found: list[Direction] = []
        theta = self.followed.theta
        try:
            offered = choices(probe, self.simulator, theta, self.stack, (self.stack, self.wanted))
        except UnbuiltError:
            raise
        except CosimError:
            offered = []
        for fixed in ({}, *offered):
            size = found[-1].size if found else FIRST * probe.strength.span
            try:
                one = self._direction(probe, fixed, size)
            except UnbuiltError:
                raise
            except CosimError:  # that shape cannot be simulated, or its fidelity takes no effort
                continue
            if one is not None:
                found.append(one)
        return found

    def _direction(self, probe: Probe, fixed: Mapping[str, float], size: float) -> Direction | None:
        """None if it shows nothing, or nothing that calibration cannot absorb."""
        p, (first, *others) = probe.strength, SECONDS[probe.mix]
        trial = size
        for _ in range(TRIALS):
            size = min(trial, p.maximum - p.absent)
            change = self._at(probe.problem, probe.values(p.absent + size, first, fixed))
            largest = self.stack.largest(change)
            if SMALL < largest < LARGE or (largest < SMALL and p.absent + size >= p.maximum):
                break
            trial = size * float(np.clip(AIM / max(largest, 1e-12), 1e-3, 1e3))
        changes = [change]
        for second in others:
            other = self._at(probe.problem, probe.values(p.absent + size, second, fixed))
            changes.append((other - change) / second if probe.mix == "shift" else other)
        whole = np.column_stack(changes) / size
        rest = np.column_stack([self.absorber.rest(column) for column in whole.T])
        if not np.sum(rest**2) > ABSORBED * np.sum(whole**2):
            return None
        return Direction(probe, fixed, whole.astype(np.float32), rest.astype(np.float32), size)

    def _at(self, problem: Problem, values: Mapping[str, float]) -> Vector:
        theta = problem.nominal
        theta[: self.followed.theta.size] = self.followed.theta
        for name, value in values.items():
            theta[problem.index(name)] = value
        simulator = self.simulator.of(problem).limited(patience(self.simulator))
        found = model_values(simulator, theta, self.stack)
        if not np.max(np.abs(found), initial=0.0) < RUNAWAY:
            raise CosimError(f"{problem.name}: with {dict(values)} the simulation runs away")
        return np.asarray(found - self.followed.model)
