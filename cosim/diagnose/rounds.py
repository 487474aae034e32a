"""One round of attribution: what was scored and fitted in it, and what won."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from .candidates import Candidate
from .models import Fitted
from .probes import Probe
from .signature import Signature, unscored

SHOWN = 3
"""Candidates, or runs, that a message names."""


def named_few(names: Sequence[str]) -> str:
    """The first `SHOWN` names, and how many more there are."""
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more


@dataclass
class Round:
    """One round.

    Attributes:
        base: model that the round began with.
        signatures: candidates scored on all identification runs, best first; neither twins nor
            those put aside are among them.
        corrected: p value by label, corrected for their number.
        aside: labels of those that few runs ruled out (`Search.telling`).
        fitted: refitted candidates, best first.
        winner: fit that unused runs want, None if there is none.
        open: whether more was so evidently missing that the choice waits for it.
        probes: all candidates that were simulated, also those put aside, with the systems they
            were simulated in.
        quick: what the best quick fit gained on all runs [nats].
        near: candidates whose quick fits gained nearly as much.
        cut: whether runs were ended after it, so its fits are of others: its rivals have had their
            turn.
        scored_elsewhere: whether candidates were scored around other parameters than those of the
            base.
        failed: candidates that could not be simulated at any strength, and why.
        compared: effects of the model in which its winner was last compared with others; empty if
            that was the round's own.
    """

    base: Fitted
    signatures: list[Signature]
    corrected: dict[str, float]
    aside: tuple[str, ...] = ()
    fitted: list[Fitted] = field(default_factory=list)
    winner: Fitted | None = None
    open: bool = False
    probes: dict[Candidate, Probe] = field(default_factory=dict)
    quick: float = 0.0
    near: frozenset[Candidate] = frozenset()
    compared: frozenset[Candidate] = frozenset()
    cut: bool = False
    scored_elsewhere: bool = False
    failed: dict[str, str] = field(default_factory=dict)

    @property
    def unasked(self) -> str:
        """Which candidates could not be asked, and why the first of them could not."""
        why = next(iter(self.failed.values()), "").partition("\n")[0]
        return (
            f"not asked, since they cannot be simulated: {named_few(list(self.failed))}; "
            f"the first: {why}"
        )

    def follow(self, better: Fitted) -> None:
        """Let another fit of the winner take its place."""
        self.fitted = [better if f is self.winner else f for f in self.fitted]
        self.winner = better

    def simpler(self) -> list[Signature]:
        """Laws at the winner's place whose strength is the same quantity, with fewer parameters.

        A bristle gives way before it slips, so to first order it explains dry friction where a law
        that sticks at once does not; only fits show whether the simpler one does as well.
        """
        winner = self.winner
        assert winner is not None and winner.signature is not None
        last = winner.effects[-1]
        scored = {s.candidate: s for s in self.signatures}
        return [
            scored.get(candidate) or unscored(probe)
            for candidate, probe in self.probes.items()
            if candidate.place == last.place and candidate not in winner.effects
            and probe.strength.name.removeprefix(candidate.prefix) == winner.quantity
            and probe.own < winner.signature.probe.own
        ]  # fmt: skip
