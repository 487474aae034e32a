"""Judgement of fitted models on the runs of one problem: which is better, and by enough."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..calibrate.foretelling import foretold
from ..calibrate.loss import loss_for, typical
from ..calibrate.normal import cost_of
from ..calibrate.problem import Problem
from ..calibrate.simulator import Simulator
from ..errors import CosimError
from .candidates import SKEW, Candidate
from .facts import Gain, Law
from .linear import MATERIAL, SampleStack
from .memo import Memo
from .models import GATE, GATE_Z, Fitted, Gate, compare, is_open, more_general, value_of
from .whiteness import UNNAMED, whiteness_tests

Vector = NDArray[np.float64]
ALIKE = 1e-5
"""Share of what they explain by which models may differ that are one to first order."""
OFF = 400.0
"""Mean square over the noise's of a channel's typical windows beyond which first orders say little,
and all residuals count in full: by their logarithm, fits end far from their minima, and beside that
much, moments at which casters turn over are small."""
EXPLAINED, CONCENTRATED = 0.98, 0.9
"""Share of what a model leaves beyond noise from which a candidate explains nearly all of it; the
second where much counts by its logarithm (`loss.Windowed`)."""


class Judge:
    """Measured data over sigma, and what they say about models.

    Args:
        problem: the data as measured.
        check: purpose of the runs that are not used for fitting.
    """

    def __init__(self, problem: Problem, check: str) -> None:
        self.purpose = check
        self.memo = Memo()
        self.lifted: Fitted | None = None
        """The declared model with bounds opened (`bounds.opened`), if it was fitted."""
        self._measured(problem)

    def _measured(self, problem: Problem) -> None:
        """What is judged by."""
        self.raw = problem
        self._beside: dict[frozenset[str], tuple[Vector, Vector]] = {}
        """Parameters of sets, and what `beside` them is left of unused runs."""
        self.fitting = SampleStack(problem, problem.chosen("identification"))
        checks = problem.chosen(self.purpose) or problem.chosen("identification")
        self.checking = SampleStack(problem, checks)
        self.fit_data = self._data(self.fitting)
        self.check_data = self._data(self.checking)

    def _data(self, stack: SampleStack) -> Vector:
        return stack.vector([run.data / self.raw.sigma for run in stack.runs])

    @property
    def unused(self) -> bool:
        """Whether there are runs that no fit has used."""
        return bool(self.raw.chosen(self.purpose))

    def note(self, fitted: Fitted) -> None:
        """Remember a fit if none of its set of effects is better (`memo.SETTLED`)."""
        self.memo.note(fitted, self._rise)

    def _rise(self, first: Fitted, second: Fitted) -> float:
        """By how much the second of two fits is worse on fitted runs [nats].

        Of data with the same correction of the exchange, their costs tell.
        """
        alike = first.problem.far == second.problem.far and all(
            a.data is b.data for a, b in zip(first.problem.runs, second.problem.runs, strict=True)
        )
        if alike:
            return second.estimate.robust - first.estimate.robust
        costs = [self.fitting.cost(self.fit_data - f.fit) for f in (first, second)]
        return costs[1] - costs[0]

    def cost(self, simulator: Simulator, theta: Vector) -> float:
        """Cost over the identification runs."""
        problem = simulator.problem
        residuals = simulator.residuals(theta, self.fitting.names)
        return cost_of(problem, theta, residuals, loss_for(problem.unstable))

    def ranked(self, simulator: Simulator, starts: Sequence[Vector]) -> list[tuple[float, Vector]]:
        """Costs and places where a fit may begin, the best first, of those that can be simulated.

        Raises:
            CosimError: of the first one, if none can.
        """
        costs, found, errors = [], [], []
        for theta in starts:
            try:
                costs.append(self.cost(simulator, theta))
                found.append(theta)
            except CosimError as error:
                errors.append(error)
        if not found:
            raise errors[0]
        return [(costs[i], found[i]) for i in np.argsort(costs, kind="stable")]

    def better(self, first: Fitted, second: Fitted) -> Gain:
        """What the second of two models is better by."""
        fitted = compare(self.fit_data, first.fit, second.fit, self.fitting)
        change = self.fitting.largest(second.fit - first.fit)
        if not self.unused:
            return Gain(fitted.gain, 0.0, fitted.z, 0.0, change)
        unused = compare(self.check_data, first.check, second.check, self.checking)
        change = max(change, self.checking.largest(second.check - first.check))
        return Gain(fitted.gain, unused.gain, fitted.z, unused.z, change)

    def law(
        self,
        fitted: Fitted,
        candidate: Candidate,
        twins: tuple[str, ...] = (),
        p_value: float | None = None,
    ) -> Law:
        """An effect of a model as the verdict sees it.

        Args:
            fitted: the model.
            candidate: the effect.
            twins: labels of those with the same signature.
            p_value: of its score.
        """
        problem, estimate, prefix = fitted.problem, fitted.estimate, candidate.prefix
        own = [p for p in problem.parameters if p.name.startswith(prefix)]
        strength = next(p for p in own if p.strength)
        values = tuple(
            replace(value_of(p, estimate), name=p.name.removeprefix(prefix)) for p in own
        )
        names = {n for n in (*problem.names, *problem.held) if n.startswith(prefix)}
        rest = fitted.labels - {candidate.label}
        # a model that cannot be simulated without it misses it as much as all effects together
        less = self.memo.get(frozenset() if rest in self.memo.failed else rest)
        return Law(
            candidate.effect, candidate.instance, candidate.port,
            strength.name.removeprefix(prefix), values, candidate.text,
            strength.absent, len(names), candidate.contains, twins,
            p_value,
            None if less is None else self.better(less, fitted),
            tick_of(self.raw, candidate.effect, strength.unit),
            tuple((n.removeprefix(prefix), problem.held[n])
                  for n in sorted(names - set(problem.names))),
        )  # fmt: skip

    def count_in_full(self, full: bool = True) -> Problem:
        """Let residuals count in full though runs may turn unstable, or not again."""
        return self.taken(self.raw.changed(far=full))

    def taken(self, raw: Problem) -> Problem:
        """Let models be judged as this problem says from now on."""
        self.raw = self.fitting.problem = self.checking.problem = raw
        return raw

    def recounted(self, fitted: Fitted, base: Fitted | None = None) -> Fitted:
        """A fitted model whose residuals count as they do now.

        Args:
            fitted: the model.
            base: without its last effect, recounted.
        """
        estimate = fitted.estimate
        problem = estimate.problem.changed(far=self.raw.far)
        simulator = estimate.simulator.limited({}).of(problem)
        loss = loss_for(problem.unstable)
        # the memo keeps none
        residuals = estimate.residuals or simulator.residuals(estimate.theta, self.fitting.names)
        robust = cost_of(problem, estimate.theta, residuals, loss)
        found = replace(fitted, estimate=replace(estimate, simulator=simulator, robust=robust))
        if base is not None:
            found.gate = compare(self.check_data, base.check, found.check, self.checking)
        return found

    def typical(self, fitted: Fitted) -> float:
        """See `loss.typical`."""
        return typical(self.fitting.by_run(self.fit_data - fitted.fit))

    def lacking(self, fitted: Fitted) -> bool:
        """Whether a channel still exceeds its noise."""
        return any(s.structured for s in whiteness_tests(self.fit_data - fitted.fit, self.fitting))

    def beside(self, fitted: Fitted) -> Vector:
        """What a model leaves of unused runs beside what its parameters' deviations make there.

        As it is where it is noise, where runs may turn unstable or be cut (a deviation is then no
        small change), and where it cannot be simulated beside its parameters.
        """
        rest, stack = self.check_data - fitted.check, self.checking
        if self.raw.unstable or self.raw.late or not self.unused:
            return rest
        if not any(s.structured or s.slow > UNNAMED for s in whiteness_tests(rest, stack)):
            return rest
        known = self._beside.get(fitted.labels)
        if known is None or known[0] is not fitted.estimate.theta:
            rows = list(zip(stack.names, stack.by_run(rest), strict=True))
            with suppress(CosimError):
                rest = stack.vector([values for _, values in foretold(fitted.estimate, rows)])
            known = self._beside[fitted.labels] = fitted.estimate.theta, rest
        return known[1]

    def accepted(self, base: Fitted, fitted: Fitted) -> bool:
        """Whether unused runs want it, and it is worth a cause."""
        return fitted.gate is not None and fitted.gate.passed and self.material(base, fitted)

    def freer(self, fitted: Fitted, other: Fitted) -> bool:
        """Whether fitted runs want the same laws with more parameters free, and unused ones agree.

        Unused runs decide on laws. Of a law that is there, a parameter that is held where fitted
        runs say that it is not bends all others, so that unused ones, too, hardly miss it.
        """
        unused = compare(self.check_data, fitted.check, other.check, self.checking)
        return self.gain(fitted, other) > GATE and unused.gain > 0.0

    def simplest(self, base: Fitted, best: Fitted, fitted: list[Fitted]) -> Fitted:
        """What explains the data as well as the best one, by fewer parameters.

        A law with a parameter more often does better by a hair where the simpler one is true. At
        another place, where a parameter more may make up for that, it must do so by even less than
        fits are exact.
        """
        hair = ALIKE * self.total(base, best)
        simpler = [
            f for f in fitted
            if self.accepted(base, f) and f.complexity < best.complexity and (
                (more_general(best, f) and not self.apart(f, best))
                or (f.quantity == best.quantity != ""
                    and self.total(base, best) - self.total(base, f) < hair)
            )
        ]  # fmt: skip
        return min(simpler, key=lambda f: f.complexity, default=best)

    def material(self, base: Fitted, other: Fitted) -> bool:
        """Whether the step between two models is large enough to be worth a cause.

        Shifts by less than a tick of the rig are none (`tick_of`).
        """
        last = other.signature.strength if other.signature is not None else None
        if last is not None:
            least = tick_of(self.raw, other.effects[-1].effect, last.unit)
            if abs(other.estimate.values[last.name]) < least:
                return False
        return (  # what has been simulated first
            self.checking.largest(other.check - base.check) > MATERIAL
            or self.fitting.largest(other.fit - base.fit) > MATERIAL
        )

    def gain(self, base: Fitted, other: Fitted) -> float:
        """Log likelihood gained on the identification runs, less one per additional parameter.

        Residuals that are far off count less (`loss.loss_for`).
        """
        costs = [f.estimate.robust + f.free for f in (base, other)]
        return costs[0] - costs[1]

    def total(self, base: Fitted, other: Fitted) -> float:
        """Log likelihood gained on all runs."""
        return self.gains(base, other)[0]

    def enough(self, best: Fitted, other: Fitted) -> float:
        """Cost on fitted runs [nats] from which another model may do as well as the best one.

        As far as unused runs like it better, it may be behind on fitted ones.
        """
        unused = compare(self.check_data, best.check, other.check, self.checking).gain
        return best.estimate.robust + max(unused, 0.0) + GATE

    def apart(self, first: Fitted, second: Fitted) -> bool:
        """Whether the runs tell two models apart."""

        def told(gate: Gate) -> bool:
            return abs(gate.z) > GATE_Z and abs(gate.gain) > GATE

        # what has been simulated first
        return told(compare(self.check_data, first.check, second.check, self.checking)) or told(
            compare(self.fit_data, first.fit, second.fit, self.fitting)
        )

    def gains(self, first: Fitted, second: Fitted) -> tuple[float, float]:
        """What a model gains over another one on all runs, and on unused ones [nats]."""
        unused = compare(self.check_data, first.check, second.check, self.checking).gain
        return self.gain(first, second) + unused, unused

    def far(self, base: Fitted) -> bool:
        """Whether a model lacks much, and parameters stand at their bounds to make the best of it.

        A fit from their nominal values may then end at a better minimum.
        """
        return is_open(base.estimate) and bool(base.estimate.at_bound)

    def explained(self, base: Fitted, fitted: list[Fitted]) -> bool:
        """Whether one of these models explains nearly all that the base leaves beyond noise."""
        noise = 0.5 * base.estimate.count
        beyond = base.estimate.robust - noise
        gains = [self.gain(base, f) for f in fitted]
        share = CONCENTRATED if self.raw.unstable else EXPLAINED
        return beyond > GATE and max(gains, default=0.0) > share * beyond

    def chosen(self, base: Fitted, fitted: list[Fitted]) -> Fitted | None:
        """The first of some models, best first, that unused runs want; None if there is none."""
        best = next((f for f in fitted if self.accepted(base, f)), None)
        return None if best is None else self.simplest(base, best, fitted)


def tick_of(raw: Problem, effect: str, unit: str) -> float:
    """The least strength with which a law shifts something by a tick of the rig; 0 for others.

    A time shorter than a tick says when within the tick something is read, and not that anything
    is missing; and so does a clock that loses no tick within the longest run.

    Args:
        raw: the problem.
        effect, unit: of the law's strength.
    """
    if raw.tick is None:
        return 0.0
    if effect == SKEW:
        return raw.tick / max(float(run.times[-1] - run.times[0]) for run in raw.runs)
    return raw.tick if unit == "s" else 0.0
