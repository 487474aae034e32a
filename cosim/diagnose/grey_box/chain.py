"""From a place to a law: which signals carry it, how, and whether unused runs want it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..models import LEVEL, Fitted
from ..search import Search
from .basis import Shape
from .bench import ANGLES, LawBench, Site
from .trial import Law, Maker, Trial

DENSE = 0.03
"""Share of the largest speed around which knots are dense at 0, where they are: friction rises and
falls there, and drag far from it."""
ORDERS = 24
"""Cycles per turn that are tried for laws of an angle at most."""
CROSSED = 0.05
"""Share of a signal's largest size that it must reach on both sides of 0 to have a 0 within."""


def law_at(search: Search, base: Fitted, place: Site, say: Callable[[str], None]) -> Law | None:
    """The law that the data want at a place, None if unused runs want none.

    Args:
        search: the data.
        base: fitted model that lacks it.
        place: where.
        say: told what is done.

    Raises:
        CosimError: no law can enter there.
    """
    maker = Maker(LawBench(search, base, place))
    trials = singles(maker)
    if not trials:
        say(f"{place.label}: no signal there varies")
        return None
    trials.sort(key=lambda t: -t.expected)
    for trial in trials[:3]:
        say(f"{place.label}: a law of {trial.shape.label} gains {trial.expected:.0f} nats on "
            "runs left out, to first order")  # fmt: skip
    best = trials[0]
    needed = math.log(len(trials) / LEVEL)
    if best.expected < needed:
        return None
    law = maker.fitted(best)
    say(f"law of {best.shape.label} fitted: {_left(search, law)}")
    (again,) = maker.tried(law.shape, law)
    law = maker.fitted(again, law, final=True)
    say(f"law of {law.shape.label}: {_left(search, law)}")
    return law


def singles(maker: Maker) -> list[Trial]:
    """Laws of one signal of the place, to first order."""
    bench, found = maker.bench, []
    for signal in bench.signals:
        low, high = bench.ranges[signal]
        if not high - low > 1e-9 * max(abs(low), abs(high), 1e-9):
            continue
        shapes = []
        if signal in ANGLES:
            shapes.append(Shape("y", y=bench.axis_y(signal)))
        else:
            shapes.append(Shape("x", x=bench.axis_x(signal)))
            if min(-low, high) > CROSSED * max(-low, high):
                shapes.append(Shape("x", x=bench.axis_x(signal, dense=DENSE)))
        for shape in shapes:
            found += maker.tried(shape)
    return found


def _left(search: Search, law: Law) -> str:
    fitted = law.fitted
    assert fitted.gate is not None
    size = float(np.sqrt(np.mean((search.check_data - fitted.check) ** 2)))
    return (
        f"unused runs gain {fitted.gate.gain:.0f} nats (z {fitted.gate.z:.1f}), "
        f"{size:.2f} times the noise left"
    )
