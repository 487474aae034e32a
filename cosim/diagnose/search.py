"""Rounds of attribution: score all candidates, refit the best, judge them on unused runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..calibrate.estimate import Estimate
from ..calibrate.fit import QUICKLY, Known, fit
from ..calibrate.nuisance import released, settled, slopes
from ..calibrate.parts import Sensitivity
from ..calibrate.problem import Problem
from ..errors import CosimError
from ..provider import locate
from ..variants import apply
from .candidates import Candidate, balances, candidates, new_parameters
from .deferred import corrected, step_error
from .exchange import absent, challenged, is_open
from .judge import Judge
from .linear import MATERIAL, Absorber, Layout, holm
from .models import GATE, GATE_Z, LEVEL, Fitted, compare
from .probes import batches
from .secant import FLOOR, Bench, model_values, patience
from .signature import Signature, merge, worthy

Vector = NDArray[np.float64]
NEARLY = 0.7
"""Share of `MATERIAL` from which a candidate is refitted: its linear size is an estimate."""
REFITS, ITERATIONS = 6, 6
"""Candidates that are refitted, and steps of a quick fit, at most."""
PART = 0.2
"""A candidate that gains less than this share of what the best one gains, to first order, is not
refitted: it is no rival, and another round will ask again."""
MEMBERS = 2
"""Members of a group (swivels of casters) that are refitted with one effect at most, the best."""
SHARED, WHOLES = 0.5, 3
"""What acts alike on all of a group (the swivels of all casters) is refitted as well if it gains
this share of what the best one gains, and at most so many: members must not crowd it out."""
EXTRA = 2
"""Where the model is far off, so many that gain half as much as the best one are refitted though
not significant: the blocks' variance is then that of what is missing."""
REFINED, CLOSE, LOOSE = 3, 0.95, 0.8
"""So many quick fits are made thorough, if they gain this share of what the best one gains; the
second share counts where the model before was far off."""
RIVAL = 0.5
"""Where a candidate explains nearly all, those that gain less than this share of what the best one
gains to first order are no rivals."""
WORTH = 0.05
"""Late values are kept if they remove this share of what a model leaves beyond noise."""
ALIKE = 1e-5
"""Share of what they explain by which candidates may differ that are one to first order."""
ROUNDS = 4
CHECK = "validation"
Say = Callable[[str], None]


@dataclass
class Round:
    """One round.

    Attributes:
        base: model that the round began with.
        signatures: scored candidates, best first.
        corrected: p value by label, corrected for their number.
        aside: labels of those that one run ruled out.
        fitted: refitted candidates, best first.
        winner: accepted one.
        rivals: fitted ones that the data cannot tell from it.
        open: whether more was so evidently missing that the choice waits for it.
    """

    base: Fitted
    signatures: list[Signature]
    corrected: dict[str, float]
    aside: tuple[str, ...] = ()
    fitted: list[Fitted] = field(default_factory=list)
    winner: Fitted | None = None
    rivals: list[Fitted] = field(default_factory=list)
    open: bool = False


