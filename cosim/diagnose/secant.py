"""Signatures of effects by secants: full simulations with the effect at a sensible strength.

Derivatives at strength 0 do not see effects with a threshold (a limit that does not bind), so a
strength is tried, what the residual asks for is estimated, and the simulation is repeated there.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..calibrate.parts import Parameter
from ..calibrate.problem import Problem
from ..calibrate.simulator import Simulator
from ..errors import CosimError
from .candidates import Candidate
from .choices import choices
from .linear import MATERIAL, Absorber, SampleStack, score
from .probes import Batch, batches
from .signature import EVIDENT, SHARE, Signature
from .trials import Trials, by_problem, nearer, shared

Vector = NDArray[np.float64]
Item = TypeVar("Item")
PATIENCE, SOLVED = 10.0, 20.0
"""Times as much work as without the effect: a fidelity with more states takes a few times as much,
and what takes more is an instability that a solver tries to resolve. A model without states, or
with slow ones, takes next to nothing: with an effect, a solver makes so many steps per
communication step (0.1 ms of 2 ms, 1 ms of 20)."""
VISIBLE = 1.0
"""Least norm of a signature that a second trial aims at: as large as the noise's own projection."""
WORTH = 0.5
"""Share of `MATERIAL` that a candidate must promise, to first order, for another simulation."""
TRIALS, BRACKETED, NEAR, BETWEEN = 3, 6, 0.3, 0.1
"""Trials at most, also where some were too weak and some too strong; a strength this close to one
that was tried is not tried again, also where it lies between those."""
FLOOR = 1e-3
"""A time below this share of a typical one is as good as none: sampling or lagging that fast would
only cost time."""
RUNAWAY = 1e15
"""Model values over sigma beyond which nothing was simulated; their squares still fit floats."""
SECONDS = {"": (0.0,), "turn": (0.0, 0.5 * np.pi), "shift": (0.0, 1.0)}
"""Values of a second parameter between which all others are mixed, by its kind."""
FARTHEST = 100.0
"""Bound on a shift: beyond, the effect is a constant."""
GREATEST = 1e3
"""Factor by which one trial may exceed the one before."""
CURVED, TANGENT = 20.0, 10.0
"""Times the noise by which a trial changes a channel from which its curvature counts where
calibration absorbs nearly all of it, and at which it is tried then: a thousandth of that would not
be seen."""
BEYOND, ASKED, DESCENTS = 100.0, 0.01, 4
"""A trial that changes a channel by so many times the noise where the residual asks for less than
this share of it has left the regime in which shares mean anything: a loop that oscillates does so
at its limits, whatever the delay, and a signal whose rate is limited far too much stands still. The
geometric mean of both strengths is tried then, and so on, so many times."""


