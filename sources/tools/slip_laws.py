"""Which law of e2, e3 over the track speeds predicts turns of a set that it was not fitted to?

A candidate gives e2 and e3 as linear forms in a few functions of the speeds, by least squares on
the measured shifts; its judge is the distance of the predicted path from the measured one after a
quarter turn (the paper's criterion), on the set of runs that was left out. `simplest` prefers few
parameters: it takes the smallest law whose error is within one standard error of the best one's,
and `nested` tells what that choice itself is worth, by leaving a set out before anything is chosen.

Source: crawler paper, section 6 (criterion) and Table 2; one-standard-error rule: Breiman et al.,
Classification and Regression Trees, 1984.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from .crawler_identification import Constants, Turns, predict

Vector = NDArray[np.float64]
POINTS = 200
"""Points of a path over which the largest distance is taken."""

TERMS: dict[str, Callable[[Turns], Vector]] = {
    "1": lambda t: np.ones_like(t.w2),
    "w2": lambda t: t.w2,
    "w3": lambda t: t.w3,
    "(w2 - w3)": lambda t: t.w2 - t.w3,
    "(w2 + w3)": lambda t: t.w2 + t.w3,
    "rho": lambda t: t.w3 / t.w2,
    "K": lambda t: (t.w2 - t.w3) / (t.w2 + t.w3),
}
"""Functions of the speeds: rho is the inner over the outer speed, K the curvature of the path that
plain differential drive takes, times B/2."""


class SlipLaw(Protocol):
    """A law of e2 and e3."""

    @property
    def size(self) -> int:
        """Parameters."""
        ...

    def fitted(self, turns: Turns, e2: Vector, e3: Vector) -> Callable[[Turns], tuple[Vector, ...]]:
        """The law fitted to turns with known shifts: turns -> e2, e3."""
        ...


@dataclass(frozen=True)
class LawCandidate:
    """A law.

    Attributes:
        outer: terms of e2.
        inner: terms of e3, none for e3 = 0; "sum" for e2 + e3 = constant.
    """

    outer: tuple[str, ...]
    inner: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """Parameters."""
        return len(self.outer) + len(self.inner)

    def __str__(self) -> str:
        if self.inner == ("sum",):
            return f"e2 = {_text(self.outer)}, e2 + e3 = s"
        return f"e2 = {_text(self.outer)}, e3 = {_text(self.inner, 'cd')}"

    def fitted(self, turns: Turns, e2: Vector, e3: Vector) -> Callable[[Turns], tuple[Vector, ...]]:
        """The law fitted to turns with known shifts: turns -> e2, e3."""
        right = _solved(self.outer, turns, e2)
        if self.inner == ("sum",):
            total = float(np.mean(e2 + e3))
            return lambda t: (right(t), total - right(t))
        left = _solved(self.inner, turns, e3)
        return lambda t: (right(t), left(t))


def _text(terms: tuple[str, ...], letters: str = "ab") -> str:
    parts = [
        letter if term == "1" else f"{letter} {term}"
        for letter, term in zip(letters, terms, strict=False)
    ]
    return " + ".join(parts) or "0"


def _solved(terms: tuple[str, ...], turns: Turns, values: Vector) -> Callable[[Turns], Vector]:
    if not terms:
        return lambda t: np.zeros_like(t.w2)
    columns = np.column_stack([TERMS[term](turns) for term in terms])
    weights, *_ = np.linalg.lstsq(columns, values, rcond=None)
    return lambda t: np.asarray(np.column_stack([TERMS[term](t) for term in terms]) @ weights)


class OuterSkid:
    """The outer track alone skids, by i = a/(b + rho), so e2 = B i/(1 - rho - i)."""

    size = 2

    def __str__(self) -> str:
        return "i_R = a/(b + rho), e3 = 0"

    def fitted(self, turns: Turns, e2: Vector, e3: Vector) -> Callable[[Turns], tuple[Vector, ...]]:
        """The law fitted to the skid coefficients of turns with known shifts."""
        rho = turns.w3 / turns.w2
        skid = e2 * (1 - rho) / (self.span + e2)  # e2 w_z/(r w2) of a turn with e3 = 0
        found = least_squares(
            lambda p: p[0] / (p[1] + rho) - skid, [0.03, 0.1], bounds=([0, 1e-3], [1, 10])
        ).x

        def law(t: Turns) -> tuple[Vector, ...]:
            ratio = t.w3 / t.w2
            i = found[0] / (found[1] + ratio)
            return self.span * i / (1 - ratio - i), np.zeros_like(ratio)

        return law

    def __init__(self, span: float = Constants().B) -> None:
        self.span = span


def _candidates() -> tuple[SlipLaw, ...]:
    single = [(term,) for term in TERMS]
    pairs = [("1", term) for term in TERMS if term != "1"]
    inner = [(), *single, *pairs, ("sum",)]
    linear = [LawCandidate(outer, other) for outer in [*single, *pairs] for other in inner]
    return (*linear, OuterSkid())


CANDIDATES = _candidates()
"""Laws with one or two terms for e2 and none to two, or the constant sum, for e3; and the skid."""


def path_error(turns: Turns, e2: Vector, e3: Vector, c: Constants, angle: float) -> Vector:
    """Largest distance of the predicted from the measured path of S over R_S, by turn [1].

    Args:
        turns: measured.
        e2, e3: of the model.
        c: constants of the vehicle.
        angle: measured turn over which the paths are compared [rad].
    """
    w_z, radius = predict(turns, e2, e3, c)
    share = np.linspace(0.0, 1.0, POINTS)[:, None]
    time = share * angle / turns.w_z

    def path(rate: Vector, distance: Vector) -> tuple[Vector, Vector]:
        middle = np.sqrt(distance**2 - c.l_Sx**2) - c.l_Sy
        sine, cosine = np.sin(rate * time), np.cos(rate * time)
        x = middle * sine - c.l_Sx * cosine + c.l_Sy * sine
        return x, middle - middle * cosine - c.l_Sx * sine - c.l_Sy * cosine

    (x, y), (x_m, y_m) = path(w_z, radius), path(turns.w_z, turns.R_S)
    return np.asarray(np.max(np.hypot(x - x_m, y - y_m), axis=0) / turns.R_S)


@dataclass(frozen=True)
class LawScore:
    """What a law is worth on sets that it was not fitted to.

    Attributes:
        e2, e3: predicted minus measured shifts [m], by turn.
        radius, w_z: relative errors [1], by turn.
        quarter: largest distance after a quarter turn over R_S [1], by turn.
        group: the turn's set.
    """

    e2: Vector
    e3: Vector
    radius: Vector
    w_z: Vector
    quarter: Vector
    group: NDArray[np.int_]

    @property
    def error(self) -> float:
        """Mean criterion [1]."""
        return float(np.mean(self.quarter))

    @property
    def deviation(self) -> float:
        """Standard error of the mean criterion over the sets [1]."""
        means = [np.mean(self.quarter[self.group == g]) for g in np.unique(self.group)]
        return float(np.std(means, ddof=1) / np.sqrt(len(means)))


def _scored(turns: Turns, found: Vector, e2: Vector, e3: Vector, c: Constants) -> LawScore:
    w_z, radius = predict(turns, found[0], found[1], c)
    quarter = path_error(turns, found[0], found[1], c, np.pi / 2)
    return LawScore(found[0] - e2, found[1] - e3, radius / turns.R_S - 1, w_z / turns.w_z - 1,
                 quarter, turns.group)  # fmt: skip


def left_out(law: SlipLaw, turns: Turns, e2: Vector, e3: Vector, c: Constants) -> LawScore:
    """Score of a law on each set, fitted to the other sets."""
    found = np.empty((2, e2.size))
    for group in np.unique(turns.group):
        held = turns.group == group
        model = law.fitted(turns.where(~held), e2[~held], e3[~held])
        found[:, held] = model(turns.where(held))
    return _scored(turns, found, e2, e3, c)


def other_runs(turns: Turns, e2: Vector, e3: Vector, c: Constants) -> LawScore:
    """Score of the mean of the other runs of the same set: what scatter alone leaves."""
    found = np.empty((2, e2.size))
    for i in range(e2.size):
        others = (turns.group == turns.group[i]) & (np.arange(e2.size) != i)
        found[:, i] = e2[others].mean(), e3[others].mean()
    return _scored(turns, found, e2, e3, c)


def ranked(
    turns: Turns, e2: Vector, e3: Vector, c: Constants, laws: Iterable[SlipLaw] = CANDIDATES
) -> list[tuple[SlipLaw, LawScore]]:
    """Laws by their error on the sets left out, without those whose virtual wheels would meet."""
    found = []
    for law in laws:
        score = left_out(law, turns, e2, e3, c)
        if np.isfinite(score.quarter).all() and np.all(c.B + score.e2 + e2 + score.e3 + e3 > 0):
            found.append((law, score))
    return sorted(found, key=lambda item: item[1].error)


def simplest(table: list[tuple[SlipLaw, LawScore]]) -> SlipLaw:
    """The law with fewest parameters within one standard error of the best, of these the best."""
    best = table[0][1]
    near = [item for item in table if item[1].error <= best.error + best.deviation]
    return min(near, key=lambda item: (item[0].size, item[1].error))[0]


def nested(
    turns: Turns, e2: Vector, e3: Vector, c: Constants
) -> tuple[LawScore, dict[int, SlipLaw]]:
    """Score of choosing a law: in each fold it is chosen, and fitted, without the set left out."""
    found = np.empty((2, e2.size))
    chosen: dict[int, SlipLaw] = {}
    for group in np.unique(turns.group):
        held = turns.group == group
        rest = turns.where(~held)
        law = simplest(ranked(rest, e2[~held], e3[~held], c))
        chosen[int(group)] = law
        found[:, held] = law.fitted(rest, e2[~held], e3[~held])(turns.where(held))
    return _scored(turns, found, e2, e3, c), chosen