class Search(Judge):
    """Attribution on one problem.

    Args:
        problem: declared system.
        say: told what is done.
        only: candidates to consider, all of the catalogue if not given.
    """

    def __init__(
        self, problem: Problem, say: Say = lambda text: None, only: list[Candidate] | None = None
    ) -> None:
        self.say = say
        super().__init__(problem, CHECK)
        self.declared = problem
        self.whole = only is None
        self.known = candidates(problem) if only is None else only
        self.evaluations = 0
        self.rounds: list[Round] = []
        self.own: dict[str, Sensitivity] | None = None
        self._begun: tuple[Fitted, Known] | None = None
        self._builder = ThreadPoolExecutor(1)

    def prepare(self, problem: Problem | None = None) -> None:
        """Have the candidates' FMUs built in the background, while something else is computed.

        Args:
            problem: to which they will be added, the declared one if not given.
        """
        known = self.known if problem is None else candidates(problem)
        problem = problem or self.declared
        for batch in batches(known, problem):
            first = batch.members[0][0]
            variant = apply(problem.instances, batch.change or first.change, problem.provider)
            self._builder.submit(locate, variant[first.instance], problem.provider)

    def close(self) -> None:
        """Stop building."""
        self._builder.shutdown(wait=True, cancel_futures=True)

    def calibrated(self) -> Fitted:
        """Fit the declared system, errors of the communication step removed from then on."""
        raw = self.raw
        coarse = raw._with(step=raw.search_step)
        exact = raw.ticks and raw.search_step == raw.step
        first = fit(coarse, None, limit=6, robust=True, polish=exact, rough=not exact)
        coarse.close()
        self.evaluations += first.evaluations
        self.say(
            f"declared parameters fitted: cost per residual {2 * first.cost / first.count:.3f}"
        )
        if exact:
            return self.judged(first)
        near = corrected(raw, first.theta, raw)
        second = fit(near, first.theta, known=Known.of(first))
        near.close()
        self.evaluations += second.evaluations
        self.say("errors of the exchange removed")
        self.declared = corrected(raw, second.theta, raw)
        if is_open(second):  # far off, its parameters' intervals mean nothing
            return self.judged(fit(self.declared, second.theta, near=True, draft=True))
        return self.judged(fit(self.declared, second.theta, limit=0, robust=False))

    def fitted(
        self,
        problem: Problem,
        theta: Vector,
        close: Estimate | None = None,
        *,
        share: float = QUICKLY,
    ) -> Fitted:
        """Fit a model from a point close by; quickly, if a fit of nearly the same is given."""
        known = None if close is None else Known.of(close)
        return self.judged(
            fit(
                problem, theta, limit=ITERATIONS, robust=False, polish=known is None,
                known=known, share=share,
            )
        )  # fmt: skip

    def sharpened(self, quick: Fitted, base: Fitted, *, draft: bool = False) -> Fitted:
        """A quickly fitted model fitted again with derivatives of its own.

        Args:
            quick: what to fit.
            base: what its gain counts from.
            draft: only to be compared; its intervals are not needed.
        """
        theta = quick.estimate.theta
        try:
            problem = corrected(quick.problem, theta, self.raw)
            found = self.judged(fit(problem, theta, near=True, draft=draft))
        except CosimError as error:  # a step finer than that of the quick fit may be unstable
            self.say(f"{quick.effects[-1].label} could not be fitted thoroughly: {error}")
            return quick
        return self.again(found, quick, base)

    def again(self, result: Fitted, first: Fitted, base: Fitted) -> Fitted:
        """Mark a fit as another one of the same model, judged against the same base."""
        result.effects, result.signature = first.effects, first.signature
        result.p_value = first.p_value
        result.gate = compare(self.check_data, base.check, result.check, self.checking)
        return result

    def judged(self, estimate: Estimate) -> Fitted:
        """A fit with its model values."""
        problem = estimate.problem
        names = [run.name for run in self.checking.runs if run.purpose != "identification"]
        if self.own is None:
            self.own = slopes(problem, estimate.theta, names)
        theta = settled(problem, estimate.theta, names, self.own)
        estimate = replace(estimate, theta=theta)
        self.evaluations += estimate.evaluations
        exact = self._exact(problem, theta)
        return Fitted(
            (),
            estimate,
            self.fitting.vector([exact[run.name] for run in self.fitting.runs]),
            self.checking.vector([exact[run.name] for run in self.checking.runs]),
        )

    def _exact(self, problem: Problem, theta: Vector) -> dict[str, Vector]:
        """Model values over sigma by run, free of what the search's step adds."""
        data = {run.name: run.data for run in self.raw.runs}
        real = problem.with_data(data)._with(step=self.raw.step)
        errors = step_error(real, theta, self.raw.step)
        values = {
            name: (data[name] - errors[name]) / problem.sigma - residual
            for name, residual in real.residuals(theta, None)
        }
        real.close()
        return values

    # -- one round ---------------------------------------------------------------------------------

    def absorber(self, fitted: Fitted, layout: Layout) -> Absorber:
        """What the parameters of a fitted model can do in some of the identification runs."""
        slopes = {item.run: item for item in fitted.estimate.jacobian}
        matrix = layout.matrix([slopes[n] for n in layout.names], fitted.problem.scale)
        return Absorber(matrix, fitted.problem, fitted.estimate.at_bound)

    def bench(self, base: Fitted, layout: Layout) -> Bench:
        """A bench for candidates around a fitted model."""
        problem = base.problem
        model = model_values(problem, base.estimate.theta, layout)
        rows = zip(
            self.fitting.names, self.fitting.by_run(self.fit_data - base.fit), strict=True
        )  # fmt: skip
        rest = dict(rows)
        residual = layout.vector([rest[n] for n in layout.names])
        return Bench(
            problem, base.estimate.theta, layout, model, residual, self.absorber(base, layout)
        )

    def telling(self, base: Fitted) -> Layout:
        """The run with most of what the model lacks; all, if no channel exceeds its noise."""
        if not self.lacking(base):
            return self.fitting
        residual = self.fit_data - base.fit
        rows = self.fitting.by_run(residual)
        excess = [float(np.nansum(r**2)) - np.count_nonzero(np.isfinite(r)) for r in rows]
        return Layout(self.raw, [self.fitting.runs[int(np.argmax(excess))]])

    def scored(self, base: Fitted) -> Round:
        """Score all candidates against a model's residual.

        Where the model evidently lacks something, one run tells which candidates are worth the
        simulation of all runs.
        """
        if base.effects and self.whole:  # what was added may have balances of its own
            self.known = candidates(base.problem)
        present = {item.label for item in base.effects}
        chosen = [c for c in self.known if c.label not in present]
        layout = self.telling(base)
        bench = self.bench(base, layout)
        signatures = bench.followed(bench.begun(chosen, thorough=layout is not self.fitting))
        self.evaluations += bench.evaluations
        aside: tuple[str, ...] = ()
        if layout is not self.fitting:
            kept = worthy(signatures)
            labels = {s.candidate.label for s in kept}
            aside = tuple(s.candidate.label for s in signatures if s.candidate.label not in labels)
            self.say(f"run {layout.names[0]} leaves {len(kept)} of {len(signatures)} candidates")
            bench = self.bench(base, self.fitting)
            signatures = bench.continued(kept)
            self.evaluations += bench.evaluations
        signatures = merge(sorted(signatures, key=lambda s: s.tuned))
        corrected = holm([s.score.p_value for s in signatures], len(signatures) + len(aside))
        named = {s.candidate.label: float(p) for s, p in zip(signatures, corrected, strict=True)}
        named |= {label: named[s.candidate.label] for s in signatures for label in s.same}
        signatures.sort(key=lambda s: -s.score.gain)
        return Round(base, signatures, named, aside)

    def promising(self, current: Round) -> list[Signature]:
        """Candidates worth a refit: significant, not too small to matter, the best gains first.

        Where something is evidently missing and none is significant (an effect that shows in few
        moments has few blocks to prove itself), unused runs decide alone. So they do on a few more
        where the model is far off.
        """
        able = [
            s
            for s in current.signatures
            if not s.unseen
            and s.score.gain > GATE
            and self.fitting.largest(s.asked) > NEARLY * MATERIAL
        ]
        good = [s for s in able if current.corrected[s.candidate.label] < LEVEL]
        if not good and self.lacking(current.base):
            good = [s for s in able if s.score.z > GATE_Z]
        best = max((s.score.gain for s in good), default=0.0)
        single = balances(current.base.problem)
        alike: Counter[tuple[str, str, str]] = Counter()
        few = []
        for s in good:
            instance, port = s.candidate.instance, s.candidate.port
            if (instance, port) in single and "." in port:
                key = (s.candidate.effect, instance, port.rpartition(".")[2])
                alike[key] += 1
                if alike[key] > MEMBERS:
                    continue
            if s.score.gain > PART * best:
                few.append(s)
        shared = [
            s
            for s in few[REFITS:]
            if s.score.gain > SHARED * best
            and s.candidate.port
            and (s.candidate.instance, s.candidate.port) not in single
        ]
        chosen = few[:REFITS] + shared[:WHOLES]
        if chosen and is_open(current.base.estimate):
            known = {s.candidate.label for s in (*good, *chosen)}
            chosen += [
                s for s in able
                if s.candidate.label not in known and s.score.z > GATE_Z
                and s.score.gain > SHARED * best
            ][:EXTRA]  # fmt: skip
        return chosen

    def refit(self, base: Fitted, item: Signature, *, again: bool = True) -> Fitted | None:
        """Fit the declared parameters and the effect's strength together.

        Args:
            base: model without the effect.
            item: the effect.
            again: from nominal values, too, where the base and a quick fit are far off.
        """
        problem = item.candidate.added_to(base.problem)
        _, others = new_parameters(base.problem, problem)
        value = item.value * (item.score.amplitude or 1.0)
        value = float(np.clip(value, item.strength.minimum, item.strength.maximum))
        span = abs(value) or item.strength.span
        least = item.strength.minimum
        if item.strength.unit == "s":
            least = FLOOR * item.strength.span
            value = max(value, least)
        moved = [replace(p, span=span, minimum=least) if p.name == item.strength.name else p
                 for p in problem.parameters]  # fmt: skip
        problem = problem.with_parameters(moved)
        held = [p for p in others if p.name != item.probe.second]
        if held:
            problem = problem.hold({p.name: item.fixed.get(p.name, p.nominal) for p in held})
        problem.limits = patience(base.problem)
        absorber = self.absorber(base, self.fitting)
        residual = self.fit_data - base.fit - item.score.amplitude * item.change
        shift = absorber.change(np.asarray(residual, dtype=np.float64)) * base.problem.scale
        own = [item.strength.name, *([item.probe.second] if item.probe.second else [])]
        starts = []
        for factor, part in ((1.0, 1.0), (0.0, 1.0), (0.0, 0.1)):
            theta = problem.nominal
            count = base.estimate.theta.size
            theta[:count] = base.estimate.theta + factor * shift
            theta[problem.index(item.strength.name)] = part * value
            if item.probe.second:
                theta[problem.index(item.probe.second)] = item.second
            starts.append(np.clip(theta, problem.lower, problem.upper))
        try:
            costs = [self._cost(problem, theta) for theta in starts]
            result = self.fitted(problem, starts[int(np.argmin(costs))], base.estimate)
            if again and self.far(base) and self.far(result):
                kept = self.effects(base)
                kept |= {name: float(starts[0][problem.index(name)]) for name in own}
                anew = self.anew(problem, kept, base, limit=ITERATIONS)
                if anew is not None and anew.estimate.robust < result.estimate.robust:
                    result = anew
        except CosimError as error:
            self.say(f"{item.candidate.label} could not be refitted: {error}")
            return None
        result.effects = (*base.effects, item.candidate)
        result.signature = item
        return result

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
            problem = base.problem._with()
            problem.limits = patience(base.problem)
            theta = problem.nominal
            for name, value in self.effects(base).items():
                theta[problem.index(name)] = value
            self._begun = base, Known.at(problem, theta)
            problem.close()
        return self._begun[1]

    def anew(
        self, problem: Problem, kept: Mapping[str, float], base: Fitted | None = None, **how: Any
    ) -> Fitted | None:
        """A rough fit from nominal values; None if that cannot be simulated.

        Args:
            problem: to fit.
            kept: parameters that begin elsewhere.
            base: a model without the last effect, whose derivatives will do.
            how: arguments of `fit`.
        """
        theta = problem.nominal
        for name, value in kept.items():
            theta[problem.index(name)] = value
        try:
            known = None if base is None else self.begun(base)
            return self.judged(fit(problem, theta, rough=True, known=known, share=QUICKLY, **how))
        except CosimError as error:
            self.say(f"no fit from nominal values: {error}")
            return None

    def _cost(self, problem: Problem, theta: Vector) -> float:
        return sum(float(np.nansum(r**2)) for _, r in problem.residuals(theta, self.fitting.names))

    def round(self, base: Fitted) -> Round:
        """Score, refit the best, choose."""
        current = self.scored(base)
        promising = self.promising(current)
        most = max((s.score.gain for s in promising), default=0.0)
        for item in promising:
            explained = self.explained(base, current.fitted)
            if not explained or item.score.gain >= RIVAL * most:
                self.tried(base, current, item, again=not explained)
        current.fitted.sort(key=lambda f: -self.total(base, f))
        first = self.chosen(base, current.fitted)
        if first is not None and is_open(first.estimate):
            return self.opened(base, current, first)
        # quick fits are too far from their minima to be told apart
        self.finish(base, current, LOOSE if self.far(base) else CLOSE)
        current.winner = self.chosen(base, current.fitted)
        if current.winner is not None:
            current.winner = challenged(self, base, current)
            drafted = current.winner
            current.winner = self.sharpened(self.released(self.retried(drafted, base), base), base)
            current.fitted = [current.winner if f is drafted else f for f in current.fitted]
            if self.whole:
                self.prepare(current.winner.problem)
            wanted = [f for f in current.fitted if f.gate is not None and f.gate.passed]
            current.rivals = self.rivals(current.winner, wanted)
        self.rounds.append(current)
        return current

    def opened(self, base: Fitted, current: Round, first: Fitted) -> Round:
        """End a round whose best model evidently lacks more: others are compared after that."""
        found = self.refined(base, self.retried(first, base), quick=True)
        current.winner = self.released(found, base)
        if current.winner is found:
            current.winner = self.sharpened(found, base, draft=True)
        if not is_open(current.winner.estimate):
            current.winner = self.sharpened(current.winner, base)
        current.fitted = [current.winner if f is first else f for f in current.fitted]
        current.open = True
        if self.whole:
            self.prepare(current.winner.problem)
        self.rounds.append(current)
        return current

    def tried(self, base: Fitted, current: Round, item: Signature, *, again: bool) -> None:
        """Refit a candidate and note what that gains."""
        fitted = self.refit(base, item, again=again)
        if fitted is None:
            return
        fitted.p_value = current.corrected[item.candidate.label]
        fitted.gate = compare(self.check_data, base.check, fitted.check, self.checking)
        current.fitted.append(fitted)
        self.say(
            f"{item.candidate.label}: {self.gain(base, fitted):.0f} nats on identification, "
            f"{fitted.gate.gain:.0f} on validation (z {fitted.gate.z:.1f})"
        )

    def kin(self, base: Fitted, current: Round) -> list[Signature]:
        """Twins of what was fitted that the winner must be compared with: they have not been.

        To first order they are one, but where an effect explains millions of nats, what differs in
        the sixth digit tells its place, and a simpler law there from the winner.
        """
        winner = current.winner
        if winner is None or winner.signature is None:
            return []
        if ALIKE * self.total(base, winner) < GATE:
            return []
        last, tuned = winner.effects[-1], winner.signature.tuned
        twins = [t for f in current.fitted if f.signature is not None for t in f.signature.twins]
        return [
            t for t in twins
            if t.candidate.effect == last.effect
            or (t.candidate.place == last.place and t.tuned < tuned)
        ]  # fmt: skip

    def retried(self, winner: Fitted, base: Fitted) -> Fitted:
        """The model fitted from nominal values, as the first one was, if that leads farther.

        Parameters that had made up for an effect may hold its model in a poor minimum; with the
        effect in the model, nominal values are near again.
        """
        if not self.far(base) or not is_open(winner.estimate):
            return winner
        problem = corrected(winner.problem, winner.estimate.theta, self.raw)
        effects = {p.name for p in problem.parameters if p.role == "effect"}
        kept = {n: v for n, v in winner.estimate.values.items() if n in effects}
        found = self.anew(problem, kept, limit=6, robust=True)
        if found is None or not found.estimate.robust < winner.estimate.robust - GATE:
            return winner
        self.say(f"{winner.effects[-1].label}: a better minimum from nominal values")
        return self.again(found, winner, base)

    def released(self, winner: Fitted, base: Fitted) -> Fitted:
        """The model with late values of the runs (start angles of casters) estimated, if it helps.

        The effect may be what makes them matter: dry friction keeps casters where they were.
        """
        if not self.raw.late or not self.lacking(winner):
            return winner
        problem = corrected(winner.problem, winner.estimate.theta, self.raw)
        try:
            problem, theta, fall = released(problem, winner.estimate.theta)
            if fall < WORTH * (winner.estimate.cost - 0.5 * winner.estimate.count):
                return winner
            self.say(f"start values of the runs estimated: {fall:.0f} nats")
            found = self.judged(fit(problem, theta, near=True, draft=True))
        except CosimError as error:
            self.say(f"start values of the runs could not be estimated: {error}")
            return winner
        return self.again(found, winner, base) if self.gain(winner, found) > 0.0 else winner

    def finish(self, base: Fitted, current: Round, share: float) -> None:
        """Replace the first few quick fits by thorough ones.

        Args:
            base: model without the effects.
            current: round whose fits are replaced.
            share: of the best gain, below which a quick fit stays one.
        """
        least = share * max((self.total(base, f) for f in current.fitted), default=0.0)
        good = [f for f in current.fitted if self.accepted(base, f)]
        near = [f for f in good if self.total(base, f) > least][:REFINED]
        better = {
            id(f): self.refined(base, self.sharpened(f, base, draft=True) if near[1:] else f)
            for f in near
        }
        current.fitted = [better.get(id(f), f) for f in current.fitted]
        current.fitted.sort(key=lambda f: -self.total(base, f))

    def refined(
        self, base: Fitted, fitted: Fitted, *, quick: bool = False, share: float = QUICKLY
    ) -> Fitted:
        """The fit with all parameters of its last effect free, if unused runs want that.

        Args:
            base: model without the effect.
            fitted: that fit.
            quick: a thorough one follows anyway.
            share: see `fit`.
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
        )
        theta = problem.nominal
        for name, value in {**item.fixed, **fitted.estimate.values}.items():
            theta[problem.index(name)] = value
        try:
            result = self.fitted(problem, theta, fitted.estimate, share=share)
        except CosimError as error:
            self.say(f"{item.candidate.label} with its other parameters: {error}")
            return fitted
        result = self.again(result, fitted, base)
        better = self.gain(fitted, result) > GATE
        if (
            not better
            or not compare(self.check_data, fitted.check, result.check, self.checking).passed
        ):
            return fitted
        self.say(f"{item.candidate.label}: its other parameters are wanted, too")
        return result if quick else self.sharpened(result, base, draft=True)

    def without(self, fitted: Fitted, effect: Candidate) -> Fitted:
        """A model refitted with one of its effects absent."""
        problem = fitted.problem
        held = absent(fitted, effect)
        keep = [i for i, p in enumerate(problem.parameters) if p.name not in held]
        result = self.fitted(problem.hold(held), fitted.estimate.theta[keep], fitted.estimate)
        result.effects = tuple(e for e in fitted.effects if e != effect)
        result.signature = fitted.signature
        return result

    def eliminated(self, fitted: Fitted) -> Fitted:
        """The model without effects that later ones have made superfluous."""
        for effect in fitted.effects[:-1]:
            try:
                less = self.without(fitted, effect)
            except CosimError as error:  # it is needed
                self.say(f"without {effect.label}: {error}")
                continue
            gate = compare(self.check_data, less.check, fitted.check, self.checking)
            if not gate.passed:
                self.say(f"dropped again: {effect.label}")
                return self.eliminated(less)
        return fitted
