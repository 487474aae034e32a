"""The table of models of a search, for the verdict."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..calibrate.foretelling import within_intervals
from .bounds import beyond
from .doubts import doubts, threshold
from .facts import Comparison, Force, Law, Left, Model, Table, Value
from .judge import Judge
from .linear import BAND
from .localise import Place, worst
from .models import Fitted
from .rounds import Round
from .verdict import above, with_small
from .whiteness import whiteness_tests

Vector = NDArray[np.float64]
NEAR, MOST = 0.9, 12
"""Models that are compared with each other: those that explain this share of what the best one
does, or are as near to the best that can be named that neither fitted nor unused runs need tell
them apart; and how many at most. Others differ by more than any run could leave open."""
RIVALS = 0.5
"""Models that explain less than this share of what the best one does are judged as they were
fitted, with the search's exchange: what that adds was a thirtieth of what the best one explains
where a model did worst at it (play instead of an elastic gear)."""
FIRST_ORDERS = 3
"""Candidates without a fit that are kept as hints."""


def table_of(
    judge: Judge,
    rounds: Sequence[Round],
    forces: dict[frozenset[str], list[Place]],
    ended: dict[str, float],
    stopped: str = "",
) -> Table:
    """All that the verdict needs of a search.

    Args:
        judge: the data, and the fits that were made.
        rounds: scores of the candidates.
        forces: what free forces explain of what a set of effects leaves.
        ended, stopped: see `Table`.
    """
    declared = judge.memo.declared
    fits = [declared, *(f for f in judge.memo if f.effects)]
    least = RIVALS * max(judge.total(declared, f) for f in fits)
    fits = [
        f if f is declared or judge.total(declared, f) >= least
        else replace(f, values=f.values.nearly()) for f in fits
    ]  # fmt: skip
    same = {s.candidate: s.same for stage in reversed(rounds) for s in stage.signatures}
    chance = {label: p for stage in reversed(rounds) for label, p in stage.corrected.items()}
    unused = judge.unused
    run = worst(judge, declared, 1)[0].name
    models = []
    for f in fits:
        models.append(
            Model(
                tuple(judge.law(f, c, same.get(c, ()), chance.get(c.label)) for c in f.effects),
                f.complexity,
                -judge.fitting.cost(judge.fit_data - f.fit),
                -judge.checking.cost(judge.check_data - f.check) if unused else 0.0,
                left_of(judge, f),
                judge.better(declared, f) if f.effects else None,
                tuple(map(force_of, forces[f.labels])) if f.labels in forces else None,
                _excess(judge, f, run),
                _beyond(judge.fit_data - f.fit)
                + (_beyond(judge.check_data - f.check) if unused else 0.0),
                beyond=judge.better(judge.lifted, f) if judge.lifted and f.effects else None,
            )
        )
    rough = _first_orders(models, rounds) if rounds else []
    table = Table(
        (*models, *rough),
        (),
        candidates_of(rounds),
        judge.fitting.size,
        judge.checking.size if unused else 0,
        ended=tuple(ended.items()),
        stopped=stopped,
        opened=_opened(judge, declared),
        bounds=beyond(declared, judge.lifted) if judge.lifted else (),
        columns=len(declared.problem.channels) + len(declared.problem.runs[0].inputs),
    )
    models = [_foretold(judge, table, *pair) for pair in zip(models, fits, strict=True)]
    table = replace(table, models=(*models, *rough))
    compared = [
        Comparison(i, k, judge.better(fits[i], fits[k]))
        for i, k in combinations(comparable(table), 2)
    ]
    return replace(table, comparisons=tuple(compared))


def candidates_of(rounds: Sequence[Round]) -> int:
    """Number of candidates that there were to choose from; known twins count once."""
    return max((len(r.signatures) + len(r.aside) for r in rounds), default=0)


def _excess(judge: Judge, fitted: Fitted, run: str) -> float:
    """Sum of squares over sigma beyond noise that a model leaves in a run."""
    rows = judge.fitting.by_run(judge.fit_data - fitted.fit)
    values = rows[judge.fitting.names.index(run)]
    values = values[np.isfinite(values)]
    return float(values @ values) - values.size


def _beyond(residual: Vector) -> float:
    """Sum of squares over sigma beyond noise."""
    return float(residual @ residual) - residual.size


def left_of(judge: Judge, fitted: Fitted) -> tuple[Left, ...]:
    """What a model leaves of each channel, in fitted runs and in unused ones."""
    found = []
    parts = [("identification", judge.fitting, judge.fit_data - fitted.fit)]
    if judge.unused:
        parts.append((judge.purpose, judge.checking, judge.check_data - fitted.check))
    for purpose, stack, residual in parts:
        found += [
            Left(t.channel, purpose, t.rms, t.lasting, t.p_value, t.slow, t.p_fast, t.p_white)
            for t in whiteness_tests(residual, stack)
        ]
    return tuple(found)


def _opened(judge: Judge, declared: Fitted) -> Model | None:
    """The declared model with bounds opened, if it was fitted."""
    f = judge.lifted
    if f is None:
        return None
    unused = -judge.checking.cost(judge.check_data - f.check) if judge.unused else 0.0
    return Model((), f.complexity, -judge.fitting.cost(judge.fit_data - f.fit), unused,
                 left_of(judge, f), judge.better(declared, f))  # fmt: skip


def _foretold(judge: Judge, table: Table, model: Model, fitted: Fitted) -> Model:
    """A model with what it leaves of unused runs beside what its parameters' deviations make there.

    Asked only where it matters: of the declared model, and of sets that may be named but for what
    they leave, or for small laws besides. Where fitted runs hold more than noise, deviations are
    not what they are said to be, and slow parts alone are asked. None are told where runs may turn
    unstable: derivatives say little there.
    """
    if judge.raw.unstable:
        return replace(model, left=tuple(replace(x, slow=1.0) for x in model.left))
    late = [x for x in above(model) if x.purpose == judge.purpose]
    if not judge.unused or not late:
        return model
    able = [m for m in table.models if m.laws and not doubts(table, m)]
    if model.laws and model not in able and not any(with_small(table, m, model) for m in able):
        return model
    calm = not any(x.structured for x in model.left if x.purpose != judge.purpose)
    if not calm and any(x.structured for x in late):
        return model
    tests = {t.channel: t for t in whiteness_tests(judge.beside(fitted), judge.checking)}
    left = []
    for x in model.left:
        if x.purpose == judge.purpose:
            t, before = tests[x.channel], x.structured
            x = replace(x, slow=t.slow, p_value=t.p_value)
            if calm:
                x = replace(x, lasting=t.lasting, p_fast=t.p_fast, p_white=t.p_white,
                            foretold=before and not t.structured)  # fmt: skip
        left.append(x)
    return replace(model, left=tuple(left))


def unsure(table: Table, labels: Collection[str]) -> Iterator[str]:
    """Warnings of channels that are off in unused runs as far as parameters' intervals make it.

    Args:
        table: of all models.
        labels: of the laws of the model that the verdict is about.
    """
    for model in table.models:
        if not model.rough and set(model.labels) == set(labels):
            yield from (within_intervals(x.channel, x.rms) for x in model.left if x.foretold)


def force_of(place: Place) -> Force:
    """The free force of a place that explains most."""
    best = max(place.curves, key=lambda curve: curve.explained)
    return Force(place.instance, place.port, place.element, best.explained)


def comparable(table: Table) -> list[int]:
    """Places of the models that explain nearly as much as the best one, or as one to be named.

    Args:
        table: of all models; its comparisons are not needed.
    """
    models = [m for m in table.models if not m.rough]
    most = max((m.score for m in models[1:]), default=0.0)
    named = max((m.score for m in models[1:] if not doubts(table, m)), default=np.inf)
    least = models[0].score + NEAR * (most - models[0].score)
    least = min(least, named - 2.0 * threshold(table.candidates))  # of fitted and of unused runs
    near = [i for i, m in enumerate(models) if i and m.score >= least]
    able = {i for i in near if all(law.there for law in models[i].laws)
            and models[i].score <= named + 2.0 * threshold(table.candidates)}  # fmt: skip
    few = min((len(models[i].laws) for i in able if not doubts(table, models[i])), default=0)
    first = {i for i in able if len(models[i].laws) <= few}
    near.sort(key=lambda i: (i not in first, -models[i].score))
    return sorted(near[:MOST], key=lambda i: -models[i].score)


def _first_orders(models: list[Model], rounds: Sequence[Round]) -> list[Model]:
    """What the first round's best candidates without a fit would take, to first order."""
    known = {law.label for m in models for law in m.laws}
    found: list[Model] = []
    for item in rounds[0].signatures:
        if len(found) == FIRST_ORDERS:
            break
        if item.unseen or item.candidate.label in known or not item.score.gain > 0.0:
            continue
        p, prefix = item.strength, item.candidate.prefix
        value, half = item.value * item.score.amplitude, BAND * item.score.spread
        half *= abs(item.value) / item.score.size
        low, value, high = np.clip([value - half, value, value + half], p.minimum, p.maximum)
        size = Value(
            p.name.removeprefix(prefix), p.unit, float(value), float(low), float(high),
            p.minimum, p.maximum, True,
        )  # fmt: skip
        law = Law(
            item.candidate.effect, item.candidate.instance, item.candidate.port, size.name, (size,),
            item.candidate.text, p.absent, max(item.probe.own, 1),
            item.candidate.contains, item.same,
            rounds[0].corrected.get(item.candidate.label),
        )  # fmt: skip
        declared = models[0]
        found.append(
            Model((law,), declared.free + 1, declared.fitted + item.score.gain, declared.unused,
                  (), rough=True)
        )  # fmt: skip
    return found
