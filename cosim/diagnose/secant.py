"""Signatures of effects by secants: full simulations with the effect at a sensible strength.

Derivatives at strength 0 do not see effects with a threshold (a limit that does not bind), so a
strength is tried, what the residual asks for is estimated, and the simulation is repeated there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..calibrate.parts import Parameter
from ..calibrate.problem import Problem
from ..errors import CosimError
from .candidates import Candidate, new_parameters
from .linear import ABSORBED, Absorber, Layout, Score, score

Vector = NDArray[np.float64]
Tick = Callable[[], None]
VISIBLE = 1.0
"""Least norm of a signature that a second trial aims at: as large as the noise's own projection."""
EVIDENT, SHARE = 3.0, 0.02
"""A candidate whose first simulation gains less than 3 nats (noise does, in one of a hundred),
or less than 1/50 of what the best one gains, is not simulated again."""
TRIALS, NEAR = 3, 0.3
"""Trials at most; a strength this close to one that was tried is not tried again."""
FLOOR = 1e-3
"""A time below this share of a typical one is as good as none: sampling or lagging that fast would
only cost time."""
GREATEST = 1e3
"""Factor by which one trial may exceed the one before."""


@dataclass
class Signature:
    """What a candidate does to the model values.

    Attributes:
        candidate: which.
        problem: with the effect added.
        strength: its strength parameter.
        value: strength at which the secant was taken.
        change: model values over sigma with the effect less those without (float32).
        rest: what of it calibration cannot absorb.
        score: of `rest` against the residual.
        absorbed: share of the signature's energy that calibration absorbs.
        same: labels of candidates with the same signature.
    """

    candidate: Candidate
    problem: Problem
    strength: Parameter
    value: float
    change: NDArray[np.float32]
    rest: NDArray[np.float32]
    score: Score
    absorbed: float
    same: tuple[str, ...] = ()

    @property
    def asked(self) -> Vector:
        """What calibration cannot absorb, at the strength that the residual asks for."""
        return np.asarray(self.score.amplitude * self.rest, dtype=np.float64)

    @property
    def unseen(self) -> bool:
        """Whether calibration absorbs it, or the runs do not show it at all."""
        return self.absorbed > 1.0 - ABSORBED or self.score.size == 0.0


