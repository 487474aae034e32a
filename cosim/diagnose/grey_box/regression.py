"""Which law do responses ask for, how smooth is it, and does it hold in runs it was not made from?

Everything is decided on Gram matrices of the runs, whose columns are the model's responses to the
coefficients of a law, its derivatives by all declared parameters, and the residual, all over sigma.
Coefficients have the prior

    c ~ N(0, t^2 (1 - 0.99 Q + sum_a rho_a D_a' D_a)^-1)

(D_a: second differences along axis a; Q: onto constants, slopes and jumps, which these do not see,
so that they are known ten times less well beforehand: what declared parameters do as well is left
to what the sheet says of those). Size t and smoothness rho are those of greatest evidence.

Source: MacKay, Neural Computation 4, 1992 (evidence); Eilers and Marx, Statistical Science 11, 1996
(splines with a penalty on differences).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, eigh

Vector = NDArray[np.float64]
SMOOTH = (0.0, 0.1, 1.0, 10.0, 1e2, 1e3, 1e4)
"""Values of rho: from free coefficients to a straight line, but for what data insist on."""
STRAIGHT = 1e-9
"""Second differences of rounding, over the largest there are."""
ABSENT = 1e6
"""Precision of jumps of a law that has none, over that of curves."""
FREE = 0.01
"""Precision of constants, slopes and jumps, over that of curves."""
SIZES = np.logspace(-3.0, 3.0, 25)
"""Of t, over the size at which the typical coefficient shows as much as the noise."""


@dataclass(frozen=True)
class Gram:
    """Inner products of one run.

    Attributes:
        run: its name.
        matrix: over the columns: law, declared parameters (scaled), residual.
        own: which of the declared parameters concern this run alone.
        count: residuals.
    """

    run: str
    matrix: Vector
    own: NDArray[np.bool_]
    count: int

    def form(self, expansion: Vector, at: Vector | None = None) -> Gram:
        """The same for a law's free coefficients.

        Args:
            expansion: of the law's columns by the free coefficients.
            at: coefficients of the law that the residual is one of; it becomes that of no law.
        """
        declared = self.own.size + 1
        columns = self.matrix.shape[0] - declared
        turn = np.zeros((columns + declared, expansion.shape[1] + declared))
        turn[:columns, : expansion.shape[1]] = expansion
        turn[columns:, expansion.shape[1] :] = np.eye(declared)
        if at is not None:
            turn[:columns, -1] = at
        return Gram(self.run, turn.T @ self.matrix @ turn, self.own, self.count)


@dataclass(frozen=True)
class Prior:
    """What is known beforehand.

    Attributes:
        law: precision of the free coefficients.
        declared: precision of the declared parameters, scaled, a diagonal.
        size, smooth: t and rho of the law's.
    """

    law: Vector
    declared: Vector
    size: float
    smooth: tuple[float, ...]

    @property
    def whole(self) -> Vector:
        """Of all columns but the residual."""
        count = self.law.shape[0]
        whole = np.diag(np.concatenate([np.zeros(count), self.declared]))
        whole[:count, :count] = self.law
        return whole


@dataclass(frozen=True)
class Regression:
    """Coefficients of greatest probability.

    Attributes:
        prior: with t and rho.
        matrix: information on the free coefficients, declared parameters integrated out.
        value, covariance: of the free coefficients.
        declared: change of the declared parameters that goes with them, scaled.
        evidence: log evidence against no law [nats].
        expected: log likelihood that runs gain which were left out one by one [nats]; `evidence`
            where there is one run only.
    """

    prior: Prior
    matrix: Vector
    value: Vector
    covariance: Vector
    declared: Vector
    evidence: float
    expected: float


def regress(
    grams: Sequence[Gram],
    penalties: Sequence[Vector],
    declared: Vector,
    jumps: NDArray[np.bool_] | None = None,
) -> Regression:
    """Coefficients of a law of one form.

    Args:
        grams: of the runs, columns of the law being its free coefficients.
        penalties: matrices D'D.
        declared: precision of the declared parameters, scaled.
        jumps: which coefficients are jumps; a law may be without.
    """
    total = np.sum([g.matrix for g in grams], axis=0)
    free = penalties[0].shape[0]
    matrix, vector, back = integrated(total, free, declared)
    evidence, prior = _evidence(matrix, vector, penalties, declared, jumps)
    factor = cho_factor(matrix + prior.law)
    value = cho_solve(factor, vector)
    expected = evidence
    if len(grams) > 1:
        with_law, without = (
            sum(_gain(held, total - held.matrix, prior, count) for held in grams)
            for count in (free, 0)
        )
        expected = with_law - without
    return Regression(
        prior, matrix, value, cho_solve(factor, np.eye(free)), back @ np.append(-value, 1.0),
        evidence, float(expected),
    )  # fmt: skip


def solved(grams: Sequence[Gram], known: Vector, declared: Vector) -> Vector:
    """Coefficients of greatest probability under a prior that is given.

    Args:
        grams: of the runs, columns of the law being its free coefficients.
        known: precision of these.
        declared: precision of the declared parameters, scaled.
    """
    total = np.sum([g.matrix for g in grams], axis=0)
    matrix, vector, _ = integrated(total, known.shape[0], declared)
    return np.asarray(cho_solve(cho_factor(matrix + known), vector))


def integrated(total: Vector, free: int, declared: Vector) -> tuple[Vector, Vector, Vector]:
    """A and b of the law without what declared parameters do, and these of [law, residual]."""
    inner = total[free:-1, free:-1] + np.diag(declared)
    outer = total[free:-1][:, [*range(free), -1]]
    back = np.linalg.solve(inner, outer) if declared.size else outer
    rest = total[np.ix_([*range(free), -1], [*range(free), -1])] - outer.T @ back
    return rest[:free, :free], rest[:free, -1], np.asarray(back, dtype=np.float64)


def _evidence(
    matrix: Vector,
    vector: Vector,
    penalties: Sequence[Vector],
    declared: Vector,
    jumps: NDArray[np.bool_] | None,
) -> tuple[float, Prior]:
    """Greatest log evidence over the priors [nats], and the prior that has it."""
    free = vector.size
    typical = 1.0 / np.sqrt(max(float(np.mean(np.diag(matrix))), 1e-300))
    best: tuple[float, Prior] | None = None
    kind, plain = np.linalg.eigh(np.sum(penalties, axis=0))
    plain = plain[:, kind < STRAIGHT * max(float(kind[-1]), 1.0)]
    known = np.eye(free) - (1.0 - FREE) * plain @ plain.T
    none = np.zeros(free) if jumps is None else ABSENT * jumps
    priors = [known] if jumps is None or not jumps.any() else [known, known + np.diag(none)]
    rough = [SMOOTH if penalty.any() else SMOOTH[:1] for penalty in penalties]
    for first, *smooth in product(priors, *rough):
        shape = first + sum(r * p for r, p in zip(smooth, penalties, strict=True))
        # in coordinates in which both matrices are diagonal, t costs nothing
        values, vectors = eigh(matrix, shape)
        values, turned = np.maximum(values, 0.0), vectors.T @ vector
        for size in SIZES * typical:
            grown = size**2 * values
            one = 0.5 * float(np.sum(turned**2 * size**2 / (1.0 + grown) - np.log1p(grown)))
            if best is None or one > best[0]:
                best = one, Prior(shape / size**2, declared, float(size), tuple(smooth))
    assert best is not None
    return best


def _gain(held: Gram, others: Vector, prior: Prior, free: int) -> float:
    """Log likelihood that a run gains by coefficients and declared parameters of the others.

    What concerns the run alone is fitted to it.

    Args:
        held: the run.
        others: sum of the matrices of the others.
        prior: of all.
        free: coefficients of the law that count, all or none of them.
    """
    first = prior.law.shape[0]
    used = np.arange(first if free == 0 else 0, others.shape[0] - 1)
    precision = prior.whole[np.ix_(used, used)]
    known = np.linalg.solve(others[np.ix_(used, used)] + precision, others[used, -1])
    own = np.zeros(others.shape[0] - 1, dtype=np.bool_)
    own[first:] = held.own
    own = own[used]
    known[own] = 0.0
    matrix, vector = held.matrix[np.ix_(used, used)], held.matrix[used, -1]
    rest = (vector - matrix @ known)[own]
    inner = matrix[np.ix_(own, own)] + precision[np.ix_(own, own)]
    fitted = 0.5 * float(rest @ np.linalg.solve(inner, rest)) if own.any() else 0.0
    return float(known @ vector - 0.5 * known @ matrix @ known) + fitted
