"""Rounds of attribution: score all candidates, refit the best, judge them on unused runs."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..calibrate.deferred import corrected
from ..calibrate.fit import DRAFT, MINIMUM, POLISH, Effort, fit
from ..calibrate.loss import typical
from ..calibrate.problem import Problem
from ..calibrate.simulator import Simulator
from ..errors import UnbuiltError, UnknownNameError, listing
from ..system.provider import expected, locate
from ..system.variants import apply
from .candidates import Candidate, candidates
from .completing import completed, freed
from .established import needed, settle
from .fitter import ITERATIONS, Say
from .grounding import grounded
from .judge import OFF
from .late_values import LateValueFitter
from .linear import SampleStack, holm
from .models import GATE, Fitted, compare, is_open, more_general
from .probes import batches
from .rivals import challenged, nearly, reconsidered, restarted
from .rounds import Round, named_few
from .secant import Bench, model_values
from .shafts import followed_shafts
from .shortlist import promising, remaining
from .signature import Signature, merge, worthy
from .whiteness import whiteness_tests

Vector = NDArray[np.float64]
REFINED, CLOSE, LOOSE = 3, 0.95, 0.8
"""So many quick fits are made thorough, if they gain this share of what the best one gains; the
second share counts where the model before was far off, and for what derivatives must promise beside
a law that explains nearly all."""
SIMPLER = 1
"""Simpler laws at the best one's place that are fitted as far where much more is missing."""
UNWANTED, SLIGHT = 2, 0.1
"""So many where unused runs want none, if they gain this share of what the best one gains: the
best, and one that it may imitate. Each costs a thorough fit, after which mostly none is wanted."""
RIVAL = 0.5
"""Where a candidate explains nearly all, those that gain less than this share of what the best one
gains to first order are no rivals: around the declared model a first order may be off by half."""
UNEVEN = 10.0
"""Runs that are farther off than this many times the mean square of the one that is least off do
not choose candidates: linear signatures are wrong there, or an unstable moment decides."""
TELLING = 0.5
"""Share of what the model lacks that the runs must hold which choose candidates: what does nothing
in them is not what is missing, or not most of it. One run, where it is in one."""
ROUNDS = 4
"""Laws that are added one by one: as many as there may be at once."""
CHECK = "validation"


