"""Rounds of attribution: score all candidates, refit the best, judge them on unused runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..calibrate.fit import Known, fit
from ..calibrate.loss import typical
from ..calibrate.problem import Problem
from ..system.provider import locate
from ..system.variants import apply
from .candidates import Candidate, balances, candidates
from .deferred import corrected
from .established import needed, settle
from .exchange import challenged, is_open, nearly, reconsidered, restarted
from .fitter import Say
from .judge import ALIKE
from .late import LateFitter
from .linear import MATERIAL, Layout, holm
from .models import GATE, GATE_Z, LEVEL, Fitted, compare, more_general
from .probes import Probe, batches
from .secant import Bench, model_values
from .signature import WHOLES, Signature, groups_of, kind, merge, unscored, worthy
from .structure import structures

Vector = NDArray[np.float64]
NEARLY = 0.7
"""Share of `MATERIAL` from which a candidate is refitted: its linear size is an estimate."""
REFITS = 6
PART = 0.2
"""A candidate that gains less than this share of what the best one gains, to first order, is not
refitted: it is no rival, and another round will ask again."""
MEMBERS = 2
"""Members of a group (swivels of casters) that are refitted with one effect at most, the best."""
SHARED = 0.5
"""What acts alike on all of a group (the swivels of all casters) is refitted as well if it gains
this share of what the best one gains, and at most `WHOLES`: members must not crowd it out."""
EXTRA = 2
"""Where something is evidently missing, so many that gain more than the best one are refitted
though not significant: the blocks' variance is then that of what is missing. Half as much will do
where the model is far off."""
REFINED, CLOSE, LOOSE = 3, 0.95, 0.8
"""So many quick fits are made thorough, if they gain this share of what the best one gains; the
second share counts where the model before was far off."""
OFF = 400.0
"""Mean square over the noise's of a channel's typical windows beyond which all residuals count in
full: by their logarithm, fits end far from their minima, and beside that much, moments at which
casters turn over are small."""
SIMPLER = 1
"""Simpler laws at the best one's place that are fitted as far where much more is missing."""
UNWANTED, SLIGHT = 2, 0.1
"""So many where unused runs want none, if they gain this share of what the best one gains."""
RIVAL = 0.5
"""Where a candidate explains nearly all, those that gain less than this share of what the best one
gains to first order are no rivals."""
UNEVEN = 10.0
"""Runs that are farther off than this many times the mean square of the one that is least off do
not choose candidates: linear signatures are wrong there, or an unstable moment decides."""
ROUNDS = 4
CHECK = "validation"


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
        scores: of these, their log likelihoods over that of the winner [nats].
        open: whether more was so evidently missing that the choice waits for it.
        probes: all candidates that were simulated, with the systems they were simulated in.
        quick: what the best quick fit gained on all runs [nats].
        near: candidates whose quick fits gained nearly as much.
        compared: effects of the model in which its winner was last compared with others; empty if
            that was the round's own.
    """

    base: Fitted
    signatures: list[Signature]
    corrected: dict[str, float]
    aside: tuple[str, ...] = ()
    fitted: list[Fitted] = field(default_factory=list)
    winner: Fitted | None = None
    rivals: list[Fitted] = field(default_factory=list)
    scores: list[float] = field(default_factory=list)
    open: bool = False
    probes: dict[Candidate, Probe] = field(default_factory=dict)
    quick: float = 0.0
    near: frozenset[Candidate] = frozenset()
    compared: frozenset[Candidate] = frozenset()


class Search(LateFitter):
    """Attribution on one problem.

    Args:
        problem: declared system.
        say: told what is done.
        only: candidates to consider, all of the catalogue if not given.
    """

    def __init__(
        self, problem: Problem, say: Say = lambda text: None, only: list[Candidate] | None = None
    ) -> None:
        super().__init__(problem, CHECK, say)
        self.declared = problem
        self.whole = only is None
        self.known = candidates(problem) if only is None else only
        self.rounds: list[Round] = []
        self._builder = ThreadPoolExecutor(1)

    def prepare(self, problem: Problem | None = None) -> None:
        """Have the candidates' FMUs built in the background, while something else is computed.

        Args:
            problem: to which they will be added, the declared one if not given.
        """
        known = self.known if problem is None else candidates(problem)
        problem = problem or self.declared
        self._build(problem, (b.change or b.members[0][0].change for b in batches(known, problem)))

    def _build(self, problem: Problem, changes: Iterable[Mapping[str, str]]) -> None:
        """Have changed FMUs of a problem built in the background."""
        for instance, change in dict.fromkeys(pair for c in changes for pair in c.items()):
            variant = apply(problem.instances, {instance: change}, problem.provider)
            self._builder.submit(locate, variant[instance], problem.provider)

    def close(self) -> None:
        """Stop building."""
        self._builder.shutdown(wait=True, cancel_futures=True)

    def calibrated(self) -> Fitted:
        """Fit the declared system, errors of the communication step removed from then on."""
        raw = self.raw
        coarse = raw._with(step=raw.search_step)
        exact = raw.ticks and raw.search_step == raw.step
        first = fit(coarse, None, limit=6, robust=True, polish=exact, rough=not exact)
        if raw.late and typical(r for _, r in first.residuals) > OFF:
            raw = self.count_in_full()
        self.evaluations += first.evaluations
        self.say(
            f"declared parameters fitted: cost per residual {2 * first.cost / first.count:.3f}"
        )
        if exact:
            return self.judged(first)
        if raw.far:  # errors at such parameters are not those at the right ones, and small beside
            self.declared = raw._with(step=raw.search_step)
            return self.judged(fit(self.declared, first.theta, near=True, draft=True))
        near = corrected(raw, first.theta, raw)
        second = fit(near, first.theta, known=Known.of(first))
        self.evaluations += second.evaluations
        self.say("errors of the exchange removed")
        self.declared = corrected(raw, second.theta, raw)
        if is_open(second):  # far off, its parameters' intervals mean nothing
            return self.judged(fit(self.declared, second.theta, near=True, draft=True))
        return self.judged(fit(self.declared, second.theta, limit=0, robust=False))

    def bench(self, base: Fitted, layout: Layout) -> Bench:
        """A bench for candidates around a fitted model."""
        problem = base.problem
        model = model_values(problem, base.estimate.theta, layout)
        rows = zip(
            self.fitting.names, self.fitting.by_run(self.fit_data - base.fit), strict=True
        )  # fmt: skip
        rest = dict(rows)
        residual = layout.vector([rest[n] for n in layout.names])
        root = layout.root(residual)
        absorber = self.absorber(base, layout, root)
        return Bench(problem, base.estimate.theta, layout, model, residual, absorber, root)

    def telling(self, base: Fitted) -> Layout:
        """The run with most of what the model lacks; all, if no channel exceeds its noise.

        Where runs may turn unstable, those much farther off than others do not count: first orders
        say little there.
        """
        if not self.lacking(base):
            return self.fitting
        residual = self.fit_data - base.fit
        rows = zip(self.fitting.runs, self.fitting.by_run(residual), strict=True)
        found = []
        for run, values in rows:
            layout = Layout(self.raw, [run])
            vector = layout.vector([values])
            if any(s.structured for s in structures(vector, layout)):
                found.append((float(np.mean(vector**2)), vector.size, layout))
        least = min((size for size, _, _ in found), default=0.0)
        most = UNEVEN * least if self.raw.unstable else np.inf
        near = [(n * (size - 1.0), layout) for size, n, layout in found if size < most]
        return max(near, key=lambda item: item[0])[1] if near else self.fitting

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
        probes = {s.candidate: s.probe for s in signatures}
        aside: tuple[str, ...] = ()
        if layout is not self.fitting:
            stated = {n.rpartition(".")[0] + "." for r in self.raw.runs for n in r.starts}
            kept = worthy(signatures, stated)
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
        return Round(base, signatures, named, aside, probes=probes)

    def able(self, current: Round) -> list[Signature]:
        """Candidates that show in the fitted runs and ask for enough to matter, by gain."""
        return [
            s
            for s in current.signatures
            if not s.unseen
            and s.score.gain > GATE
            and self.fitting.largest(s.asked) > NEARLY * MATERIAL
        ]

    def promising(self, current: Round) -> list[Signature]:
        """Candidates worth a refit: significant, not too small to matter, the best gains first.

        Where something is evidently missing and none is significant (an effect that shows in few
        moments has few blocks to prove itself), unused runs decide alone. So they do on a few that
        gain more than any significant one, or half as much where the model is far off.
        """
        able = self.able(current)
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
                alike[kind(s.candidate)] += 1
                if alike[kind(s.candidate)] > MEMBERS:
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
        if chosen and self.lacking(current.base):
            known = {s.candidate.label for s in (*good, *chosen)}
            least = best * (SHARED if is_open(current.base.estimate) else 1.0)
            chosen += [
                s for s in able
                if s.candidate.label not in known and s.score.z > GATE_Z and s.score.gain > least
            ][:EXTRA]  # fmt: skip
            chosen += groups_of(chosen, able, single, PART * best)
        return sorted(chosen, key=lambda s: -s.score.gain)

    def remaining(self, current: Round, tried: list[Signature]) -> list[Signature]:
        """The next candidates of a round, where unused runs want none of the first.

        What a far-off model lacks is in the variance of its blocks, so a law far down the list by
        significance may be the right one.
        """
        known = {s.candidate.label for s in tried}
        able = [s for s in self.able(current) if s.score.z > GATE_Z]
        best = max((s.score.gain for s in able), default=0.0)
        few = [s for s in able if s.score.gain > PART * best]
        return [s for s in few if s.candidate.label not in known][:REFITS]

    def round(self, base: Fitted) -> Round:
        """Score, refit the best, choose.

        Where that finds nothing for a model whose parameters were driven to their bounds, once more
        around their nominal values: what was calibrated then hides what is missing.
        """
        current = self._round(base, base)
        if current.winner is None and self.far(base):
            self.say("parameters stand at their bounds: once more around their nominal values")
            current = self._round(base, self.unfitted(base))
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
        current = self.scored(start)
        current.base = base
        promising = self.promising(current)
        base = self.attempted(start, current, promising)
        if current.winner is None and is_open(base.estimate):
            remaining = self.remaining(current, promising)
            if remaining:
                self.say(f"unused runs want none of them; the next {len(remaining)}:")
                base = self.attempted(start, current, remaining)
        if current.winner is None:
            return current
        if not current.open:
            challenged(self, base, current)
            self.follow(current, self.released(current.winner, base))
            needed(self, base, current)
            if current.winner is None:
                return current
            self.follow(current, self.sharpened(current.winner, base))
            settle(self, base, current)
            wanted = [f for f in current.fitted if f.gate is not None and f.gate.passed]
            current.rivals = self.rivals(base, current.winner, wanted)
            mine = self.total(base, current.winner)
            current.scores = [self.total(base, f) - mine for f in current.rivals]
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
                self.tried(start, current, item, again=early and not explained)
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
                self.follow(current, self.snapped(self.released(current.winner, base), base))
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
            begun = {key: self.sharpened(f, base, draft=True) for key, f in begun.items()}
        current.fitted = [begun.get(id(f), f) for f in current.fitted]
        current.winner = min(begun.values(), key=lambda f: f.estimate.robust)
        base = self.recount(current)
        found = self.refined(base, current.winner, quick=True)
        better = self.released(found, base)
        if better is found:
            better = self.sharpened(found, base, draft=True)
        self.follow(current, self.snapped(better, base))
        current.open = is_open(current.winner.estimate)
        if not current.open:
            return
        # quick fits are rough, so what is left may be that of the wrong law
        kept = current.winner
        swapped = reconsidered(self, kept, [current])
        if swapped is not kept:
            self.follow(current, self.snapped(self.released(swapped, base), base))
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

    @staticmethod
    def follow(current: Round, better: Fitted) -> None:
        """Let another fit of a round's winner take its place."""
        current.fitted = [better if f is current.winner else f for f in current.fitted]
        current.winner = better

    def tried(self, start: Fitted, current: Round, item: Signature, *, again: bool) -> None:
        """Refit a candidate from a model's parameters and note what that gains."""
        base, fitted = current.base, self.refit(start, item, again=again)
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

    def simpler(self, current: Round) -> list[Signature]:
        """Laws at the winner's place whose strength is the same quantity, with fewer parameters.

        A bristle gives way before it slips, so to first order it explains dry friction where a law
        that sticks at once does not; only fits show whether the simpler one does as well.
        """
        winner = current.winner
        assert winner is not None and winner.signature is not None
        last = winner.effects[-1]
        scored = {s.candidate: s for s in current.signatures}
        return [
            scored.get(candidate) or unscored(probe)
            for candidate, probe in current.probes.items()
            if candidate.place == last.place and candidate not in winner.effects
            and probe.strength.name.removeprefix(candidate.prefix) == winner.quantity
            and probe.own < winner.signature.probe.own
        ]  # fmt: skip

    def finish(
        self, base: Fitted, current: Round, share: float, *, uncorrected: bool = False
    ) -> None:
        """Replace the first few quick fits by thorough ones.

        Where unused runs want none of them, those that gain most on the others: a quick fit may
        still be too far from its minimum to be of use elsewhere.

        Args:
            base: model without the effects.
            current: round whose fits are replaced.
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
            sizes = [self.gain(base, f) for f in gains]
            least = max(SLIGHT * max(sizes, default=0.0), GATE)
            near = [f for f, gain in zip(gains, sizes, strict=True) if gain > least][:UNWANTED]
        better = {
            id(f): self.refined(base, f if alone else self.sharpened(f, base, draft=True))
            for f in near
        }
        current.fitted = [better.get(id(f), f) for f in current.fitted]
        current.fitted.sort(key=lambda f: -self.total(base, f))
