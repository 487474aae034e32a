"""Which laws with a name come nearest to one from data, and where do they differ from it?

A named law is fitted in its own FMU. What its model does otherwise than that of the law from data
is regressed on the responses of the latter: the force by which the two differ, as a function of the
signals of the law. It holds to first order around that law, so it is exact for laws that are near.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...calibrate.fit import fit
from ...calibrate.problem import Problem
from ...errors import CosimError
from ..candidates import Candidate, candidates, new_parameters
from ..models import Fitted
from .regression import solved
from .trial import QUICK, Law, Maker

Vector = NDArray[np.float64]
NAMED = 3
"""Named laws that are fitted with all their parameters: the best with their usual ones."""
FREE = 1e-6
"""Share of what is known of declared parameters beforehand that counts where two models are
compared: what these differ in is no difference of the laws."""
SIZES = tuple(sign * size for size in (0.03, 0.1, 0.3, 1.0, 3.0) for sign in (1.0, -1.0))
"""Strengths over the usual one of a law from the best of which its fit begins."""


@dataclass(frozen=True)
class Named:
    """A named law beside one from data.

    Attributes:
        fitted: the model with it.
        difference: its free coefficients less those of the law.
    """

    fitted: Fitted
    difference: Vector

    def to_dict(
        self, law: Law, gain: float, unused: bool, at: list[Vector], visits: Vector
    ) -> dict[str, Any]:
        """As in the JSON.

        Args:
            law: the one from data.
            gain: log likelihood by which that does better on the runs that judge [nats].
            unused: whether these were not fitted.
            at: points of its curve, x and y.
            visits: share of the samples near each of them.
        """
        last, values = self.fitted.effects[-1], self.fitted.estimate.values
        away = law.design(*at) @ self.difference
        own, deviation = law.values(*at, held=True)
        share = visits / max(float(np.sum(visits)), 1e-300)
        size = float(np.sqrt(np.sum(share * own**2)))
        rms = float(np.sqrt(np.sum(share * away**2)))
        return {
            "effect": last.effect,
            "place": last.place,
            "text": last.text,
            "parameters": {
                name.removeprefix(last.prefix): value
                for name, value in values.items() if name.startswith(last.prefix)
            },
            "rms_difference": rms,
            "relative_difference": rms / size if size > 0.0 else None,
            "unused_runs_prefer_the_law_by_nats": gain if unused else None,
            **({} if unused else {"fitted_runs_prefer_the_law_by_nats": gain}),
            "value": (own + away).tolist(),
            "differs": [
                {"x": float(at[0][i]), "y": float(at[1][i]), "law": float(own[i]),
                 "named": float(own[i] + away[i])}
                for i in _peaks(np.abs(away) / np.maximum(deviation, 1e-300), visits)
            ],
        }  # fmt: skip


def _peaks(ratio: Vector, visits: Vector) -> list[int]:
    """Where they differ most, in standard deviations beyond two, of what the data visit."""
    ratio = np.where(visits > 0.0, ratio, 0.0)
    inner = [
        i for i in range(ratio.size)
        if ratio[i] > 2.0 and ratio[i] == np.max(ratio[max(i - 5, 0) : i + 6])
    ]  # fmt: skip
    return sorted(inner, key=lambda i: -ratio[i])[:3]


def nearest(maker: Maker, law: Law) -> list[Named]:
    """Named laws of the place, the most probable first.

    Each is fitted in the law's stead, with the declared parameters from where that has led: around
    a model without any, which may be far off, first orders do not tell.
    """
    search, site = maker.search, maker.bench.site
    here = [
        c for c in search.offered(candidates(maker.bench.base.problem))
        if c.place == site.shaft and c.refinement is None
    ]  # fmt: skip
    drafts: list[tuple[Fitted, Problem, dict[str, float]]] = []
    for item in here:
        try:
            drafts.append(_draft(maker, law, item))
        except CosimError as error:
            search.say(f"{item.label}: {error}")
    drafts.sort(key=lambda d: d[0].estimate.robust)
    found = []
    for draft, whole, values in drafts[:NAMED]:
        fitted = draft
        try:
            if len(whole.names) > draft.free:
                free = _fitted(maker, whole, values | draft.estimate.values)
                free.effects = draft.effects
                fitted = free if search.gain(draft, free) > 0.0 else draft
            found.append(Named(fitted, _difference(maker, law, fitted)))
        except CosimError as error:
            search.say(f"{draft.effects[-1].label}: {error}")
            continue
        gain = search.gain(fitted, law.fitted)
        search.say(f"beside {draft.effects[-1].effect}: the law does better by {gain:.0f} nats")
    found.sort(key=lambda n: n.fitted.estimate.robust + n.fitted.free)
    return found


def _draft(maker: Maker, law: Law, item: Candidate) -> tuple[Fitted, Problem, dict[str, float]]:
    """A named law with only its strength fitted, the problem with all of it, and all values."""
    search, base = maker.search, maker.bench.base
    whole = item.added_to(base.problem)
    strengths, others = new_parameters(base.problem, whole)
    values = {p.name: p.nominal for p in whole.parameters}
    values |= dict(zip(base.problem.names, law.fitted.estimate.theta.tolist(), strict=False))
    problem = whole.hold({p.name: p.nominal for p in others})
    simulator = search.simulator.of(problem).limited(maker.bench.limits)
    best, least = values, np.inf
    for strength in strengths:
        for size in SIZES:
            trial = float(np.clip(size * strength.span, strength.minimum, strength.maximum))
            tried = values | {strength.name: trial}
            cost = maker.cost(simulator, np.array([tried[n] for n in problem.names]))
            if cost < least:
                best, least = tried, cost
    fitted = _fitted(maker, problem, best)
    fitted.effects = (*base.effects, item)
    return fitted, whole, values


def _fitted(maker: Maker, problem: Problem, values: Mapping[str, float]) -> Fitted:
    search = maker.search
    theta = np.array([values[name] for name in problem.names])
    theta = np.clip(theta, problem.lower, problem.upper)
    simulator = search.simulator.of(problem).limited(maker.bench.limits)
    return search.judged(fit(simulator, theta, effort=QUICK))


def _difference(maker: Maker, law: Law, named: Fitted) -> Vector:
    """Free coefficients that the law would need more to do what a named one does."""
    search = maker.search
    theta, _, slopes, held = maker.point(law.fitted)
    rows = search.fitting.by_run(named.fit - law.fitted.fit)
    away = dict(zip(search.fitting.names, rows, strict=True))
    narrow = law.shape.form not in ("x", "y")
    directions = law.directions if narrow else np.eye(law.directions.shape[0])
    asked = law.trial.expansion @ directions
    grams = maker.bench.grams(law.shape, asked, theta, law.coefficients, away, slopes, held)
    # it has no noise whose evidence could tell its size: it may be as large as the law
    known = directions.T @ law.trial.regression.prior.law @ directions
    return np.asarray(directions @ solved(grams, known, FREE * maker.declared))