class Bench:
    """Simulates candidates around one calibrated point.

    Args:
        problem: without the candidates.
        theta: calibrated values.
        layout: of the identification runs.
        model: model values over sigma at theta.
        residual: of theta.
        absorber: of the calibration.
    """

    def __init__(
        self,
        problem: Problem,
        theta: Vector,
        layout: Layout,
        model: Vector,
        residual: Vector,
        absorber: Absorber,
    ) -> None:
        self.problem, self.theta, self.layout = problem, theta, layout
        self.model, self.absorber = model, absorber
        self.residual = absorber.rest(residual)
        self.evaluations = 0

    def at(self, problem: Problem, strength: Parameter, value: float) -> Vector:
        """Model values over sigma with one effect at a strength."""
        theta = problem.nominal
        theta[: self.theta.size] = self.theta
        theta[problem.index(strength.name)] = value
        self.evaluations += len(self.layout.runs)
        return model_values(problem, theta, self.layout)

    def signatures(
        self, candidates: Sequence[Candidate], tick: Tick = lambda: None
    ) -> list[Signature]:
        """Signatures at the strengths that the residual asks for.

        Every candidate is simulated once. Only what then explains something is worth another
        simulation at the strength that the residual asks for.

        Args:
            candidates: which; those that cannot be simulated are left out.
            tick: called after each.
        """
        first = []
        for candidate in candidates:
            found = self._begun(candidate)
            tick()
            if found is not None:
                first.append(found)
        best = max((t.promise for t in first), default=0.0)
        for trials in first:
            while trials.open and trials.promise > max(EVIDENT, SHARE * best):
                self._more(trials)
        return [t.best for t in first if t.best is not None]

    def _begun(self, candidate: Candidate) -> _Trials | None:
        try:
            problem = candidate.added_to(self.problem)
            problem.system()
        except CosimError:
            return None
        strengths, _ = new_parameters(self.problem, problem)
        if len(strengths) != 1:
            return None
        trials = _Trials(candidate, problem, strengths[0], strengths[0].span)
        while trials.best is None and trials.open:
            self._more(trials)
        if trials.best is not None and trials.open and not np.any(trials.best.change):
            trials.value = 10.0 * trials.tried[-1]  # a limit that does not bind yet
            self._more(trials)
        return trials

    def _more(self, trials: _Trials) -> None:
        """One more simulation."""
        strength, tried = trials.strength, trials.tried
        value = float(np.clip(trials.value, strength.minimum, strength.maximum))
        least = FLOOR * strength.span if strength.unit == "s" else 0.0
        if abs(value) <= least or any(abs(value / old - 1.0) < NEAR for old in tried):
            trials.open = False
            return
        tried.append(value)
        trials.open = len(tried) < TRIALS
        try:
            change = self.at(trials.problem, strength, value) - self.model
        except CosimError:
            trials.value = value * 0.1  # too strong for the system to run
            return
        finally:
            trials.problem.close()
        found, trials.promise = self._measure(trials, value, change)
        if trials.best is None or _mismatch(found) < _mismatch(trials.best):
            trials.best = found
        if found.unseen and found.score.size > VISIBLE:
            trials.open = False
        factor = found.score.amplitude
        if factor <= 0.0 and strength.minimum >= 0.0:
            factor = 0.1  # it cannot be negative: see whether a small one wants to be positive
        size = max(abs(factor), VISIBLE / max(found.score.size, VISIBLE / GREATEST))
        trials.value = value * float(np.sign(factor) or 1.0) * min(size, GREATEST)

    def _measure(self, trials: _Trials, value: float, change: Vector) -> tuple[Signature, float]:
        """The signature, and the gain that it would have if its strength could be negative."""
        rest = self.absorber.rest(change)
        total = float(change @ change)
        absorbed = 1.0 - float(rest @ rest) / total if total > 0.0 else 1.0
        result = score(rest, self.residual, self.layout, self.theta.size)
        promise = result.gain
        if result.amplitude < 0.0 and trials.strength.minimum >= 0.0:
            result = replace(result, amplitude=0.0, gain=0.0, z=0.0, p_value=1.0)
        found = Signature(
            trials.candidate, trials.problem, trials.strength, value, change.astype(np.float32),
            rest.astype(np.float32), result, absorbed,
        )  # fmt: skip
        return found, promise


@dataclass
class _Trials:
    """Simulations of one candidate so far.

    Attributes:
        candidate, problem, strength: see `Signature`.
        value: strength to try next.
        tried: strengths that were tried.
        best: signature at the strength nearest to the one that the residual asks for.
        promise: gain [nats] of the last one, whatever its sign.
        open: whether another may be tried.
    """

    candidate: Candidate
    problem: Problem
    strength: Parameter
    value: float
    tried: list[float] = field(default_factory=list)
    best: Signature | None = None
    promise: float = 0.0
    open: bool = True


def _mismatch(item: Signature) -> float:
    """How far the strength of the trial is from the one that the residual asks for."""
    return abs(float(np.log(max(item.score.amplitude, 1e-6))))


def model_values(problem: Problem, theta: Vector, layout: Layout) -> Vector:
    """Model values over sigma at all measured samples."""
    runs = [run.name for run in layout.runs]
    residuals = problem.residuals(theta, runs)
    rows = [
        run.data / problem.sigma - r for run, (_, r) in zip(layout.runs, residuals, strict=True)
    ]
    return layout.vector(rows)


def merge(signatures: list[Signature]) -> list[Signature]:
    """Leave one of those whose signatures are the same up to a factor, the first one."""
    kept: list[Signature] = []
    for item in signatures:
        size = float(np.linalg.norm(item.change))
        for other in kept:
            product = float(item.change @ other.change)
            norm = size * float(np.linalg.norm(other.change))
            # 1e-4: sine of the angle between float32 signatures of the same simulation
            if norm > 0.0 and abs(product) / norm > 1.0 - 1e-6:
                other.same = (*other.same, item.candidate.label)
                break
        else:
            kept.append(item)
    return kept
