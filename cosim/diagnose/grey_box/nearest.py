"""Which laws with a name come nearest to one from data, and where do they differ from it?

A named law is fitted in its own FMU. What its model does otherwise than that of the law from data
is regressed on the responses of the latter: the force by which the two differ, as a function of the
signals of the law. It holds to first order around that law, so it is exact for laws that are near.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...calibrate.fit import fit
from ...errors import CosimError
from ..candidates import candidates
from ..linear import Absorber
from ..models import Fitted
from ..secant import Bench, model_values
from ..signature import Signature
from .regression import regress
from .trial import QUICK, Law, Maker

Vector = NDArray[np.float64]
NAMED = 3
"""Named laws that are fitted, those that do most of what the law does, to first order."""
LESS = 0.1
"""Share by which the law is made weaker to see what it does."""


@dataclass(frozen=True)
class Named:
    """A named law beside one from data.

    Attributes:
        fitted: the model with it.
        difference: its free coefficients less those of the law.
    """

    fitted: Fitted
    difference: Vector

    def to_dict(self, law: Law, gain: float, at: list[Vector], visits: Vector) -> dict[str, Any]:
        """As in the JSON.

        Args:
            law: the one from data.
            gain: log likelihood by which that does better on unused runs [nats].
            at: points of its curve, x and y.
            visits: share of the samples near each of them.
        """
        last, values = self.fitted.effects[-1], self.fitted.estimate.values
        away = law.design(*at) @ self.difference
        own, deviation = law.values(*at)
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
            "unused_runs_prefer_the_law_by_nats": gain,
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

    They are sought where the law from data has led: each is added to the model with it and asked
    how much of what that law does it would do. Around a model without any, which may be far off,
    first orders do not tell.
    """
    search, site = maker.search, maker.bench.site
    here = [
        c for c in candidates(maker.bench.base.problem)
        if (c.instance, c.port) == (site.instance, site.port) and c.refinement is None
    ]  # fmt: skip
    bench = _bench(maker, law)
    signatures = bench.followed(bench.begun(here, thorough=True))
    signatures.sort(key=lambda s: -s.score.gain)
    found = []
    for item in signatures[:NAMED]:
        try:
            fitted = _fitted(maker, law, item)
            found.append(Named(fitted, _difference(maker, law, fitted)))
        except CosimError as error:
            search.say(f"{item.candidate.label}: {error}")
            continue
        search.say(f"beside {item.candidate.effect}: {search.gain(fitted, law.fitted):.0f} nats")
    found.sort(key=lambda n: n.fitted.estimate.robust + n.fitted.free)
    return found


def _bench(maker: Maker, law: Law) -> Bench:
    """Simulates candidates beside the law; what it does is what they are to explain."""
    search, fitted = maker.search, law.fitted
    stack, theta = search.fitting, fitted.estimate.theta
    _, _, slopes, held = maker.point(fitted)
    base = maker.bench.base.problem
    absorber = Absorber(stack.matrix(slopes, base.scale), base, held)
    model = model_values(fitted.simulator, theta, stack)
    less = theta.copy()
    less[law.fits] *= 1.0 - LESS
    done = (model - model_values(fitted.simulator, less, stack)) / LESS
    return Bench(fitted.simulator, theta, stack, model, absorber.rest(done), absorber,
                 np.ones_like(model))  # fmt: skip


def _fitted(maker: Maker, law: Law, item: Signature) -> Fitted:
    """The model with a named law instead, fitted from where the law from data has led."""
    search, base = maker.search, maker.bench.base
    whole = item.candidate.added_to(base.problem)
    values = {p.name: p.nominal for p in whole.parameters} | item.fixed
    values |= dict(zip(base.problem.names, law.fitted.estimate.theta.tolist(), strict=False))
    strength = item.strength
    asked = item.value * (item.score.amplitude or 1.0)
    values[strength.name] = float(np.clip(asked, strength.minimum, strength.maximum))
    if item.probe.second:
        values[item.probe.second] = item.second
    known = {*base.problem.names, strength.name, item.probe.second}
    first = whole.hold({n: values[n] for n in whole.names if n not in known})
    best: Fitted | None = None
    for problem in (first, whole):
        theta = np.array([values[name] for name in problem.names])
        theta = np.clip(theta, problem.lower, problem.upper)
        simulator = search.simulator.of(problem).limited(maker.bench.limits)
        fitted = search.judged(fit(simulator, theta, effort=QUICK))
        values |= fitted.estimate.values
        if best is None or search.gain(best, fitted) > 0.0:
            best = fitted
    assert best is not None
    best.effects = (*base.effects, item.candidate)
    return best


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
    penalties = [np.zeros((directions.shape[1],) * 2)]
    if not (narrow or law.trial.words):
        penalties = law.shape.penalties()
    return np.asarray(directions @ regress(grams, penalties, maker.declared).value)