class Bench:
    """Simulates candidates around one calibrated point.

    Args:
        simulator: of the problem without the candidates.
        theta: calibrated values.
        stack: of the runs that are simulated.
        model: model values over sigma at theta.
        residual: of theta.
        absorber: of the calibration, its rows multiplied by `root`.
        root: factors on the samples; those of stretches that are far off are small.
        seen: residual over the noise of more runs than are simulated, see `choices`.
    """

    def __init__(
        self,
        simulator: Simulator,
        theta: Vector,
        stack: SampleStack,
        model: Vector,
        residual: Vector,
        absorber: Absorber,
        root: Vector | None = None,
        seen: tuple[SampleStack, Vector] | None = None,
    ) -> None:
        self.simulator, self.problem = simulator, simulator.problem
        self.theta, self.stack = theta, stack
        self.model, self.absorber = model, absorber
        self.root = np.ones_like(residual) if root is None else root
        self.residual = absorber.rest(self.root * residual)
        self.seen = (stack, self.residual) if seen is None else seen
        self.evaluations = 0
        self.failed: dict[str, str] = {}
        self._lock = threading.Lock()

    def at(self, problem: Problem, values: Mapping[str, float]) -> Vector:
        """Model values over sigma with strengths set."""
        simulator = self.simulator.of(problem).limited(patience(self.simulator))
        theta = problem.nominal
        theta[: self.theta.size] = self.theta
        for name, value in values.items():
            theta[problem.index(name)] = value
        with self._lock:
            self.evaluations += len(self.stack.runs)
        found = model_values(simulator, theta, self.stack)
        if not np.max(np.abs(found), initial=0.0) < RUNAWAY:
            raise CosimError(f"{problem.name}: with {values} the simulation runs away")
        return found

    def spread(
        self, function: Callable[[Item], list[Trials]], items: Iterable[Item]
    ) -> list[Trials]:
        """Apply a function to batches of trials in threads, and free the sessions that it used."""

        def one(item: Item) -> list[Trials]:
            trials = function(item)
            for problem in {id(t.probe.problem): t.probe.problem for t in trials}.values():
                self.simulator.of(problem).close()
            return trials

        with ThreadPoolExecutor(self.simulator.workers) as pool:
            return [t for found in pool.map(one, items) for t in found]

    def begun(self, candidates: Sequence[Candidate], *, thorough: bool = False) -> list[Trials]:
        """Every candidate simulated at a typical strength, or one at which it runs and shows.

        Elements of a vector are simulated together where each shows in channels of its own.

        Args:
            candidates: which; those that cannot be simulated are left out.
            thorough: try other values of parameters that ask for it (see `SearchHints.tries`).
        """

        def simulated(batch: Batch) -> list[Trials]:
            trials = [Trials(p, p.strength.span) for p in batch.probes(self.problem)]
            if batch.apart and len(trials) == len(batch.candidates):
                masks = {c.label: mask[self.stack.channel]
                         for c, mask in batch.members if mask is not None}  # fmt: skip
                self._together(trials, masks)
                if thorough:
                    self._varied([t for t in trials if t.rough], masks)
                    trials = shared(trials)
            else:
                for one in trials:
                    if thorough and one.probe.scanned:
                        self._scanned(one)
                        continue
                    self._alone(one)
                    if thorough and one.best is not None:
                        self._varied([one], {})
            return trials

        return self.spread(simulated, batches(candidates, self.problem))

    def _alone(self, trials: Trials) -> None:
        while trials.best is None and trials.going:
            self.more(trials)
        found = trials.best
        if found is not None and found.curved:
            self._weaker(trials)
        if found is None or not trials.going:
            return
        if not np.any(found.change):
            trials.value = 10.0 * trials.tried[-1]  # a limit that does not bind yet
            self.more(trials)
        for _ in range(DESCENTS):
            if not self._beyond(trials):
                break
            trials.tried, trials.going = trials.tried[-1:], True
            trials.value = trials.tried[-1] * float(np.sqrt(max(abs(trials.wish), 1.0 / RUNAWAY)))
            self.more(trials)

    def _weaker(self, trials: Trials) -> None:
        """Once more with less of what calibration absorbs nearly all of, if it changes much.

        What is left is then mostly curvature: of the law, which is not what the residual has, or of
        the parameters that make up for it. A spring that holds a shaft is as good as a larger
        inertia.
        """
        found = trials.best
        assert found is not None
        size = self.stack.largest(found.change.astype(np.float64))
        if size > CURVED:
            trials.value, trials.going = found.value * TANGENT / size, True
            self.more(trials)

    def _scanned(self, trials: Trials) -> None:
        """The best of its usual strengths: the residual leads from none of them to the right one.

        An oscillation at a frequency that is off by a few periods over the run is as good as none.
        """
        for value in trials.probe.strength.hints.tries:
            try:
                values = trials.probe.values(value, trials.second, trials.fixed)
                found = self._measure(
                    trials, value, self.at(trials.probe.problem, values) - self.model
                )
            except CosimError as error:
                trials.error = str(error)
                continue
            if trials.best is None or found.score.gain > trials.best.score.gain:
                trials.best = found
        trials.going = False

    def _beyond(self, trials: Trials) -> bool:
        """Whether a trial was far too strong to say how strong it should be."""
        found = trials.best
        return (
            found is not None
            and abs(trials.wish) < ASKED
            and self.stack.largest(found.change.astype(np.float64)) > BEYOND
        )

    def _together(self, trials: list[Trials], masks: Mapping[str, NDArray[np.bool_]]) -> None:
        """First simulation of the elements of a vector, all in one."""
        elements = [t for t in trials if t.probe.candidate.label in masks]
        seconds = SECONDS[elements[0].probe.mix]
        factor = 1.0
        for _ in range(TRIALS):
            values = {t.probe.names[0]: t.clipped(factor * t.value) for t in elements}
            try:
                changes = [
                    self.at(
                        elements[0].probe.problem,
                        values | {n: second for t in elements for n in t.probe.seconds},
                    )
                    - self.model
                    for second in seconds
                ]
            except CosimError as error:
                for t in trials:
                    t.error = str(error)
                factor *= 0.1  # too strong for the system to run
                continue
            for t in trials:
                mask = masks.get(t.probe.candidate.label)
                parts = [c if mask is None else np.where(mask, c, 0.0) for c in changes]
                value = values[t.probe.names[0]]
                t.best = self._mixed(t, value, parts)
                t.rough = mask is not None
                t.value = self._wanted(t.best, value)
                if not t.rough:
                    t.tried.append(value)
            if np.any(changes[0]):
                return
            factor *= 10.0  # a limit that does not bind yet
        for t in trials:
            if t.best is None:
                t.going = False

    def _varied(self, trials: list[Trials], masks: Mapping[str, NDArray[np.bool_]]) -> None:
        """Other values of the parameters that tell nothing but where they are right."""
        if not trials:
            return
        problem = trials[0].probe.problem
        strengths = {t.probe.candidate.label: t.best.value for t in trials if t.best is not None}
        offered = [
            choices(t.probe, self.simulator, self.theta, self.stack, self.seen) for t in trials
        ]
        for fixed_values in zip(*offered):  # noqa: B905 - no choice is worth more than another
            changes = []
            try:
                for second in SECONDS[trials[0].probe.mix]:
                    values: dict[str, float] = {}
                    for t, fixed in zip(trials, fixed_values, strict=True):
                        value = strengths[t.probe.candidate.label]
                        values |= t.probe.values(value, second, fixed)
                    changes.append(self.at(problem, values) - self.model)
            except CosimError:
                continue
            for t, fixed in zip(trials, fixed_values, strict=True):
                label = t.probe.candidate.label
                parts = [np.where(masks[label], c, 0.0) if label in masks else c for c in changes]
                before = t.best, t.promise, t.wish, t.second, t.fixed
                t.fixed = fixed
                found = self._mixed(t, strengths[label], parts)
                if before[0] is not None and found.score.gain <= before[0].score.gain:
                    t.best, t.promise, t.wish, t.second, t.fixed = before
                else:
                    t.best, t.value = found, self._wanted(found, strengths[label])
                    t.tried = t.tried[-1:]

    def followed(self, begun: Sequence[Trials]) -> list[Signature]:
        """Signatures; those that promise something at the strength that the residual asks for."""
        best = max((t.promise for t in begun), default=0.0)
        least = max(EVIDENT, SHARE * best)

        def pursued(group: list[Trials]) -> list[Trials]:
            for trials in group:
                if trials.rough and (self._hopeful(trials, least) or self._beyond(trials)):
                    trials.best, trials.rough = None, False
                    self._alone(trials)
                while trials.going and self._hopeful(trials, least):
                    self.more(trials)
            return group

        self.spread(pursued, by_problem(begun))
        # without an error nothing of it is asked for: the residual wants less than `floor`
        self.failed = {
            t.probe.candidate.label: t.error for t in begun if t.error and t.best is None
        }
        return [t.best for t in begun if t.best is not None]

    def _hopeful(self, trials: Trials, least: float) -> bool:
        found = trials.best
        if found is None or not (trials.promise > least or found.curved):
            return False
        # the best trial need not be the last one; one that should be negative asks for nothing
        asked = (found.score.amplitude or abs(trials.wish)) * found.rest.astype(np.float64)
        return self.stack.largest(asked) > WORTH * MATERIAL

    def continued(self, found: Sequence[Signature]) -> list[Signature]:
        """Signatures over the runs of this bench of candidates that others have measured on some.

        Args:
            found: by a bench with fewer runs.
        """

        def simulated(group: list[Trials]) -> list[Trials]:
            for trials in group:
                self._alone(trials)
                trials.going = trials.going and not trials.probe.scanned
            return group

        again = [
            Trials(
                item.probe,
                item.value * (1.0 if item.probe.scanned else item.score.amplitude or 1.0),
                second=item.second, fixed=item.fixed, known=True,
            )
            for item in found
        ]  # fmt: skip
        self.spread(simulated, by_problem(again))
        return self.followed(again)

    def again(self, item: Signature, value: float) -> Signature:
        """An effect as it was simulated, at another strength."""
        trials = Trials(item.probe, value, second=item.second, fixed=item.fixed)
        values = item.probe.values(value, item.second, item.fixed)
        change = self.at(item.probe.problem, values) - self.model
        return replace(self._measure(trials, value, change), twins=item.twins)

    def more(self, trials: Trials) -> None:
        """One more simulation."""
        strength, tried = trials.probe.strength, trials.tried
        value = trials.clipped(trials.value)
        near = NEAR if trials.between() is None else BETWEEN
        if abs(value) <= floor(strength) or any(abs(value / old - 1.0) < near for old in tried):
            trials.going = False
            return
        tried.append(value)
        trials.going = len(tried) < TRIALS
        seconds: tuple[float, ...] = (trials.second,)
        if trials.best is None and not trials.known:
            seconds = SECONDS[trials.probe.mix]
        try:
            changes = [
                self.at(trials.probe.problem, trials.probe.values(value, second, trials.fixed))
                - self.model
                for second in seconds
            ]
        except CosimError as error:
            trials.error = str(error)
            trials.value = value * 0.1  # too strong for the system to run
            return
        found = self._mixed(trials, value, changes)
        if trials.best is None or nearer(found, trials.best):
            trials.best = found
        trials.asked[value] = trials.wish
        between = trials.between()
        if between is not None and len(tried) < BRACKETED:
            trials.going = True
        trials.value = self._wanted(found, value) if between is None else between

    @staticmethod
    def _wanted(found: Signature, value: float) -> float:
        """Strength that the residual asks for."""
        factor = found.score.amplitude
        if factor <= 0.0 and found.strength.minimum >= 0.0:
            factor = 0.1  # it cannot be negative: see whether a small one wants to be positive
        size = max(abs(factor), VISIBLE / max(found.score.size, VISIBLE / GREATEST))
        return value * float(np.sign(factor) or 1.0) * min(size, GREATEST)

    def _mixed(self, trials: Trials, value: float, changes: Sequence[Vector]) -> Signature:
        """Measure an effect at the value of its second parameter that the residual asks for.

        Args:
            trials: of the effect.
            value: its strength.
            changes: that it makes at `SECONDS`, only the first if it has no second parameter.
        """
        if len(changes) < 2:
            return self._measure(trials, value, changes[0])
        one, other = changes
        if trials.probe.mix == "shift":
            other = (other - one) / SECONDS["shift"][1]
        rests = np.array([self.absorber.rest(self.root * change) for change in (one, other)])
        wanted = np.linalg.lstsq(rests @ rests.T, rests @ self.residual, rcond=1e-6)[0]
        if trials.probe.mix == "turn":
            trials.second = float(np.arctan2(wanted[1], wanted[0]))
            whole = np.cos(trials.second) * one + np.sin(trials.second) * other
        else:
            share = wanted[1] / wanted[0] if wanted[0] else 0.0
            low, high = trials.probe.reach
            trials.second = float(np.clip(share, max(low, -FARTHEST), min(high, FARTHEST)))
            whole = one + trials.second * other
        return self._measure(trials, value, whole)

    def _measure(self, trials: Trials, value: float, change: Vector) -> Signature:
        """The signature; the trials note its gain as if its strength could be negative."""
        counted = self.root * change
        rest = self.absorber.rest(counted)
        total = float(counted @ counted)
        absorbed = 1.0 - float(rest @ rest) / total if total > 0.0 else 1.0
        result = score(rest, self.residual, self.stack, self.theta.size)
        trials.promise, trials.wish = result.gain, result.amplitude
        if trials.probe.mix:  # two values were chosen by the same data: chi square of two
            result = replace(result, p_value=float(np.exp(-0.5 * result.z**2)))
        if result.amplitude < 0.0 and trials.probe.strength.minimum >= 0.0:
            result = replace(result, amplitude=0.0, gain=0.0, z=0.0, p_value=1.0)
        return Signature(
            trials.probe, value, change.astype(np.float32), rest.astype(np.float32), result,
            absorbed, trials.second, dict(trials.fixed),
        )  # fmt: skip


def floor(strength: Parameter) -> float:
    """Strength up to which an effect is as good as none, see `FLOOR`."""
    return FLOOR * strength.span if strength.unit == "s" else 0.0


def patience(base: Simulator) -> dict[str, float]:
    """Work that the runs may take with an effect, from what they took without."""
    found = {}
    for name, cost in base.costs.items():
        run = base.problem.run(name)
        steps = (float(run.times[-1] - run.times[0]) + run.lead) / base.problem.step
        found[name] = PATIENCE * max(cost, SOLVED * steps)
    return found


def model_values(simulator: Simulator, theta: Vector, stack: SampleStack) -> Vector:
    """Model values over sigma at all measured samples."""
    runs = [run.name for run in stack.runs]
    residuals, sigma = simulator.residuals(theta, runs), simulator.problem.sigma
    rows = [run.data / sigma - r for run, (_, r) in zip(stack.runs, residuals, strict=True)]
    return stack.vector(rows)
