"""Fits of models with candidates: quick, thorough, from elsewhere, with and without an effect."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..calibrate.deferred import corrected
from ..calibrate.estimate import Estimate
from ..calibrate.fit import CORRECTION, DRAFT, INTERVALS, Effort, fit
from ..calibrate.known import Known
from ..calibrate.nuisance import settled, slopes
from ..calibrate.parts import Sensitivity
from ..calibrate.simulator import Simulator
from ..errors import CosimError
from .candidates import Candidate, new_parameters
from .doubling import doubled
from .judge import Judge
from .linear import Absorber, SampleStack
from .models import GATE, Fitted, absent, compare, is_open
from .redundant import without_redundant
from .secant import FLOOR, patience
from .signature import Signature
from .values import Values, exact, near

Vector = NDArray[np.float64]
Say = Callable[[str], None]
ITERATIONS = 6
"""Steps of a quick fit at most."""
QUICKLY = 3e-2
"""Share of the cost beyond the noise's below which a fall ends a quick fit."""
USUAL = 2.1
"""Usual values of a strength (see `SearchHints.tries`) by a larger factor away from what its first
order asks for are no places to begin."""
EXACT = 0.1
"""Share of a trial's strength by which the residual may ask for another one, and it is the same."""
CORRECTIONS, STALE = 4, 10.0
"""Times at most that errors of the exchange are taken from the data where a fit has ended, and what
they may be off by there [nats]: twice what decides between two models, about what jumps leave."""
AGAIN, BRINGS = 3, 0.1
"""Times at most that a model is fitted with new derivatives to come up with another one, and the
share of what it lacks that each must bring to be followed by another."""