class Search(LateValueFitter):
    """Attribution on one problem.

    Args:
        simulator: of the declared system, without limits (`patience`).
        say: told what is done.
        only: candidates to consider, all of the catalogue if not given.
        without: effects that are left out of the catalogue.

    Raises:
        UnknownNameError: no effect of that name fits the system.
    """

    def __init__(
        self,
        simulator: Simulator,
        say: Say = lambda text: None,
        only: list[Candidate] | None = None,
        without: Iterable[str] = (),
    ) -> None:
        super().__init__(simulator, CHECK, say)
        problem = self.declared
        self.whole, self.narrow = only is None, False
        self.withheld = frozenset(without)
        self.known = candidates(problem) if only is None else only
        names = {c.effect for c in self.known}
        for name in sorted(self.withheld - names):
            raise UnknownNameError(
                f"{problem.file.path}: no effect {name!r} of the catalogue fits this system; "
                f"{listing(sorted(names), name)}"
            )
        self.known = self.offered(self.known)
        self.rounds: list[Round] = []
        self._builder = ThreadPoolExecutor(1)

    def prepare(self, problem: Problem | None = None) -> None:
        """Have the candidates' FMUs built in the background, while something else is computed.

        Args:
            problem: to which they will be added, the declared one if not given.

        Raises:
            UnbuiltError: FMUs for the declared one are missing and cannot be built.
        """
        if problem is None:
            self._build(self.declared, _changes(self.known, self.declared))
            return
        with suppress(UnbuiltError):  # the round that asks for them says so
            self._build(problem, _changes(self.offered(candidates(problem)), problem))

    def narrowed(self, labels: Collection[str]) -> None:
        """Consider some candidates alone, until `widened`."""
        self.known, self.whole = [c for c in self.known if c.label in labels], False
        self.narrow = True

    def widened(self) -> None:
        """Consider all candidates of the catalogue."""
        self.known, self.whole = self.offered(candidates(self.declared)), True
        self.narrow = False

    def offered(self, known: list[Candidate]) -> list[Candidate]:
        """Those that are not left out."""
        return [c for c in known if c.effect not in self.withheld]

    def _build(self, problem: Problem, changes: Iterable[Mapping[str, str]]) -> None:
        """Have changed FMUs of a problem built in the background."""
        variants = [
            apply(problem.instances, {instance: change}, problem.provider)[instance]
            for instance, change in dict.fromkeys(pair for c in changes for pair in c.items())
        ]
        expected(problem.provider, variants)
        for variant in variants:
            self._builder.submit(locate, variant, problem.provider)

    def close(self) -> None:
        """Stop building."""
        self._builder.shutdown(wait=True, cancel_futures=True)

    def calibrated(self, start: Mapping[str, float] | None = None) -> Fitted:
        """Fit the declared system, errors of the communication step removed from then on.

        Args:
            start: parameters of another system's fit, from which this one's are not far.
        """
        raw = self.raw
        step = raw.search.step
        exact = raw.tick is not None and step == raw.step
        end: Literal["draft", "polished"] = "polished" if exact else "draft"
        effort = Effort("far" if start is None else "near", end, ITERATIONS)
        theta = raw.nominal
        for name, value in (start or {}).items():
            if name in raw.names:
                theta[raw.index(name)] = value
        first = fit(self.simulator.of(raw.changed(step=step)), theta, effort=effort)
        if raw.late and typical(r for _, r in first.residuals) > OFF:
            raw = self.count_in_full()
        self.evaluations += first.evaluations
        if self.known:
            changes = _changes(self.known, self.declared)
            shafts, turns = followed_shafts(first.simulator, first.theta, changes)
            raw = self.taken(raw.changed(shafts=shafts, turns=turns))
            whole = first.problem.changed(shafts=shafts, turns=turns)
            first = replace(first, simulator=self.simulator.of(whole))
        left = 2.0 * first.cost / first.count
        self.say(f"declared parameters fitted, steps of {step:g} s: {left:.3f} per residual left")
        if exact:
            return self.judged(first)
        if raw.far:  # errors at such parameters are not those at the right ones, and small beside
            self.declared = raw.changed(step=step)
            simulator = self.simulator.of(self.declared)
            return self.judged(fit(simulator, first.theta, effort=DRAFT))
        near = corrected(self.simulator.of(raw), first.theta, raw)
        second = fit(near, first.theta, known=first.known)
        self.evaluations += second.evaluations
        self.say("errors of the exchange removed")
        simulator = corrected(self.simulator.of(raw), second.theta, raw)
        self.declared = simulator.problem
        # far off, its parameters' intervals mean nothing
        return self.judged(
            fit(simulator, second.theta, effort=DRAFT if is_open(second) else POLISH)
        )

    def bench(self, base: Fitted, stack: SampleStack) -> Bench:
        """A bench for candidates around a fitted model."""
        simulator = base.simulator
        model = model_values(simulator, base.estimate.theta, stack)
        rows = zip(
            self.fitting.names, self.fitting.by_run(self.fit_data - base.fit), strict=True
        )  # fmt: skip
        rest = dict(rows)
        residual = stack.vector([rest[n] for n in stack.names])
        root = stack.root(residual)
        absorber = self.absorber(base, stack, root)
        seen = self.fitting, self.fit_data - base.fit
        return Bench(simulator, base.estimate.theta, stack, model, residual, absorber, root, seen)

    def telling(self, base: Fitted) -> SampleStack:
        """The fewest runs with `TELLING` of what the model lacks; all, if no channel exceeds noise.

        Where runs may turn unstable, those much farther off than others do not count: first orders
        say little there.
        """
        if not self.lacking(base):
            return self.fitting
        residual = self.fit_data - base.fit
        rows = zip(self.fitting.runs, self.fitting.by_run(residual), strict=True)
        found = []
        for run, values in rows:
            stack = SampleStack(self.raw, [run])
            vector = stack.vector([values])
            if any(s.structured for s in whiteness_tests(vector, stack)):
                found.append((float(np.mean(vector**2)), vector.size, run))
        least = min((size for size, _, _ in found), default=0.0)
        most = UNEVEN * least if self.raw.unstable else np.inf
        near = [(n * (size - 1.0), run) for size, n, run in found if size < most]
        near.sort(key=lambda item: -item[0])
        shares = np.cumsum([lack for lack, _ in near]) / max(sum(lack for lack, _ in near), 1e-300)
        few = int(np.searchsorted(shares, TELLING)) + 1
        return SampleStack(self.raw, [run for _, run in near[:few]]) if near else self.fitting

    def scored(self, base: Fitted, among: Collection[str] | None = None) -> Round:
        """Score candidates against a model's residual.

        Where the model evidently lacks something, few runs tell which candidates are worth the
        simulation of all (`telling`).

        Args:
            base: the model.
            among: their labels, all if not given.
        """
        if self.whole:  # what was added may have balances of its own
            self.known = self.offered(candidates(base.problem))
        present = {item.label for item in base.effects}
        chosen = [
            c for c in self.known if c.label not in present and (among is None or c.label in among)
        ]
        stack = self.telling(base)
        bench = self.bench(base, stack)
        signatures = bench.followed(bench.begun(chosen, thorough=self.lacking(base)))
        failed = dict(bench.failed)
        self.evaluations += bench.evaluations
        probes = {s.candidate: s.probe for s in signatures}
        aside: tuple[str, ...] = ()
        if stack is not self.fitting:
            stated = {n.rpartition(".")[0] + "." for r in self.raw.runs for n in r.starts}
            kept = worthy(signatures, stated)
            labels = {s.candidate.label for s in kept}
            aside = tuple(s.candidate.label for s in signatures if s.candidate.label not in labels)
            self.say(
                f"{named_few(stack.names)}: {len(kept)} of {len(signatures)} candidates are left"
            )
            bench = self.bench(base, self.fitting)
            signatures = bench.continued(kept)
            failed |= bench.failed
            self.evaluations += bench.evaluations
        # of laws that are one to first order the one with fewer parameters of its own stands first
        signatures = merge(sorted(signatures, key=lambda s: (s.tuned, len(s.probe.others))))
        corrected = holm([s.score.p_value for s in signatures], len(signatures) + len(aside))
        named = {s.candidate.label: float(p) for s, p in zip(signatures, corrected, strict=True)}
        named |= {label: named[s.candidate.label] for s in signatures for label in s.same}
        signatures.sort(key=lambda s: -s.score.gain)
        current = Round(base, signatures, named, aside, probes=probes, failed=failed)
        if failed:
            self.say(current.unasked)
        return current

    def round(self, base: Fitted) -> Round:
        """Score, refit the best, choose.

        Where that finds nothing for a model whose parameters were driven to their bounds, once more
        around their nominal values: what was calibrated then hides what is missing.

        Args:
            base: the model.
        """
        current = self._round(base, base)
        if current.winner is None and self.far(base):
            self.say("parameters stand at their bounds: once more around their nominal values")
            nominal = self.unfitted(base)
            if nominal is not None:
                current = self._round(base, nominal)
        self.rounds.append(current)
        if self.whole and current.winner is not None:
            self.prepare(current.winner.problem)
        return current

    def _round(self, base: Fitted, start: Fitted) -> Round:
        """A round whose candidates are scored, and fits begun, around another model's parameters.

        Args:
            base: from which gains count.
            start: the same model with parameters to begin with.
        """
        return self._decided(base, start, self.scored(start))

    def around_nominal(self, fitted: Fitted) -> Round | None:
        """A round of the declared model around its nominal values.

        Calibration may have gone so far to make up for a law that to first order around its values
        that law does nothing.

        Args:
            fitted: the best model so far.

        Returns:
            None if a law that explains as much as any there is in that model, none is better, or
            nothing can be simulated there.
        """
        declared = self.memo.declared
        start = self.unfitted(declared)
        if start is None:
            return None
        current = self.scored(start)
        least = CLOSE * max((item.score.gain for item in current.signatures), default=0.0)
        close = [item for item in current.signatures if item.score.gain >= least]
        if any(fitted.labels & {item.candidate.label, *item.same} for item in close):
            return None
        current = self._decided(declared, start, current)
        winner = current.winner
        if winner is None or self.total(fitted, winner) <= GATE:
            return None
        return current

    def _decided(self, base: Fitted, start: Fitted, current: Round) -> Round:
        """Refit the best of a round's candidates, and choose."""
        current.base, current.scored_elsewhere = base, start is not base
        first = promising(self, current)
        base = self.attempted(start, current, first)
        if current.winner is None and self.lacking(base):
            others = remaining(self, current, first)
            if others:
                runs = "unused" if self.unused else "fitted"
                self.say(f"{runs} runs want none of them; the next {len(others)}:")
                base = self.attempted(start, current, others)
        if current.winner is None:
            return current
        if not current.open:
            if self.lacking(current.winner):
                completed(self, base, current)
            challenged(self, base, current)
            current.follow(self.released(current.winner, base))
            needed(self, base, current)
            if current.winner is None:
                return current
            current.follow(self.sharpened(current.winner, base))
            current.follow(grounded(self, current.winner, base))
            settle(self, base, current)
        return current

    def attempted(self, start: Fitted, current: Round, items: list[Signature]) -> Fitted:
        """Refit candidates and choose among all that a round has fitted.

        Args:
            start: model whose parameters fits begin with.
            current: the round; gets the fits and the winner, if unused runs want one.
            items: candidates, the best gains first.

        Returns:
            The base of the round, which counts residuals in another way if the winner is near.
        """
        base = current.base
        self._build(start.problem, (item.candidate.change for item in items))
        most = max((s.score.gain for s in items), default=0.0)
        early = not self.raw.unstable  # `opened` fits the best from nominal values
        for item in items:
            explained = self.explained(base, current.fitted)
            if not explained or item.score.gain >= RIVAL * most:
                goal = 0.0
                if explained:
                    goal = LOOSE * max(self.gain(base, f) for f in current.fitted)
                self.tried(start, current, item, again=early and not explained, goal=goal)
        current.fitted.sort(key=lambda f: -self.total(base, f))
        current.quick = max((self.total(base, f) for f in current.fitted), default=0.0)
        current.near = nearly(self, base, current)
        first = self.chosen(base, current.fitted)
        current.winner, uncorrected = first, self.raw.far
        if first is not None and is_open(first.estimate):
            self.opened(base, current)
            base = current.base
        else:
            base = self.recount(current)
            # quick fits are too far from their minima to be told apart
            self.finish(base, current, LOOSE if self.far(base) else CLOSE, uncorrected=uncorrected)
            current.winner = self.chosen(base, current.fitted)
            if current.winner is not None:
                current.follow(self.snapped(self.released(current.winner, base), base))
        return base

    def opened(self, base: Fitted, current: Round) -> None:
        """Fit a model that evidently lacks more; if it still does, others are compared later."""
        winner = current.winner
        assert winner is not None
        models = [winner]
        if self.raw.unstable:  # quick fits end anywhere, so the better law is not known yet
            models += [
                f for f in current.fitted
                if f.effects[-1] in current.near and f.effects[-1].place == winner.effects[-1].place
                and f.quantity == winner.quantity and f.complexity < winner.complexity
            ][:SIMPLER]  # fmt: skip
        begun: dict[int, Fitted] = {}
        for f in reversed(models):
            begun[id(f)] = restarted(self, f, base, list(begun.values()))
        if self.raw.far:  # near now, and fitted without regard to errors of the exchange
            begun = {key: self.sharpened(f, base, DRAFT) for key, f in begun.items()}
        current.fitted = [begun.get(id(f), f) for f in current.fitted]
        current.winner = min(begun.values(), key=lambda f: f.estimate.robust)
        base = self.recount(current)
        found = self.refined(base, current.winner, quick=True)
        better = self.released(found, base)
        if better is found:
            better = self.sharpened(found, base, DRAFT)
        current.follow(self.snapped(better, base))
        current.open = is_open(current.winner.estimate)
        if not current.open:
            return
        completed(self, base, current)
        # quick fits are rough, so what is left may be that of the wrong law
        kept = current.winner
        swapped = reconsidered(self, kept, [current])
        if swapped is not kept:
            current.follow(self.snapped(self.released(swapped, base), base))
            current.open = is_open(current.winner.estimate)

    def recount(self, current: Round) -> Fitted:
        """The base of a round; with a winner that is near, residuals count by logarithm again.

        See `OFF`: what is far off is then a moment that comes too early, not the model.
        """
        if not self.raw.far or current.winner is None or self.typical(current.winner) > OFF:
            return current.base
        self.count_in_full(False)
        current.base = base = self.recounted(current.base)
        again = {id(f): self.recounted(f, base) for f in current.fitted}
        current.winner = again[id(current.winner)]
        current.fitted = sorted(again.values(), key=lambda f: -self.total(base, f))
        current.quick = max(self.total(base, f) for f in current.fitted)
        return base

    def tried(
        self, start: Fitted, current: Round, item: Signature, *, again: bool, goal: float = 0.0
    ) -> None:
        """Refit a candidate from a model's parameters and note what that gains (see `refit`)."""
        base, fitted = current.base, self.refit(start, item, again=again, goal=goal)
        if fitted is None:
            return
        fitted = freed(self, current, fitted)
        fitted.gate = compare(self.check_data, base.check, fitted.check, self.checking)
        current.fitted.append(fitted)
        self.note(fitted)
        text = f"{item.candidate.label}: {self.gain(base, fitted):.0f} nats on identification"
        unused = f", {fitted.gate.gain:.0f} on validation (z {fitted.gate.z:.1f})"
        self.say(text + unused * self.unused)

    def finish(
        self, base: Fitted, current: Round, share: float, *, uncorrected: bool = False
    ) -> None:
        """Replace the first few quick fits by thorough ones.

        Where unused runs want none of them, those that gain most on the others: a quick fit may
        still be too far from its minimum to be of use elsewhere; and the best of those that change
        too little to be named, whose strength along a valley may be far from its own, too.

        Args:
            base, current: model without the effects, and the round whose fits are replaced.
            share: of the best gain, below which a quick fit stays one.
            uncorrected: whether quick fits have errors of the exchange in them.
        """
        least = share * max((self.total(base, f) for f in current.fitted), default=0.0)
        good = [f for f in current.fitted if self.accepted(base, f)]
        near = [f for f in good if self.total(base, f) > least][:REFINED]
        if near:  # simpler laws at its place are fitted from its parameters anyway: `challenged`
            near = [f for f in near if f is near[0] or not more_general(near[0], f)]
        alone = bool(good) and not near[1:] and not uncorrected
        if not good and self.lacking(base):
            gains = sorted(current.fitted, key=lambda f: -self.gain(base, f))
            least = max(SLIGHT * max((self.gain(base, f) for f in gains), default=0.0), GATE)
            near = [f for f in gains if self.gain(base, f) > least][:UNWANTED]
        elif not good:  # too small for a name, as far as a quick fit tells
            near = [f for f in current.fitted if f.gate is not None and f.gate.passed][:1]
        better: dict[int, Fitted] = {}
        for f in near:  # the best first; others as far as their derivatives lead to it
            goal = self.enough(better[id(near[0])], f) if good and better else np.inf
            sharp = f if alone else self.sharpened(f, base, DRAFT, goal)
            better[id(f)] = self.refined(base, sharp)
        if near and not good:
            best = max(better, key=lambda k: self.gain(base, better[k]))
            if not self.accepted(base, better[best]):  # but at its minimum
                better[best] = self.sharpened(better[best], base, MINIMUM)
        current.fitted = [better.get(id(f), f) for f in current.fitted]
        current.fitted.sort(key=lambda f: -self.total(base, f))


def _changes(known: Sequence[Candidate], problem: Problem) -> Iterator[Mapping[str, str]]:
    """What FMUs the candidates are simulated in, as of `cosim run --set`."""
    for batch in batches(known, problem):
        yield batch.change or batch.members[0][0].change
