"""The verdict: a pure function of the table of models.

    bad_data         the data cannot be used
    effect_found     the best set of laws stands up: unused runs want it, each of its laws is there,
                     is missed if left out and matters, what it leaves is noise, or so little that
                     it asks for no further law (`stands`), and no other set does better (`beaten`)
    confounded       it does, and the data do not tell another set from it that has no more laws,
                     each of them there; the other set is not asked whether it stands up
    nothing_missing  each set has its `doubts`, and the declared model leaves noise
    unexplained      anything else, with the nearest laws as hints; a hint is not a name. A search
                     that was stopped ends so, too: rivals have not been asked

Sentence, tables and JSON are written from the same facts: `answer.Verdict`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations

from .alike import held_by_all
from .answer import Hint, Verdict, over, percent
from .doubts import doubts, of_ticks, threshold, wanted
from .facts import Force, Law, Left, Model, Table, one_law
from .linear import MATERIAL
from .models import GATE_Z
from .whiteness import CALIBRATED, slowly

FITTED = "identification"
TENTH = 0.1
"""An order of magnitude, of RMS: that is what the tables show."""
HALF = 0.5
"""Share of what is left from which a free force at a port explains most of it: then something that
acts there is still missing."""
SAME = 2e-4
"""Share of what a law explains by which the same law elsewhere may do worse: fits end that far from
the minimum that both have in common."""
HAIR = 0.005
"""The same for its special case, where nothing that it has beyond that is determined: fits of laws
that stick end that far from their minima."""
HINTS, LEAST = 3, 0.01
"""Nearest sets that are listed, and the share of the excess that a hint must explain: what does not
show in the percentage that is printed helps nobody."""


def decide(table: Table) -> Verdict:
    """The verdict on a table."""
    if table.errors:
        return Verdict("bad_data", errors=table.errors)
    declared, unused = table.models[0], table.unused_count > 0
    best = None if table.stopped else proposal(table)
    if best is not None and stands(table, best) and beaten(table, best) is None:
        return _named(table, best)
    left = above(declared)
    if best is None and not left and not table.stopped:
        return Verdict("nothing_missing", unused=unused, ended=table.ended)
    force = declared.forces[0] if declared.forces else None
    open_ = table.opened
    told = open_ is not None and wanted(open_.gain, table.candidates)
    return Verdict("unexplained", left=left, hints=_hints(table), force=force, unused=unused,
                   ended=table.ended, stopped=table.stopped, bounds=table.bounds if told else (),
                   opened=_explained(table, open_, declared) if open_ is not None and told else 0.0,
                   beyond=above(open_) if open_ is not None and told else ())  # fmt: skip


def proposal(table: Table) -> int | None:
    """Place in the table of the best set that unused runs want, its laws all there and missed.

    None if there is none. What it leaves is not asked here, see `stands`.

    A law whose other parameters show nothing gives way to its special case, and several laws to
    fewer that the data do not tell from them: two sensors that are late by as much are one late
    command.
    """
    able = [
        i for i, model in enumerate(table.models)
        if not doubts(table, model) and not _of_ticks(table, i)
    ]  # fmt: skip
    if not able:
        return None
    best = max(able, key=lambda i: (table.models[i].score, sorted(table.models[i].labels)))
    while (simple := _special(table, best, able)) is not None:
        best = simple
    alike = [i for i in able if i == best or not _apart(table, best, i)]
    fewest = min(alike, key=lambda i: (len(table.models[i].laws), -table.models[i].score))
    if len(table.models[fewest].laws) < len(table.models[best].laws):
        best = fewest
        alike = [i for i in able if i == best or not _apart(table, best, i)]
    while True:  # the special case of the same law elsewhere, say
        one = [i for i in alike if _one_answer(table.models[best], table.models[i])]
        least = min([best, *one], key=lambda i: (_size_of(table.models[i]), -table.models[i].score))
        if least == best:
            return best
        best = least
        alike = [i for i in able if i == best or not _apart(table, best, i)]


def _of_ticks(table: Table, place: int) -> bool:
    """Whether a set imitates one whose laws shift less than a tick, which does clearly better."""
    model = table.models[place]
    for i, rival in enumerate(table.models):
        mine, other = _differ(model, rival)
        if (
            mine and other and len(rival.laws) <= len(model.laws) and of_ticks(table, rival)
            and not _one_answer(model, rival) and _better(table, place, i)
        ):  # fmt: skip
            return True
    return False


def unasked(table: Table, best: int) -> list[int]:
    """Sets that would be the answer in the place of one if each of their laws is missed.

    Those with fewer laws that the data do not tell from it, and those with as many that do better:
    they have not been asked law by law.
    """
    count, score = len(table.models[best].laws), table.models[best].score
    return [
        i
        for i, model in enumerate(table.models)
        if 1 < len(model.laws) <= count
        and not model.rough
        and (model.score > score if len(model.laws) == count else not _apart(table, best, i))
        and all(law.there for law in model.laws)
        and any(law.missed is None for law in model.laws)
    ]


def above(model: Model) -> tuple[Left, ...]:
    """Channels that a model leaves above their noise, the worst first."""
    return above_noise(model.left, named=bool(model.laws))


def above_noise(left: Sequence[Left], *, named: bool) -> tuple[Left, ...]:
    """Those of some channels that are above their noise, the worst first.

    Args:
        left: what a model leaves.
        named: whether it claims a cause: then also those that are no larger than noise, and slower,
            for wrong causes are.
    """
    tests = len(left)
    found = [x for x in left if x.structured or (named and slowly(x.slow, x.p_value, tests))]
    return tuple(sorted(found, key=lambda x: -x.rms))


def stands(table: Table, place: int) -> bool:
    """Whether what a set leaves is noise, or nothing that another law could explain.

    That is: it is white, if need be with laws that are too small for a name (`_left`); or its RMS
    is a tenth of what was explained, and no more in unused runs than in fitted ones, and no free
    force at a port would have left less of the declared model's rest, nor explains half of its own.

    Args:
        table: of all models.
        place: of the set in it.
    """
    model, declared = table.models[place], table.models[0]
    if all(x.white for x in _left(table, model)):
        return True
    if not model.forces or _most(model.forces).explained >= HALF:
        return False
    if not declared.forces or _by_force(declared, model) > 0.0 or not carries_over(model):
        return False
    left = _excess(table, model)
    # what was explained counts in full, also where runs may turn unstable
    return left <= TENTH**2 * (max(_excess(table, declared), declared.squares) - left)


def with_small(table: Table, model: Model, larger: Model) -> bool:
    """Whether a set is another one with laws that unused runs want, each too small for a name.

    They are there all the same, and what they do is no objection to the set that is named.
    """
    return (
        not larger.rough
        and larger.labels > model.labels
        and wanted(larger.gain, table.candidates)
        and all(
            law.there and law.missed is not None and wanted(law.missed, table.candidates)
            and law.missed.change <= MATERIAL
            for law in larger.laws if law.label not in model.labels
        )
    )  # fmt: skip


def _left(table: Table, model: Model) -> tuple[Left, ...]:
    """What is `above` noise, of a set or of one with small laws besides, whichever leaves less."""
    sets = [model, *(m for m in table.models if with_small(table, model, m))]
    return min(
        (sum(not x.white for x in left), len(m.laws), sorted(m.labels), left)
        for m in sets for left in [above(m)]
    )[-1]  # fmt: skip


def beaten(table: Table, place: int) -> int | None:
    """Place of a set that does clearly better and has no name, for a strength that may be 0.

    Of a law whose parameters only show as a product, no strength is known; that other laws, whose
    strengths are, do worse makes them no better names. Special cases, and sets with more laws or
    all of these, are no objection.

    Args:
        table: of all models.
        place: of the set that would be named.
    """
    model, found = table.models[place], []
    for i, rival in enumerate(table.models):
        mine, other = _differ(model, rival)
        if (
            mine and other and not rival.rough and len(rival.laws) <= len(model.laws)
            and not all(law.there for law in rival.laws) and wanted(rival.gain, table.candidates)
            and not _one_answer(model, rival) and _better(table, place, i)
        ):  # fmt: skip
            found.append(i)
    return max(found, key=lambda i: table.models[i].score, default=None)


def _better(table: Table, first: int, second: int) -> bool:
    """Whether unused runs want the second of two models instead of the first, or would.

    By their likelihoods alone, if they were not compared: they differ too much for that.
    """
    for c in table.comparisons:
        if {c.first, c.second} == {first, second}:
            g, sign = c.gain, 1.0 if c.first == first else -1.0
            gain = replace(g, fitted=sign * g.fitted, unused=sign * g.unused,
                           unused_z=sign * g.unused_z)  # fmt: skip
            return wanted(gain, table.candidates)
    one, two = table.models[first], table.models[second]
    return two.fitted > one.fitted and two.unused - one.unused > threshold(table.candidates)


def carries_over(model: Model) -> bool:
    """Whether no channel is farther above its noise in unused runs than in those that were fitted.

    Nor its slow parts above those of noise.

    Parameters make the best of a wrong law, but in the runs that they are fitted to alone.
    """
    fitted = {x.channel: x for x in model.left if x.purpose == FITTED}
    white = Left("", FITTED, 1.0, 1.0, 1.0)
    return all(
        x.lasting <= CALIBRATED * max(before.lasting, 1.0)
        and x.slow <= CALIBRATED * max(before.slow, 1.0)
        for x in above(model) if x.purpose != FITTED
        for before in [fitted.get(x.channel, white)]
    )  # fmt: skip


def _by_force(declared: Model, model: Model) -> float:
    """What a model leaves of the worst run more than a free force on the declared one would."""
    share = _most(declared.forces).explained if declared.forces else 0.0
    return model.worst - (1.0 - share) * declared.worst


def _most(forces: Sequence[Force]) -> Force:
    return max(forces, key=lambda force: force.explained)


def _excess(table: Table, model: Model) -> float:
    """Sum of squares over sigma beyond what noise has, on all runs."""
    return -2.0 * (model.fitted + model.unused) - table.fitted_count - table.unused_count


def _explained(table: Table, model: Model, less: Model) -> float:
    """Share of what a model leaves beyond noise that another one takes away."""
    excess = _excess(table, less)
    if model.rough:  # of unused runs a first order says nothing
        excess = -2.0 * less.fitted - table.fitted_count
    taken = 2.0 * (model.fitted + model.unused - less.fitted - less.unused)
    return min(max(taken / excess, 0.0), 1.0) if excess > 0.0 else 0.0


def _size_of(model: Model) -> tuple[int, int, int, int]:
    """How simple a set is; of as many parameters the special case, which holds fewer of its own."""
    laws = model.laws
    return (
        len(laws), sum(law.own for law in laws), model.free, sum(len(law.contains) for law in laws)
    )  # fmt: skip


def _apart(table: Table, first: int, second: int) -> bool:
    """Whether the data tell two models apart; those that were not compared are."""
    if first == second:
        return False
    for c in table.comparisons:
        if {c.first, c.second} == {first, second}:
            need = threshold(table.candidates)
            told = any(
                abs(nats) > need and abs(z) > GATE_Z
                for nats, z in ((c.gain.fitted, c.gain.fitted_z), (c.gain.unused, c.gain.unused_z))
            )
            return told and not _elsewhere(table, first, second)
    return True


def _differ(first: Model, second: Model) -> tuple[list[Law], list[Law]]:
    """Laws that only one of two sets has."""
    return (
        [law for law in first.laws if law.label not in second.labels],
        [law for law in second.laws if law.label not in first.labels],
    )


def _elsewhere(table: Table, first: int, second: int) -> bool:
    """Whether two sets differ by the place of one law and are equal but for a hair."""
    one, two = table.models[first], table.models[second]
    mine, other = _differ(one, two)
    if len(mine) != 1 or len(other) != 1 or mine[0].effect != other[0].effect:
        return False
    gain = mine[0].missed or one.gain
    most = abs(gain.fitted + gain.unused) if gain is not None else 0.0
    return abs(one.fitted + one.unused - two.fitted - two.unused) < SAME * most


def _one_answer(first: Model, second: Model) -> bool:
    """Whether two sets differ by laws of which each is one of the other's, or a case of it."""
    mine, other = _differ(first, second)
    return len(mine) == len(other) > 0 and any(
        all(one_law(one, two) for one, two in zip(mine, order, strict=True))
        for order in permutations(other)
    )


