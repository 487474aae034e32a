"""Which laws with a name come nearest to one from data, and where do they differ from it?

A named law is fitted in its own FMU. What its model does otherwise than that of the law from data
is regressed on the responses of the latter: the force by which the two differ, as a function of the
signals of the law. It holds to first order around that law, so it is exact for laws that are near.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import CosimError
from ..candidates import candidates
from ..models import Fitted
from .regression import regress
from .trial import Law, Maker

Vector = NDArray[np.float64]
NAMED = 3
"""Named laws that are fitted, those that gain most to first order."""


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


def nearest(maker: Maker, law: Law, say: Callable[[str], None]) -> list[Named]:
    """Named laws of the place, the most probable first.

    Args:
        maker: of the law.
        law: the one from data.
        say: told what is done.
    """
    search, base, site = maker.search, maker.bench.base, maker.bench.site
    here = [
        c for c in candidates(base.problem)
        if (c.instance, c.port) == (site.instance, site.port) and c.refinement is None
    ]  # fmt: skip
    bench = search.bench(base, search.fitting)
    signatures = bench.followed(bench.begun(here, thorough=True))
    signatures.sort(key=lambda s: -s.score.gain)
    found = []
    for item in signatures[:NAMED]:
        fitted = search.refit(base, item)
        if fitted is None:
            continue
        fitted = search.refined(base, fitted, quick=True)
        say(f"beside {item.candidate.effect}")
        try:
            found.append(Named(fitted, _difference(maker, law, fitted)))
        except CosimError as error:
            say(f"{item.candidate.label}: {error}")
    found.sort(key=lambda n: -search.gain(base, n.fitted))
    return found


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
