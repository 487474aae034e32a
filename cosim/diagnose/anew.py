"""The laws of a set that leaves more than noise, asked for anew beside one another.

Rounds choose a law beside those before it. If one of these is exchanged later, the rest was chosen
beside a law that is not in the set: a payload beside friction that was towed, where beside friction
that turns a marker does better. So a set that would be named and leaves more than noise is asked
beside each of its laws, and beside all of them, where no round has been.
"""

from __future__ import annotations

from .models import GATE, Fitted
from .search import Search


def asked_anew(search: Search, proposed: Fitted) -> Fitted | None:
    """A better set that a round finds beside laws of the proposed one; None if there is none.

    The law that is missed least has its turn first: it may only take up what another one leaves.

    Args:
        search: its memo has the set without each of its laws, unless it cannot be simulated.
        proposed: the set, thoroughly fitted.
    """
    declared = search.memo.declared
    begun = {stage.base.labels for stage in search.rounds if not stage.scored_elsewhere}
    gains = [(law.label, search.law(proposed, law).missed) for law in proposed.effects]
    order = sorted((g.fitted + g.unused, label) for label, g in gains if g is not None)
    sets = [*(proposed.labels - {label} for _, label in order), proposed.labels]
    for labels in sets:
        known = search.memo.get(labels)
        if known is None or labels in begun:
            continue
        beside = ", ".join(sorted(labels))
        search.say(f"more than noise is left: is there another law beside {beside}?")
        base = proposed if labels == proposed.labels else search.recalled(known, declared)
        winner = search.round(base).winner
        if winner is not None and search.total(proposed, winner) > GATE:
            return winner
    return None