def _special(table: Table, place: int, able: Sequence[int]) -> int | None:
    """A set with the special case of a law of which nothing else is determined, if it does as well.

    A bristle that gives way by nothing is dry friction.
    """
    model, declared, found = table.models[place], table.models[0], []
    whole = model.fitted + model.unused - declared.fitted - declared.unused
    for i in able:
        mine, other = _differ(model, table.models[i])
        if len(mine) != 1 or len(other) != 1:
            continue
        general, simple = mine[0], other[0]
        further = [v for v in general.values if v.name != general.strength]
        gain = general.missed if model.laws[1:] else None
        hair = HAIR * (whole if gain is None else gain.fitted + gain.unused)
        rival = table.models[i]
        if (
            further and not any(v.determined for v in further)
            and simple.place == general.place and simple.effect in general.contains
            and rival.fitted + rival.unused >= model.fitted + model.unused - hair
        ):  # fmt: skip
            found.append(i)
    return max(found, key=lambda i: table.models[i].score, default=None)


def _named(table: Table, best: int) -> Verdict:
    """The verdict that names a set, or says what it is confounded with."""
    model, declared = table.models[best], table.models[0]
    places: dict[str, list[str]] = {
        law.label: [t for t in law.twins if t not in _fitted(table)] for law in model.laws
    }
    rivals: list[tuple[int, float]] = []
    alike: list[int] = []
    others: list[tuple[str, ...]] = []
    replaced: list[tuple[str, ...]] = []
    for i, rival in enumerate(table.models):
        if i == best or not rival.laws or rival.rough or _apart(table, best, i):
            continue
        mine, other = _differ(model, rival)
        if not mine or not other or len(rival.laws) > len(model.laws):
            continue  # more than is missed
        if not all(law.there for law in rival.laws):
            alone = len(mine) == len(other) == 1 and not _one_answer(model, rival)
            if alone and all(law.there or law is other[0] for law in rival.laws):
                # it is there, or leaving it out would do as well; its strength does not show
                places[mine[0].label].append(other[0].label)
            continue  # else a smaller set
        if len(mine) == len(other) == 1 and mine[0].effect == other[0].effect:
            places[mine[0].label].append(other[0].place)
            alike.append(i)
        elif not _one_answer(model, rival):
            alike.append(i)
            labels = tuple(law.label for law in other)
            same = [t for law in other[:1] if not other[1:] for t in law.twins
                    if t not in _fitted(table)]  # fmt: skip
            for one in (labels, *((t,) for t in same)):  # what is one with it, and was not fitted
                rivals.append((i, rival.score - model.score))
                others.append(one)
                replaced.append(tuple(law.label for law in mine))
    order = sorted(range(len(rivals)), key=lambda k: (-rivals[k][1], others[k]))
    shares = {}
    for law in model.laws:
        gain = law.missed
        beyond = _excess(table, model) + (2.0 * (gain.fitted + gain.unused) if gain else 0.0)
        taken = 2.0 * (gain.fitted + gain.unused) if gain else 0.0
        shares[law.label] = min(max(taken / beyond, 0.0), 1.0) if beyond > 0.0 else 0.0
    return Verdict(
        "confounded" if rivals else "effect_found",
        best,
        tuple(held_by_all(law, [table.models[i] for i in alike]) for law in model.laws),
        _explained(table, model, declared),
        shares,
        tuple(rivals[k] for k in order),
        tuple(others[k] for k in order),
        tuple(replaced[k] for k in order),
        {label: tuple(sorted(found)) for label, found in places.items() if found},
        tuple(alike),
        _left(table, model),
        force=model.forces[0] if model.forces else None,
        ended=table.ended,
    )


