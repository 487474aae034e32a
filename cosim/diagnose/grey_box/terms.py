"""A formula of few named terms instead of a smooth law, where it does as well.

Terms are written in the functions of the smooth law (each is a direction of its coefficients), so
that their likelihood comes from the same Gram matrices and the same FMU carries them. They are
added one by one after the first two, those first by which runs that are left out gain most.

Source: forward selection (Miller, Subset Selection in Regression, 2002).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..models import GATE
from .basis import Axis, Shape
from .regression import Gram, regress
from .trial import CONSTANT, Law, Maker, Trial

Vector = NDArray[np.float64]
Term = Callable[[Vector, Vector], Vector]
MOST = 5
"""Terms of a formula at most."""
EXACT = 0.02
"""Share of a term by which its image in splines may differ from it, in RMS over the runs: beside
the law's own uncertainty, less is not seen."""
HARMONICS = 3
"""Multiples of an angle's cycles that are terms: as many as its splines follow."""
ASKED = 12
"""Sets of as many terms of which it is asked what runs gain that are left out, those that explain
most of all runs: that order differs from this one by terms that do nearly the same, of which a
signal has no more."""
POINTS = 4000
"""Points along the runs at which terms are compared with their images."""


def library(shape: Shape) -> dict[str, Term]:
    """Terms for a shape: word -> function of x and y."""
    found: dict[str, Term] = {CONSTANT: lambda x, y: np.ones_like(x)}
    if shape.x is not None:
        found |= _of_x(shape.x)
    if shape.y is not None:
        found |= _of_y(shape.y)
    if shape.form == "x * y" and shape.x is not None and shape.y is not None:
        for word, term in _of_y(shape.y).items():
            for name, factor in _of_x(shape.x).items():
                found[f"{word} {name}"] = _product(term, factor)
    return found


def _product(first: Term, second: Term) -> Term:
    return lambda x, y: first(x, y) * second(x, y)


def _of_x(axis: Axis) -> dict[str, Term]:
    name = axis.signal
    return {
        name: lambda x, y: x,
        f"{name} |{name}|": lambda x, y: x * np.abs(x),
        f"|{name}|": lambda x, y: np.abs(x),
        f"{name}^2": lambda x, y: x**2,
        f"{name}^3": lambda x, y: x**3,
        f"sign({name})": lambda x, y: np.tanh(x / axis.jump),
    }


def _of_y(axis: Axis) -> dict[str, Term]:
    if not axis.turn:
        return {axis.label: (lambda x, y: np.abs(y)) if axis.fold else (lambda x, y: y)}
    found: dict[str, Term] = {}
    cycles = round(2.0 * np.pi / axis.range)
    for n in (cycles * (k + 1) for k in range(HARMONICS)):
        word = axis.signal if n == 1 else f"{n} {axis.signal}"
        found[f"cos({word})"], found[f"sin({word})"] = _wave(n, 0.5 * np.pi), _wave(n, 0.0)
    return found


def _wave(cycles: int, ahead: float) -> Term:
    return lambda x, y: np.sin(cycles * y + ahead)


def images(shape: Shape, x: Vector, y: Vector) -> dict[str, Vector]:
    """Coefficients of the smooth law that are a term, as near as matters at some points."""
    design = shape.design(x, y)
    found: dict[str, Vector] = {}
    for word, term in library(shape).items():
        values = term(x, y)
        image = np.asarray(np.linalg.lstsq(design, values, rcond=1e-9)[0], np.float64)
        size = float(np.sqrt(np.mean(values**2)))
        if size > 0.0 and np.sqrt(np.mean((design @ image - values) ** 2)) < EXACT * size:
            found[word] = image
    return found


def formula(maker: Maker, law: Law, around: Trial) -> Trial | None:
    """A formula that does as well as a smooth law to first order, None if there is none.

    Args:
        maker: of laws.
        law: the smooth one.
        around: the same shape to first order around it.
    """
    seen = [values[:: max(values.size // POINTS, 1)] for values in maker.visited(law)]
    # a term holds where no fitted run goes, too
    ends = zip(seen, spread(law.shape, seen[0].size), strict=True)
    x, y = (np.concatenate([values, more]) for values, more in ends)
    near = images(law.shape, x, y)
    if not near:
        return None
    turn = np.column_stack(list(near.values()))
    grams = tuple(gram.form(turn) for gram in around.grams)
    expansion = {word: around.shape.expansion @ image for word, image in near.items()}
    best = selected(maker, around.shape, grams, expansion)
    return None if best.expected < around.expected - GATE else best


def selected(
    maker: Maker, shape: Shape, grams: tuple[Gram, ...], expansion: Mapping[str, Vector]
) -> Trial:
    """The terms by which runs that are left out gain most, added one by one after the first two.

    Args:
        maker: of laws.
        shape: of the law.
        grams: of all terms.
        expansion: term -> its coefficients.
    """
    known = list(expansion)
    explained = promised(grams, len(known), maker.declared)
    best: Trial | None = None
    while best is None or len(best.words) < min(MOST, len(known)):
        words = () if best is None else best.words
        more: list[tuple[str, ...]] = [(w,) for w in known if w not in words]
        if not words:  # a declared parameter may undo much of one term, and only two make sense
            more += list(combinations(known, 2))
        places = [[known.index(w) for w in (*words, *others)] for others in more]
        order = np.argsort([-explained(place) for place in places], kind="stable")
        trials = [_trial(maker, shape, grams, expansion, (*words, *more[k])) for k in order[:ASKED]]
        first = max(trials, key=lambda t: t.expected - GATE * len(t.words))
        if best is not None and first.expected < best.expected + GATE:
            break
        best = first
    return best


def promised(
    grams: Sequence[Gram], count: int, declared: Vector
) -> Callable[[Sequence[int]], float]:
    """What some terms would explain, declared parameters fitted as well [nats]."""
    total = np.sum([gram.matrix for gram in grams], axis=0)
    inner = total[count:-1, count:-1] + np.diag(declared)
    rest = [*range(count), total.shape[0] - 1]
    outer = total[count:-1][:, rest]
    alone = total[np.ix_(rest, rest)] - outer.T @ np.linalg.solve(inner, outer)
    size = np.sqrt(np.maximum(np.diag(alone), 1e-300))
    alone = alone / np.outer(size, size)

    def explained(place: Sequence[int]) -> float:
        rounded = np.finfo(np.float32).eps * np.eye(len(place))  # columns have single precision
        matrix = alone[np.ix_(place, place)] + rounded
        share = alone[place, -1]
        return 0.5 * float(size[-1] ** 2 * (share @ np.linalg.solve(matrix, share)))

    return explained


def spread(shape: Shape, count: int) -> list[Vector]:
    """Points x and y all over the ranges of a law's signals, in no order."""
    random, found = np.random.default_rng(0), []
    for axis in (shape.x, shape.y):
        first, last = (axis.first, axis.last) if axis else (0.0, 0.0)
        found.append(random.uniform(first, last, count))
    return found


def _trial(
    maker: Maker,
    shape: Shape,
    grams: tuple[Gram, ...],
    expansion: Mapping[str, Vector],
    words: tuple[str, ...],
) -> Trial:
    known = list(expansion)
    turn = np.zeros((len(known), len(words)))
    for column, word in enumerate(words):
        turn[known.index(word), column] = 1.0
    mine = tuple(gram.form(turn) for gram in grams)
    found = regress(mine, [np.zeros((len(words), len(words)))], maker.declared)
    coefficients = np.column_stack([expansion[word] for word in words])
    return Trial(shape, mine, found, coefficients, words)
