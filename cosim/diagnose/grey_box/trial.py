"""Laws of different shapes at one place, tried to first order and fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from ...calibrate.deferred import corrected
from ...calibrate.estimate import Estimate
from ...calibrate.fit import CORRECTION, Effort, fit
from ...calibrate.normal import BOUNDS
from ...calibrate.parts import Sensitivity
from ...calibrate.simulator import Simulator
from ...errors import CosimError
from ...system.variants import component
from ..candidates import Candidate
from ..models import GATE, Fitted, compare, is_open
from .basis import Shape
from .bench import EFFECT, LawBench
from .regression import Gram, Regression, integrated, regress

Vector = NDArray[np.float64]
DIRECTIONS = 20
"""Directions of the coefficients that are fitted at most, those that gain most first."""
GAINS = 0.5
"""Least gain of a direction that is fitted [nats]: what one parameter gains on noise."""
SHARES = (1.0, 0.5, 0.2, 0.05)
"""Of the law that first orders ask for, where a fit begins: whichever is best."""
SMALL = 1e-6
"""Share of a law that need not be kept."""
WIDE = 100.0
"""Span of a direction in its standard deviations: differences take a hundredth of it."""
NARROWER = (0.1, 1e-2, 1e-3)
"""Widths of the jump that are tried, over the usual one."""
QUICK = Effort("near", "draft", iterations=4)
FAR = Effort("far", "draft", iterations=4)

CONSTANT = "1"
"""The term that is one everywhere, as formulas name it."""


@dataclass(frozen=True)
class Trial:
    """A law to first order around a point.

    Attributes:
        shape: of the law.
        grams: of the runs, for the free coefficients, the residual being that of no law.
        regression: their values.
        expansion: the coefficients c by the free ones.
        words: name of each free coefficient of a law of named terms, () of a smooth one.
    """

    shape: Shape
    grams: tuple[Gram, ...]
    regression: Regression
    expansion: Vector
    words: tuple[str, ...] = ()

    @property
    def expected(self) -> float:
        """See `Regression.expected`."""
        return self.regression.expected


@dataclass(frozen=True)
class Law:
    """A fitted law.

    Attributes:
        trial: its shape, and what it came from.
        fitted: the model with it.
        directions: free coefficients (rows) by what was fitted (columns).
        rest: directions that were not fitted, each as long as its standard deviation.
    """

    trial: Trial
    fitted: Fitted
    directions: Vector
    rest: Vector

    @property
    def shape(self) -> Shape:
        """What it depends on."""
        return self.trial.shape

    @property
    def fits(self) -> slice:
        """Where what was fitted of it is among the model's parameters."""
        return slice(self.fitted.free - self.directions.shape[1], self.fitted.free)

    @property
    def free(self) -> Vector:
        """Free coefficients."""
        return np.asarray(self.directions @ self.fitted.estimate.theta[self.fits])

    @property
    def coefficients(self) -> Vector:
        """The 13 x 8 of the effect."""
        return np.asarray(self.trial.expansion @ self.free)

    @property
    def formula(self) -> str:
        """As a line of text: named terms with their numbers, or what kind of curve it is."""
        if not self.trial.words:
            kind = "surface" if self.shape.form == "x * y" else "curve"
            return f"smooth {kind} over {self.shape.label}"
        parts = [f"{value:+.4g}{f' {word}' * (word != CONSTANT)}"
                 for value, word in zip(self.free, self.trial.words, strict=True)]  # fmt: skip
        return " ".join(parts).removeprefix("+")

    @property
    def kind(self) -> str:
        """What it is a law of, for people."""
        return "a constant" if list(self.trial.words) == [CONSTANT] else (
            f"a law of {self.shape.label}"
        )  # fmt: skip

    def values(self, x: Vector, y: Vector, *, held: bool = False) -> tuple[Vector, Vector]:
        """The law at points, and its standard deviations there.

        Args:
            x, y: points.
            held: with all other parameters as they were fitted: what these could do as well is no
                uncertainty then.
        """
        design = self.design(x, y)
        if held:
            count = self.free.size
            precision = self.trial.regression.prior.law + np.sum(
                [gram.matrix[:count, :count] for gram in self.trial.grams], axis=0
            )
            variance = np.einsum("ij,ji->i", design, np.linalg.solve(precision, design.T))
            return design @ self.free, np.sqrt(variance)
        return design @ self.free, self.spread(design)

    def spread(self, turn: Vector) -> Vector:
        """Standard deviations of sums of the free coefficients.

        Args:
            turn: sums (rows) of the coefficients (columns).
        """
        covariance = self.fitted.estimate.covariance[self.fits, self.fits]
        known = turn @ self.directions
        variance = np.einsum("ij,jk,ik->i", known, covariance, known)
        return np.asarray(np.sqrt(variance + np.sum((turn @ self.rest) ** 2, axis=1)))

    def declared(self, scale: Vector) -> Vector:
        """What the directions that were not fitted add to the deviations of declared parameters.

        These go along with the law to where the data agree with both.

        Args:
            scale: of the parameters.
        """
        total = np.sum([gram.matrix for gram in self.trial.grams], axis=0)
        count = self.free.size
        *_, back = integrated(total, count, self.trial.regression.prior.declared)
        return np.asarray(scale * np.sqrt(np.sum((back[:, :count] @ self.rest) ** 2, axis=1)))

    def design(self, x: Vector, y: Vector) -> Vector:
        """Functions of the free coefficients (columns) at points."""
        columns = self.shape.design(x, y)
        return np.asarray(columns @ np.linalg.pinv(self.shape.expansion) @ self.trial.expansion)