def _fitted(table: Table) -> set[str]:
    """Labels of all laws that were fitted."""
    return {law.label for model in table.models if not model.rough for law in model.laws}


def _hints(table: Table) -> tuple[Hint, ...]:
    """Sets that are nearest to the data, the best first, and why they are no names.

    Of a set with laws that add less than `LEAST` to another one, that one is the hint.
    """
    declared, found = table.models[0], []
    shares = [
        (i, model, share) for i, model in enumerate(table.models[1:], 1)
        if model.laws and (share := _explained(table, model, declared)) >= LEAST
        and all(law.size.value != law.absent for law in model.laws)  # else it is none
    ]  # fmt: skip
    for i, model, explained in sorted(shares, key=lambda x: (x[1].rough, -x[1].score)):
        if any(m.labels < model.labels and share > explained - LEAST for _, m, share in shares):
            continue
        left = above(model)
        why = doubts(table, model)
        if table.stopped:
            why.append("not all others were asked")
        if not why and (better := beaten(table, i)) is not None:
            names = ", ".join(law.label for law in table.models[better].laws)
            why.append(f"{names} does better, and cannot be named")
        if left:
            why.append(f"it leaves more than noise in {over(left)}")
        if left and not carries_over(model):
            why.append("it leaves more in unused runs than in those that were fitted")
        if left and declared.forces and not model.rough and _by_force(declared, model) > 0.0:
            force = _most(declared.forces)
            why.append(f"a free force at {force.label} would explain more of the worst run")
        if left and model.forces and _most(model.forces).explained >= HALF:
            force = _most(model.forces)
            part = percent(force.explained)
            why.append(f"a free force at {force.label} explains {part} of what it leaves")
        found.append(
            Hint(model.laws, explained, left[0] if left else None, tuple(why), model.rough)
        )
    return tuple(hint for hint in found if hint.why)[:HINTS]