class Fitter(Judge):
    """Fits models to one problem.

    Args:
        simulator: of the declared system with the data as measured, without limits (`patience`).
        check: purpose of the runs that are not used for fitting.
        say: told what is done.

    Attributes:
        declared: the declared problem, errors of the exchange removed once they are known.
        evaluations: simulated runs so far.
    """

    def __init__(self, simulator: Simulator, check: str, say: Say) -> None:
        super().__init__(simulator.problem, check)
        self.simulator, self.declared = simulator, simulator.problem
        self.say = say
        self.evaluations = 0
        self._own: dict[str, Sensitivity] | None = None
        self._begun: tuple[Fitted, Known] | None = None

    def fitted(
        self,
        simulator: Simulator,
        theta: Vector,
        close: Estimate | None = None,
        *,
        share: float = QUICKLY,
    ) -> Fitted:
        """Fit a model from a point close by; quickly, if a fit of nearly the same is given."""
        if close is not None and not simulator.limits:
            simulator = simulator.limited(patience(close.simulator))
        effort = Effort("near", iterations=ITERATIONS, share=share)
        known = None if close is None else close.known
        return self.judged(fit(simulator, theta, effort=effort, known=known))

    def sharpened(
        self, quick: Fitted, base: Fitted, effort: Effort = CORRECTION, goal: float = math.inf
    ) -> Fitted:
        """A quickly fitted model fitted again with derivatives of its own.

        Args:
            quick: what to fit.
            base: what its gain counts from.
            effort: of the fit, from there.
            goal: cost [nats] from which it is of use.
        """
        found = best = quick
        for _ in range(CORRECTIONS):
            theta = found.estimate.theta
            try:
                simulator = corrected(quick.simulator, theta, self.raw)
                estimate = fit(simulator, theta, effort=effort, goal=goal)
                found = self.again(self.judged(estimate), quick, base)
            except CosimError as error:  # a step finer than that of the quick fit may be unstable
                name = quick.effects[-1].label if quick.effects else "the declared model"
                self.say(f"{name} could not be fitted thoroughly: {error}")
                break
            if self.raw.unstable or self.stale(found) <= STALE:
                return found
            if self._own_cost(found) >= self._own_cost(best):  # corrections lead away
                return best if best is not quick else self._told(quick, base, effort)
            best = found
        return best

    def _told(self, fitted: Fitted, base: Fitted, effort: Effort) -> Fitted:
        """A model where it is, with intervals if these are wanted."""
        if effort.end in ("draft", "minimum"):
            return fitted
        theta = fitted.estimate.theta
        simulator = corrected(fitted.simulator, theta, self.raw)
        return self.again(self.judged(fit(simulator, theta, effort=INTERVALS)), fitted, base)

    def stale(self, fitted: Fitted) -> float:
        """By how much the exchange was corrected for another place than where a fit ended [nats].

        Its cost is that of corrected data; the model's own, without what the search's step adds, is
        the same if the correction holds there.
        """
        residuals = dict(fitted.estimate.residuals)
        taken = self.fitting.vector([residuals[run.name] for run in self.fitting.runs])
        return abs(self.fitting.cost(taken) - self._own_cost(fitted))

    def _own_cost(self, fitted: Fitted) -> float:
        """Cost of a model's own values, without what the search's step adds to them."""
        return self.fitting.cost(self.fit_data - fitted.fit)

    def again(self, result: Fitted, first: Fitted, base: Fitted) -> Fitted:
        """Mark a fit as another one of the same model, judged against the same base."""
        result.effects, result.signature = first.effects, first.signature
        result.gate = compare(self.check_data, base.check, result.check, self.checking)
        self.note(result)
        return result

    def judged(self, estimate: Estimate) -> Fitted:
        """An estimate with its model values, as a model that can be judged (effects: none yet)."""
        simulator = estimate.simulator
        names = [run.name for run in self.checking.runs if run.purpose != "identification"]
        if self._own is None:
            self._own = slopes(simulator, estimate.theta, names)
        theta = settled(simulator, estimate.theta, names, self._own)
        estimate = replace(estimate, theta=theta)
        self.evaluations += estimate.evaluations
        what = (simulator, theta, self.raw)
        fitting = self.fitting

        def fit_values() -> Vector:
            try:
                return exact(*what, fitting)
            except CosimError as error:
                self.say(f"{error}; it is judged with the search's exchange")
                return near(*what, fitting)

        one = self.raw.tick is not None and self.raw.step == self.raw.search.step
        values = Values(
            fit_values() if one else fit_values,
            exact(*what, self.checking),
            lambda: near(*what, fitting),
        )
        return Fitted((), estimate, values)

    def absorber(self, fitted: Fitted, stack: SampleStack, root: Vector | None = None) -> Absorber:
        """What the parameters of a fitted model can do in some of the identification runs.

        Args:
            fitted: the model.
            stack: of the runs.
            root: factors on the samples, if not all count the same.
        """
        slopes = {item.run: item for item in fitted.estimate.jacobian}
        matrix = stack.matrix([slopes[n] for n in stack.names], fitted.problem.scale)
        if root is not None:
            matrix *= root[:, None]
        return Absorber(matrix, fitted.problem, fitted.estimate.at_bound)

    def refit(
        self, base: Fitted, item: Signature, *, again: bool = True, goal: float = 0.0
    ) -> Fitted | None:
        """Fit the declared parameters and the effect's strength together.

        Args:
            base: model without the effect.
            item: the effect.
            again: from nominal values, too, where the base and a quick fit are far off.
            goal: gain [nats] that unkept derivatives must promise for other starts to be tried.
        """
        problem = item.candidate.added_to(base.problem)
        _, others = new_parameters(base.problem, problem)
        amplitude = item.score.amplitude or 1.0
        value = item.value * amplitude
        value = float(np.clip(value, item.strength.minimum, item.strength.maximum))
        span = abs(value) or item.strength.span
        least = item.strength.minimum
        if item.strength.unit == "s" and least >= 0.0:
            least = FLOOR * item.strength.span
            value = max(value, least)
        moved = [replace(p, span=span, minimum=least) if p.name == item.strength.name else p
                 for p in problem.parameters]  # fmt: skip
        problem = problem.with_parameters(moved)
        held = [p for p in others if p.name != item.probe.second]
        if held:
            problem = problem.hold({p.name: item.fixed.get(p.name, p.nominal) for p in held})
        simulator = base.simulator.of(problem).limited(patience(base.simulator))
        root = self.fitting.root(self.fit_data - base.fit)
        absorber = self.absorber(base, self.fitting, root)
        residual = root * (self.fit_data - base.fit - item.score.amplitude * item.change)
        shift = absorber.change(np.asarray(residual, dtype=np.float64)) * base.problem.scale
        own = [item.strength.name, *([item.probe.second] if item.probe.second else [])]
        starts = []
        near = [v for v in item.strength.hints.tries if 1.0 / USUAL < v / value < USUAL]
        along = [(1.0, value), (0.0, value), (0.0, 0.1 * value), *((1.0, v) for v in near)]
        if abs(item.score.amplitude - 1.0) > EXACT:
            # what was simulated: a steep law goes too far from there, or one that is imitated
            along.append((1.0 / amplitude, item.value))
        for factor, begun in along:
            theta = problem.nominal
            count = base.estimate.theta.size
            theta[:count] = base.estimate.theta + factor * shift
            theta[problem.index(item.strength.name)] = begun
            if item.probe.second:
                theta[problem.index(item.probe.second)] = item.second
            starts.append(np.clip(theta, problem.lower, problem.upper))
        try:
            (cost, first), *rest = self.ranked(simulator, starts)
            bend = abs(item.score.amplitude - 1.0) > EXACT and self.lacking(base)
            if bend or is_open(base.estimate):
                usual = item.strength.span if bend else 0.0
                first = doubled(
                    lambda theta: self.cost(simulator, theta), simulator.problem, first,
                    cost, item.strength.name, usual,
                )  # fmt: skip
            result = self.fitted(simulator, first, base.estimate)
            if result.estimate.unkept > max(GATE, goal - self.gain(base, result)):
                result = self._from_others(simulator, [s for _, s in rest], result)
            if again and self.far(base) and self.far(result):
                kept = self.effects(base)
                kept |= {name: float(starts[0][problem.index(name)]) for name in own}
                anew = self.anew(simulator, kept, base)
                if anew is not None and anew.estimate.robust < result.estimate.robust:
                    result = anew
        except CosimError as error:
            self.say(f"{item.candidate.label} could not be refitted: {error}")
            return None
        result.effects = (*base.effects, item.candidate)
        result.signature = item
        return result

    def _from_others(self, simulator: Simulator, starts: list[Vector], stalled: Fitted) -> Fitted:
        """The best fit from other starts, with derivatives of the model itself."""
        best, enough = stalled, stalled.estimate.robust - stalled.estimate.unkept
        for start in starts:
            try:
                found = self.judged(fit(simulator, start, effort=DRAFT))
            except CosimError as error:  # what there is stays
                self.say(f"not from another start: {error}")
                continue
            best = min(best, found, key=lambda f: f.estimate.robust)
            if best.estimate.robust < enough:
                break
        return best

    @staticmethod
    def effects(fitted: Fitted) -> dict[str, float]:
        """Values of a model's effects, and those that concern one run only."""
        return {
            p.name: fitted.estimate.values[p.name]
            for p in fitted.problem.parameters
            if p.run or p.role == "effect"
        }

    def begun(self, base: Fitted) -> Known:
        """Derivatives of a model at nominal values of its declared parameters."""
        if self._begun is None or self._begun[0] is not base:
            problem = base.problem
            theta = problem.nominal
            for name, value in self.effects(base).items():
                theta[problem.index(name)] = value
            limited = base.simulator.limited(patience(base.simulator))
            self._begun = base, Known.at(limited, theta)
        return self._begun[1]

    def anew(
        self, simulator: Simulator, kept: Mapping[str, float], base: Fitted | None = None
    ) -> Fitted | None:
        """A rough fit from nominal values; None if that cannot be simulated.

        Args:
            simulator: of the problem to fit.
            kept: parameters that begin elsewhere.
            base: a model without the last effect, whose derivatives will do.
        """
        problem = simulator.problem
        theta = problem.nominal
        for name, value in kept.items():
            theta[problem.index(name)] = value
        try:
            known = None if base is None else self.begun(base)
            effort = Effort("far", "draft", ITERATIONS, QUICKLY)
            return self.judged(fit(simulator, theta, effort=effort, known=known))
        except CosimError as error:
            self.say(f"no fit from nominal values: {error}")
            return None

    def unfitted(self, base: Fitted) -> Fitted | None:
        """A model with its declared parameters at their nominal values.

        None if that cannot be simulated: sizes of effects were fitted beside other values.
        """
        theta = base.problem.nominal
        for name, value in self.effects(base).items():
            theta[base.problem.index(name)] = value
        try:
            found = self.judged(fit(base.simulator, theta, effort=INTERVALS))
        except CosimError as error:
            self.say(f"nothing around nominal values: {error}")
            return None
        found.effects, found.signature = base.effects, base.signature
        return found

    def retried(self, winner: Fitted, base: Fitted) -> Fitted:
        """The model fitted from nominal values, as the first one was, if that leads farther.

        Parameters that had made up for an effect may hold its model in a poor minimum; with the
        effect in the model, nominal values are near again.
        """
        if not self.far(base) or not is_open(winner.estimate):
            return winner
        simulator = winner.simulator
        if not self.raw.far:
            simulator = corrected(simulator, winner.estimate.theta, self.raw)
        effects = {p.name for p in simulator.problem.parameters if p.role == "effect"}
        kept = {n: v for n, v in winner.estimate.values.items() if n in effects}
        found = self.anew(simulator, kept)
        if found is None or not found.estimate.robust < winner.estimate.robust - GATE:
            return winner
        self.say(f"{winner.effects[-1].label}: a better minimum from nominal values")
        return self.again(found, winner, base)

    def snapped(self, winner: Fitted, base: Fitted) -> Fitted:
        """The model with its last effect's parameters at values where it is exact, if that does.

        See `SearchHints.lattice`: steps that come a sample too late cost much, whatever the
        fraction of a sample, so derivatives do not lead to the right one; and others may do as
        well.
        """
        prefix = winner.effects[-1].prefix
        for p in winner.problem.parameters:
            lattice = p.hints.lattice
            if not (lattice and p.name.startswith(prefix)):
                continue
            place = winner.problem.index(p.name)
            nearest = math.floor(winner.estimate.theta[place] / lattice)
            best, known = winner, {0}
            while fresh := sorted({nearest, nearest + 1, nearest - (best is not winner)} - known):
                known |= set(fresh)
                for count in fresh:
                    value = count * lattice
                    if not p.minimum <= value <= p.maximum:
                        continue
                    found = self.held(winner, p.name, value)
                    least = -GATE if best is winner else GATE
                    if found is not None and self.gain(best, found) > least:
                        best, nearest = found, count
            if best is not winner:
                self.say(f"{winner.effects[-1].label}: {p.name} = {nearest * lattice:g} {p.unit}")
                theta = winner.estimate.theta.copy()
                theta[np.arange(theta.size) != place] = best.estimate.theta
                theta[place] = nearest * lattice
                whole = replace(winner, estimate=replace(winner.estimate, theta=theta))
                found = self.sharpened(whole, base)
                if found is not whole and self.gain(winner, found) > -GATE:
                    winner = found
        return winner

    def held(self, fitted: Fitted, name: str, value: float) -> Fitted | None:
        """A model quickly fitted with one parameter held; None if it cannot be simulated."""
        place = fitted.problem.index(name)
        theta = fitted.estimate.theta.copy()
        theta[place] = value
        try:
            simulator = corrected(fitted.simulator, theta, self.raw)
            held = simulator.of(simulator.problem.hold({name: value}))
            return self.fitted(held, np.delete(theta, place), fitted.estimate)
        except CosimError as error:
            self.say(f"{name} = {value:g}: {error}")
            return None

    def refined(
        self, base: Fitted, fitted: Fitted, *, quick: bool = False, share: float = QUICKLY
    ) -> Fitted:
        """The fit with all parameters of its last effect free, if fitted runs want that.

        Unused ones must not refuse it.

        Args:
            base: model without the effect.
            fitted: that fit.
            quick: a thorough one follows anyway.
            share: see `Effort`.
        """
        item = fitted.signature
        if item is None:
            return fitted
        whole = item.candidate.added_to(base.problem)
        _, others = new_parameters(base.problem, whole)
        if not others:
            return fitted
        spans = {p.name: p.span for p in fitted.problem.parameters}
        problem = whole.with_parameters(
            [replace(p, span=spans.get(p.name, p.span)) for p in whole.parameters]
        ).changed(runs=fitted.problem.runs)  # with their late values
        theta = problem.nominal
        for name, value in {**item.fixed, **fitted.estimate.values}.items():
            theta[problem.index(name)] = value
        try:
            result = self.fitted(self.simulator.of(problem), theta, fitted.estimate, share=share)
        except CosimError as error:
            self.say(f"{item.candidate.label} with its other parameters: {error}")
            return fitted
        known = self.memo.get(fitted.labels)
        result = self.again(result, fitted, base)
        if result.estimate.unkept > GATE and not self.freer(fitted, result):  # it has stalled
            fitted, result = (self.sharpened(f, base, DRAFT) for f in (fitted, result))
        if not self.freer(fitted, result):
            if known is not None:
                self.memo.keep(known)  # runs do not want these parameters
            self.note(fitted)
            return fitted
        self.say(f"{item.candidate.label}: its other parameters are wanted, too")
        result = self.again(without_redundant(self, result, others), fitted, base)
        return result if quick else self.sharpened(result, base, DRAFT)

    def approached(self, trial: Fitted, goal: Fitted, base: Fitted) -> Fitted:
        """A model fitted with derivatives of its own, as long as another does better and it helps.

        Derivatives of the other say little about it where one of them sticks and one does not.
        """
        for _ in range(AGAIN):
            worse = self.gain(trial, goal)
            unused = compare(self.check_data, trial.check, goal.check, self.checking).gain
            if max(worse, worse + unused) <= GATE:
                break
            near = self.sharpened(trial, base, DRAFT)
            fall = self.gain(trial, near)
            trial = near if fall > 0.0 else trial
            if fall < max(BRINGS * worse, GATE):
                break
        return trial

    def without(self, fitted: Fitted, effect: Candidate) -> Fitted:
        """A model refitted with one of its effects absent."""
        problem = fitted.problem
        held = absent(fitted, effect)
        keep = [i for i, p in enumerate(problem.parameters) if p.name not in held]
        less = self.simulator.of(problem.hold(held))
        result = self.fitted(less, fitted.estimate.theta[keep], fitted.estimate)
        result.effects = tuple(e for e in fitted.effects if e != effect)
        result.signature = None if effect == fitted.effects[-1] else fitted.signature
        self.note(result)
        return result
