"""Why a set of laws cannot be named, whatever it leaves.

unused runs do not want it      they gain less than `threshold` over the declared model
a law is not there              the interval of its strength holds absence
a law is not missed             unused runs do as well without it
a law does not matter           it changes no channel by `MATERIAL` of its noise
a law is a matter of ticks      it shifts something by less than a tick of the rig
"""

from __future__ import annotations

import math

from .answer import past
from .candidates import DELAY, LOG
from .facts import Gain, Model, Table
from .linear import MATERIAL
from .models import GATE_Z, LEVEL


def threshold(candidates: int) -> float:
    """Log likelihood that unused runs must gain where there were so many candidates [nats].

    The likelihood ratio of two fixed models has mean 1 if the simpler one is true, so for any of
    N candidates it exceeds N / LEVEL with at most the probability LEVEL (Markov).
    """
    return math.log(max(candidates, 1) / LEVEL)


def doubts(table: Table, model: Model, *, ticks: bool = True) -> list[str]:
    """Why a set cannot be named whatever it leaves; nothing for one that can.

    Args:
        table: of all models.
        model: the set.
        ticks: whether its laws must shift something by a tick of the rig.
    """
    if not model.laws:
        return ["it is the declared model"]
    found = []
    if model.rough:
        found.append("it was not worth a fit")
    elif not table.unused_count:
        found.append("no run was kept unused to judge by")
    elif not wanted(model.gain, table.candidates):
        gain, z = (model.gain.unused, model.gain.unused_z) if model.gain else (0.0, 0.0)
        found.append(
            f"unused runs do not want it ({gain:.3g} nats by {z:.2g} standard deviations; "
            f"{threshold(table.candidates):.3g} by {GATE_Z:g} are needed)"
        )
    elif model.beyond is not None and not wanted(model.beyond, table.candidates):
        found.append(f"the declared model does no worse with {past(table.bounds)}")
    late = {law.label for law in model.laws if (law.component, law.effect) == (LOG, DELAY)}
    if 0 < table.columns <= len(late):
        found.append("it delays every column of the log, which is no delay of any")
    for law in model.laws:
        if not law.there:
            edge = max(law.absent, law.size.minimum)
            found.append(f"the interval of {law.label}'s {law.strength} holds {edge:g}: absence")
        if ticks and abs(law.size.value) < law.tick:
            found.append(f"{law.label} shifts nothing by a tick of the rig")
        if model.rough or not table.unused_count:
            continue
        if law.missed is None:
            found.append(f"what it is without {law.label} was not asked")
        elif not wanted(law.missed, table.candidates):
            if len(model.laws) > 1:
                found.append(f"unused runs do not miss {law.label} if it is left out")
        elif law.missed.change <= MATERIAL:
            found.append(f"{law.label} changes no channel by {MATERIAL:g} of its noise")
    return list(dict.fromkeys(found))


def of_ticks(table: Table, model: Model) -> bool:
    """Whether nothing speaks against a set but that its laws shift less than a tick of the rig.

    What it says is true, of the moment within a tick at which something is read, and no law is
    missing for it; one that only imitates it is not there, either.
    """
    return bool(doubts(table, model)) and not doubts(table, model, ticks=False)


def wanted(gain: Gain | None, candidates: int) -> bool:
    """Whether unused runs want the better one of two models, and fitted runs do not speak against.

    Args:
        gain: of one over the other.
        candidates: number of laws that there were to choose from.
    """
    return (
        gain is not None
        and gain.unused > threshold(candidates)
        and gain.unused_z > GATE_Z
        and gain.fitted > 0.0
    )