def tempered(grams: Sequence[Gram]) -> list[Gram]:
    """The same with residuals that count as if the noise were as large as they are.

    Where a model is far off, first orders are wrong by a share of that; as if exact, they would ask
    for anything.
    """
    square = sum(float(g.matrix[-1, -1]) for g in grams)
    factor = min(sum(g.count for g in grams) / max(square, 1e-300), 1.0)
    return [replace(g, matrix=factor * g.matrix) for g in grams]


class Maker:
    """Tries and fits laws at a place.

    Args:
        bench: the model with a law there.
    """

    def __init__(self, bench: LawBench) -> None:
        self.bench = bench
        self.search = bench.search
        base = bench.base.problem
        self.count = len(base.parameters)
        self.declared = np.array(
            [(s / p.prior) ** 2 if p.prior else BOUNDS
             for s, p in zip(base.scale.tolist(), base.parameters, strict=True)]
        )  # fmt: skip

    def point(
        self, fitted: Fitted
    ) -> tuple[Vector, dict[str, Vector], list[Sensitivity], tuple[str, ...]]:
        """Declared parameters, residuals by run, derivatives and held parameters of a model."""
        rows = self.search.fitting.by_run(self.search.fit_data - fitted.fit)
        residual = dict(zip(self.search.fitting.names, rows, strict=True))
        slopes = []
        for item in fitted.estimate.jacobian:
            if item.run in residual:
                mine = item.columns < self.count
                slopes.append(
                    item._replace(columns=item.columns[mine], values=item.values[:, :, mine])
                )
        held = tuple(n for n in fitted.estimate.at_bound if n in self.bench.base.problem.names)
        return fitted.estimate.theta[: self.count], residual, slopes, held

    def tried(self, shape: Shape, around: Law, directions: Vector | None = None) -> Trial:
        """A law of a shape to first order around a fitted one.

        Args:
            shape: of the law.
            around: the fitted one, of the same shape.
            directions: of the free coefficients, all if not given.
        """
        theta, residual, slopes, held = self.point(around.fitted)
        now = around.coefficients
        directions = np.eye(shape.expansion.shape[1]) if directions is None else directions
        asked = shape.expansion @ directions
        grams = tempered(self.bench.grams(shape, asked, theta, now, residual, slopes, held))
        penalties = [directions.T @ p @ directions for p in shape.penalties()]
        jumps = np.any(directions[shape.jumps] != 0.0, axis=0)
        before = np.linalg.pinv(asked) @ now
        mine = tuple(gram.form(np.eye(asked.shape[1]), before) for gram in grams)
        return Trial(shape, mine, regress(mine, penalties, self.declared, jumps), asked)

    def fitted(self, trial: Trial, around: Law | None = None, *, final: bool = False) -> Law:
        """A law fitted through the FMU together with all declared parameters.

        Args:
            trial: where it begins.
            around: the law around which that was taken, if one.
            final: with intervals.

        Raises:
            CosimError: it cannot be simulated.
        """
        bench, base, regression = self.bench, self.bench.base, trial.regression
        precision = regression.prior.law
        values, vectors = eigh(regression.matrix, precision)
        values = np.maximum(values, 0.0)
        start = vectors.T @ precision @ regression.value
        gains = 0.5 * start**2 * (1.0 + values)
        order = np.argsort(-gains)
        kept = order[: max(min(DIRECTIONS, int(np.sum(gains > GAINS))), 1)]
        if trial.words:
            kept = order
        others = np.setdiff1d(order, kept)
        deviation = 1.0 / np.sqrt(1.0 + values)
        chosen = np.eye(order.size)[:, kept]
        if around is not None:  # what was fitted before can stay as it was
            now = vectors.T @ precision @ np.linalg.pinv(trial.expansion) @ around.coefficients
            missed = now - chosen @ (chosen.T @ now)
            if np.linalg.norm(missed) > SMALL * np.linalg.norm(now):
                chosen = np.column_stack([chosen, missed / np.linalg.norm(missed)])
        directions, widths = vectors @ chosen, 1.0 / np.sqrt(1.0 + values @ chosen**2)
        targets = trial.expansion @ directions
        problem = bench.shaped(trial.shape, bench.directed(targets, WIDE * widths))
        simulator = self.search.simulator.of(problem).limited(bench.limits)
        theta = (base if around is None else around.fitted).estimate.theta[: self.count]
        change = regression.declared * base.problem.scale
        if around is None:
            starts = [(theta + share * change, share * (start @ chosen)) for share in SHARES]
        else:
            starts = [(theta + change, start @ chosen), (theta, now @ chosen)]
        best = min(
            (np.clip(np.concatenate(pair), problem.lower, problem.upper) for pair in starts),
            key=lambda one: self.cost(simulator, one),
        )
        far = around is None and is_open(base.estimate)
        result = fit(simulator, best, effort=FAR if far else QUICK)
        if final:
            right = corrected(simulator, result.theta, self.search.raw)
            result = fit(right, result.theta, effort=CORRECTION)
        rest = vectors[:, others] * deviation[others]
        return Law(trial, self._judged(result), directions, rest)

    def around(self, law: Law, words: Sequence[str] = ()) -> Trial:
        """The same law to first order around where its fit has ended.

        Args:
            law: it.
            words: terms of a formula that are kept, all if none is given.
        """
        if not law.trial.words:
            return self.tried(law.shape, law)
        kept = [k for k, w in enumerate(law.trial.words) if not words or w in words]
        columns = law.trial.expansion[:, kept]
        again = self.tried(law.shape, law, np.linalg.pinv(law.shape.expansion) @ columns)
        known = regress(again.grams, [np.zeros((len(kept),) * 2)], self.declared)
        kept_words = tuple(law.trial.words[k] for k in kept)
        return replace(again, regression=known, words=kept_words)

    def exact(self, law: Law) -> Law:
        """The law fitted again where the errors of the communication step are those at its end."""
        estimate = law.fitted.estimate
        right = corrected(estimate.simulator, estimate.theta, self.search.raw)
        return replace(law, fitted=self._judged(fit(right, estimate.theta, effort=QUICK)))

    def visited(self, law: Law) -> list[Vector]:
        """x and y of a law along the identification runs."""
        theta = law.fitted.estimate.theta[: self.count]
        return self.bench.recorded(law.shape, theta, law.coefficients)

    def _judged(self, estimate: Estimate) -> Fitted:
        base, search = self.bench.base, self.search
        found = search.judged(estimate)
        found.effects = (*base.effects, self.candidate)
        found.gate = compare(search.check_data, base.check, found.check, search.checking)
        return found

    def sharper(self, law: Law) -> Law:
        """The law with the width of its jump that fits best.

        Friction that holds is one whose jump is steep; first orders around one that creeps do not
        lead there.
        """
        x = law.shape.x
        if x is None:
            return law
        estimate = law.fitted.estimate
        best, least = law, estimate.robust - GATE
        for jump in (x.jump * factor for factor in NARROWER):
            shape = replace(law.shape, x=replace(x, jump=jump))
            constants = {**estimate.problem.constants, **self.bench.constants(shape)}
            simulator = estimate.simulator.of(estimate.problem.changed(constants=constants))
            if self.cost(simulator, estimate.theta) > least:
                continue
            found = self._judged(fit(simulator, estimate.theta, effort=QUICK))
            if found.estimate.robust < least:
                best = Law(replace(law.trial, shape=shape), found, law.directions, law.rest)
                least = found.estimate.robust
        return best

    def cost(self, simulator: Simulator, theta: Vector) -> float:
        """Cost over the identification runs, infinite where they cannot be simulated."""
        try:
            return self.search.cost(simulator, theta)
        except CosimError:  # too strong to be simulated: a smaller share is tried
            return np.inf

    @property
    def candidate(self) -> Candidate:
        """The law as what was added to the model."""
        site = self.bench.site
        kind = component(self.bench.base.problem.instances[site.instance])
        return Candidate(site.instance, kind, EFFECT, site.port, "Law given by numbers.")
