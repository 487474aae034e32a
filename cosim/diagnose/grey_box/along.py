"""Laws at a place to first order along the motion of the log.

Where a model is far off, what a law does to it says nothing of what it does to the machine. So an
effort u(t) at the place moves the model along the log (`following`); if what is missing acts there,
the effort is the law, whatever it is called. Coefficients of laws are simulated one by one there,
so small that they hardly move anything, and the law that takes the effort's place follows:

    terms     f(x) of one signal, a few of them
    curves    a smooth curve of one signal, with a jump at 0
    pairs     f(x) g(y) of two signals, a few of them

They are compared by what runs gain that were left out.

Not modelled: see `fitted_law`; smooth surfaces, of whose 104 coefficients no run tells all.

Source: sparse regression of dynamics (Brunton, Proctor, Kutz, PNAS 113, 2016).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from ...errors import CosimError
from ..directions import AIM, LARGE, SMALL, TRIALS, Responses
from ..following import follow
from ..localise import TIME
from ..secant import model_values
from .basis import Shape
from .bench import ANGLES, DENSE, LawBench
from .regression import Gram, regress
from .terms import HARMONICS, POINTS, images, promised, selected, spread
from .trial import Maker, Trial

Vector = NDArray[np.float64]
FINE = 0.01
"""Share of a signal's largest size around which knots are dense, too: friction falls that near
to 0, where drag needs knots far from it."""
ORDERS = 16
"""Cycles per turn that are tried for laws of an angle at most."""
FIRST = 1e-3
"""Strength of a law that is tried first, in the unit of its place; any that shows is the next."""


class Along:
    """Asks laws at a place.

    Args:
        maker: of laws there; its signals' ranges grow to what the log visits.

    Attributes:
        left: mean square over the noise's that an effort there leaves, None if it takes none: far
            more than elsewhere where what is missing does not act.

    Raises:
        CosimError: the system with an effort there cannot be simulated.
    """

    def __init__(self, maker: Maker) -> None:
        self.maker, search, site = maker, maker.search, maker.bench.site
        base = maker.bench.base
        theta, place = base.estimate.theta, (site.instance, site.port)
        followed = follow(base.simulator, theta, search.fitting, place, (), site.element)
        self.left = followed.left if followed.places else None
        self._weight = 1.0 / max(followed.left, 1.0)
        self.responses = Responses(followed, search.fitting)
        moved = replace(base, estimate=replace(base.estimate, simulator=followed.simulator))
        self.bench = LawBench(search, moved, site, search.fitting.names)
        self.signals = [signal for signal in self.bench.varying if signal != TIME]
        for name, (low, high) in self.bench.ranges.items():
            first, last = maker.bench.ranges[name]
            maker.bench.ranges[name] = min(low, first), max(high, last)
        self.bench.ranges = maker.bench.ranges
        self._strength = FIRST
        self._terms: dict[str, NDArray[np.float32] | None] = {}

    def terms(self) -> list[Trial]:
        """The best terms of each signal, the best first.

        Raises:
            CosimError: the system with a law there cannot be simulated.
        """
        return self._selected(self._singles())

    def curves(self) -> list[Trial]:
        """Smooth laws of one signal, the best first.

        Raises:
            CosimError: the system with a law there cannot be simulated.
        """
        found = []
        for shape in self._singles(DENSE, FINE):
            columns = [self._change(shape, column) for column in shape.expansion.T]
            kept = [k for k, column in enumerate(columns) if column is not None]
            if not kept:
                continue
            grams = self._grams([column for column in columns if column is not None])
            penalties = [p[np.ix_(kept, kept)] for p in shape.penalties()]
            result = regress(grams, penalties, self.maker.declared, shape.jumps[kept])
            found.append(Trial(shape, grams, result, shape.expansion[:, kept]))
        return sorted(found, key=lambda t: -t.expected)

    def pairs(self) -> list[Trial]:
        """The best terms of each two signals, the best first.

        Raises:
            CosimError: the system with a law there cannot be simulated.
        """
        shapes = []
        for first, second in permutations(self.signals, 2):
            x = self.bench.axis_x(first)
            if second in ANGLES:
                shapes.append(Shape("x * y", x, self.bench.axis_y(second, self._order)))
            shapes.append(Shape("x * y", x, self.bench.axis_y(second, 0)))
            if self.bench.crosses(second):
                shapes.append(Shape("x * y", x, self.bench.folded(second)))
        return self._selected(shapes)

    def share(self, trial: Trial) -> float:
        """Of what declared parameters leave beyond noise, what a law takes as well [1]."""
        total = np.sum([gram.matrix for gram in trial.grams], axis=0)
        prior, free = trial.regression.prior.whole, trial.expansion.shape[1]

        def left(first: int) -> float:
            used = slice(first, -1)
            inner, outer = total[used, used] + prior[first:, first:], total[used, -1]
            return float(total[-1, -1] - outer @ np.linalg.solve(inner, outer))

        without, noise = left(free), self._weight * self.responses.stack.size
        return (without - left(0)) / max(without - noise, 1e-300)

    def _singles(self, *widths: float) -> list[Shape]:
        found = []
        for signal in self.signals:
            axes = [self.bench.axis_x(signal, width) for width in widths or (DENSE,)]
            found += [Shape("x", x=axis) for axis in dict.fromkeys(axes)]
            if signal in ANGLES:
                orders = dict.fromkeys((1, self._order))
                found += [Shape("y", y=self.bench.axis_y(signal, order)) for order in orders]
        return found

    @cached_property
    def _order(self) -> int:
        """Cycles per turn of the angle that explain most."""
        best = 0.0, 1
        for order in range(1, ORDERS + 1):
            shape = Shape("y", y=self.bench.axis_y(ANGLES[0], order))
            words = self._asked(shape, 2)
            if len(words) == 2:
                grams = self._grams([c for w in words if (c := self._terms[w]) is not None])
                share = promised(grams, 2, self.maker.declared)([0, 1])
                best = max(best, (share, order), key=lambda item: item[0])
        return best[1] if best[1] > HARMONICS else 1

    def _selected(self, shapes: Iterable[Shape]) -> list[Trial]:
        found = []
        for shape in shapes:
            words = self._asked(shape)
            columns = [c for word in words if (c := self._terms[word]) is not None]
            if columns:
                found.append(selected(self.maker, shape, self._grams(columns), words))
        return sorted(found, key=lambda t: -t.expected)

    def _asked(self, shape: Shape, count: int | None = None) -> dict[str, Vector]:
        """Terms of a shape that show something, the first ones if a number is given."""
        found: dict[str, Vector] = {}
        for word, image in images(shape, *spread(shape, POINTS)).items():
            if len(found) == count:
                break
            column = shape.expansion @ image
            if word not in self._terms:
                self._terms[word] = self._change(shape, column)
            if self._terms[word] is not None:
                found[word] = column
        return found

    def _grams(self, changes: Sequence[NDArray[np.float32]]) -> tuple[Gram, ...]:
        """Inner products by run, residuals counted as if the noise were what the effort leaves."""
        stack, problem = self.responses.stack, self.maker.bench.base.problem
        table = np.column_stack([*changes, self.responses.declared, self.responses.followed.wanted])
        found = []
        for number, run in enumerate(stack.runs):
            mine = table[stack.run == number]
            own = np.array([p.run == run.name for p in problem.parameters])
            found.append(Gram(run.name, self._weight * mine.T @ mine, own, mine.shape[0]))
        return tuple(found)

    def _change(self, shape: Shape, column: Vector) -> NDArray[np.float32] | None:
        """Change of the model values by coefficients, per unit; None if they show nothing."""
        followed, stack, bench = self.responses.followed, self.responses.stack, self.bench
        most = float(np.max(np.abs(column)))
        size, shown, change = self._strength / most, 0.0, np.zeros(stack.size)
        problem = bench.shaped(shape, bench.directed(column[:, None], np.ones(1)))
        simulator = self.responses.simulator.of(problem).limited(bench.limits)
        for _ in range(TRIALS):
            try:
                values = model_values(simulator, np.append(followed.theta, size), stack)
                change = values - followed.model
                shown = stack.largest(change)
            except CosimError:  # too strong
                shown = np.inf
            if SMALL < shown < LARGE:
                break
            size *= float(np.clip(AIM / max(shown, 1e-12), 1e-3, 1e3))
        simulator.close()
        if not SMALL < shown < LARGE:
            return None
        self._strength = size * most
        return (change / size).astype(np.float32)
