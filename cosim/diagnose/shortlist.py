"""Which of the scored candidates of a round are refitted, and which compared with its winner."""

from __future__ import annotations

from collections import Counter

from .candidates import balances
from .judge import ALIKE, Judge
from .linear import MATERIAL
from .models import GATE, GATE_Z, LEVEL, Fitted, is_open
from .rounds import Round
from .signature import WHOLES, Signature, groups_of, kind

NEARLY = 0.7
"""Share of `MATERIAL` from which a candidate is refitted: its linear size is an estimate."""
REFITS = 6
"""Candidates that are refitted at most, a limit on work: of the others only the first order speaks,
unless they are rivals of the winner (`rivals.challenged`)."""
PART = 0.2
"""A candidate that gains less than this share of what the best one gains, to first order, is not
refitted: it is no rival, and another round asks again."""
MEMBERS = 2
"""Members of a group (swivels of casters) that are refitted with one effect at most, the best."""
IMITATED = 2
"""Candidates of which calibration absorbs so much that the rest may be an error of its derivatives,
which are refitted last, where no other explains nearly all, if they promise enough: few, since what
they promise may be that error, and a fit is spent on it."""
SHARED = 0.5
"""What acts alike on all of a group (the swivels of all casters) is refitted as well if it gains
this share of what the best one gains, and at most `WHOLES`: members must not crowd it out."""
EXTRA = 2
"""Where something is evidently missing, so many that gain more than the best one are refitted
though not significant: the blocks' variance is then that of what is missing. A gain of `SHARED`
times the best one's will do where the model is far off, beyond `GATE_Z`."""


def able(judge: Judge, current: Round) -> list[Signature]:
    """Candidates that show in the fitted runs and ask for enough to matter, by gain."""
    return [
        s for s in current.signatures if not s.unseen and s.score.gain > GATE and asks(judge, s)
    ]


def promising(judge: Judge, current: Round) -> list[Signature]:
    """Candidates worth a refit: significant, not too small to matter, the best gains first.

    Where something is evidently missing and none is significant (an effect that shows in few
    moments has few blocks to prove itself), unused runs decide alone. So they do on a few that
    gain more than any significant one, or half as much where the model is far off.
    """
    seen = able(judge, current)
    good = [s for s in seen if current.corrected[s.candidate.label] < LEVEL]
    if not good and judge.lacking(current.base):
        # far off, deviations are those of what is missing: only fits tell the next ones apart
        far = is_open(current.base.estimate)
        good = [s for s in seen if far or abs(s.score.z) > GATE_Z]
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
    if chosen and judge.lacking(current.base):
        known = {s.candidate.label for s in (*good, *chosen)}
        least = best * (SHARED if is_open(current.base.estimate) else 1.0)
        chosen += [
            s for s in seen
            if s.candidate.label not in known and s.score.gain > least
            and (abs(s.score.z) > GATE_Z or s.score.gain > best)
        ][:EXTRA]  # fmt: skip
        # where casters turn over, first orders of a group say nothing
        chosen += groups_of(chosen, seen, single, 0.0 if judge.raw.unstable else PART * best)
    chosen.sort(key=lambda s: -s.score.gain)
    least = max(PART * best, GATE)
    imitated = [
        s for s in current.signatures
        if s.unseen and s.score.gain > least and abs(s.score.z) > GATE_Z and asks(judge, s)
    ]  # fmt: skip
    return chosen + imitated[:IMITATED]


def asks(judge: Judge, item: Signature) -> bool:
    """Whether the residual asks for enough of a candidate to matter."""
    return judge.fitting.largest(item.asked) > NEARLY * MATERIAL


def remaining(judge: Judge, current: Round, tried: list[Signature]) -> list[Signature]:
    """The next candidates of a round, where unused runs want none of the first.

    What a model lacks is in the variance of its blocks, so a law far down the list by significance
    may be the right one.
    """
    known = {s.candidate.label for s in tried}
    seen = [s for s in able(judge, current) if abs(s.score.z) > GATE_Z]
    best = max((s.score.gain for s in seen), default=0.0)
    few = [s for s in seen if s.score.gain > PART * best]
    return [s for s in few if s.candidate.label not in known][:REFITS]


def kin(judge: Judge, base: Fitted, stage: Round) -> list[Signature]:
    """Twins of what was fitted that the winner must be compared with: they have not been.

    To first order they are one, but where an effect explains millions of nats, what differs in
    the sixth digit tells its place, and a simpler law there from the winner. Another law is another
    answer: where a current never turns round, a dead zone is an offset.
    """
    winner = stage.winner
    if winner is None or winner.signature is None:
        return []
    told = ALIKE * judge.total(base, winner) >= GATE
    last, tuned = winner.effects[-1], winner.signature.tuned
    twins = [t for f in stage.fitted if f.signature is not None for t in f.signature.twins]
    found = [
        t for t in (twins if told else ())
        if t.candidate.effect == last.effect
        or (t.candidate.place == last.place and t.tuned < tuned)
    ]  # fmt: skip
    laws = (t for t in winner.signature.twins if t.candidate.effect != last.effect)
    return found + [t for t in laws if t.tuned == tuned]
