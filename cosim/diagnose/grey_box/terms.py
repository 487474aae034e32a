"""A formula of few named terms instead of a smooth law, where it does as well.

Terms are written in the functions of the smooth law (each is a direction of its coefficients), so
that their likelihood comes from the same Gram matrices and the same FMU carries them. They are
added one by one after the first two, those first by which runs that are left out gain most.

Source: forward selection (Miller, Subset Selection in Regression, 2002).
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..models import GATE
from .basis import Axis, Shape
from .regression import regress
from .trial import Law, Maker, Trial

Vector = NDArray[np.float64]
Term = Callable[[Vector, Vector], Vector]
MOST = 5
"""Terms of a formula at most."""
EXACT = 0.02
"""Share of a term by which its image in splines may differ from it, in RMS over the runs: beside
the law's own uncertainty, less is not seen."""
HARMONICS = 3
"""Multiples of an angle's cycles that are terms: as many as its splines follow."""
POINTS = 4000
"""Points along the runs at which terms are compared with their images."""


def library(shape: Shape) -> dict[str, Term]:
    """Terms for a shape: word -> function of x and y."""
    found: dict[str, Term] = {"1": lambda x, y: np.ones_like(x)}
    if shape.x is not None:
        found |= _of_x(shape.x)
    if shape.y is not None:
        found |= _of_y(shape.y)
    if shape.form == "x * y" and shape.x is not None and shape.y is not None:
        name, jump = shape.x.signal, _of_x(shape.x)[f"sign({shape.x.signal})"]
        others = _of_y(shape.y)
        if not shape.y.turn:
            others[f"|{shape.y.signal}|"] = lambda x, y: np.abs(y)
        for word, term in others.items():
            found[f"{word} sign({name})"] = _product(term, jump)
            found[f"{word} {name}"] = _product(term, lambda x, y: x)
    return found


def _product(first: Term, second: Term) -> Term:
    return lambda x, y: first(x, y) * second(x, y)


def _of_x(axis: Axis) -> dict[str, Term]:
    name = axis.signal
    return {
        name: lambda x, y: x,
        f"{name} |{name}|": lambda x, y: x * np.abs(x),
        f"{name}^3": lambda x, y: x**3,
        f"sign({name})": lambda x, y: np.tanh(x / axis.jump),
    }


def _of_y(axis: Axis) -> dict[str, Term]:
    if not axis.turn:
        return {axis.signal: lambda x, y: y}
    found: dict[str, Term] = {}
    cycles = round(2.0 * np.pi / axis.range)
    for n in (cycles * (k + 1) for k in range(HARMONICS)):
        word = axis.signal if n == 1 else f"{n} {axis.signal}"
        found[f"cos({word})"], found[f"sin({word})"] = _wave(n, 0.5 * np.pi), _wave(n, 0.0)
    return found


def _wave(cycles: int, ahead: float) -> Term:
    return lambda x, y: np.sin(cycles * y + ahead)


def formula(maker: Maker, law: Law, around: Trial) -> Trial | None:
    """A formula that does as well as a smooth law to first order, None if there is none.

    Args:
        maker: of laws.
        law: the smooth one.
        around: the same shape to first order around it.
    """
    seen = [values[:: max(values.size // POINTS, 1)] for values in maker.visited(law)]
    # a term holds where no fitted run goes, too
    ends = zip(seen, _spread(law.shape, seen), strict=True)
    x, y = (np.concatenate([values, more]) for values, more in ends)
    design = law.shape.design(x, y)
    images: dict[str, Vector] = {}
    for word, term in library(law.shape).items():
        values = term(x, y)
        image = np.asarray(np.linalg.lstsq(design, values, rcond=1e-9)[0], np.float64)
        size = float(np.sqrt(np.mean(values**2)))
        if size > 0.0 and np.sqrt(np.mean((design @ image - values) ** 2)) < EXACT * size:
            images[word] = image
    best: Trial | None = None
    words: tuple[str, ...] = ()
    while len(words) < min(MOST, len(images)):
        more: list[tuple[str, ...]] = [(w,) for w in images if w not in words]
        if not words:  # a declared parameter may undo much of one term, and only two make sense
            more += list(combinations(images, 2))
        trials = [_trial(maker, around, images, (*words, *w)) for w in more]
        first = max(trials, key=lambda t: t.expected - GATE * len(t.words))
        if best is not None and first.expected < best.expected + GATE:
            break
        best, words = first, first.words
    if best is None or best.expected < around.expected - GATE:
        return None
    return best


def _spread(shape: Shape, seen: list[Vector]) -> list[Vector]:
    """As many points all over the ranges of a law's signals, in no order."""
    random, found = np.random.default_rng(0), []
    for axis, values in zip((shape.x, shape.y), seen, strict=True):
        first, last = (axis.first, axis.last) if axis else (0.0, 0.0)
        found.append(random.uniform(first, last, values.size))
    return found


def _trial(maker: Maker, around: Trial, images: dict[str, Vector], words: tuple[str, ...]) -> Trial:
    turn = np.column_stack([images[word] for word in words])
    grams = tuple(gram.form(turn) for gram in around.grams)
    found = regress(grams, [np.zeros((len(words), len(words)))], maker.declared)
    return Trial(around.shape, grams, found, around.shape.expansion @ turn, words)
