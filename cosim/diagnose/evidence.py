"""Evidence of sets of laws, not a sequence of winners.

With directions E of the laws and what all missing ones do together, w, both without what
calibration absorbs, a set S explains

    1/2 b_S^T G_S^-1 b_S  nats,    G = E^T E,  b = E^T w,

so the best of thousands of sets are known without a simulation, and a small law beside a hundred
times larger one is found. A law is linear in its strength, not in its shape: each shape of a law is
a direction of its own, and a set holds one shape of a law at most.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .directions import Direction

Vector = NDArray[np.float64]
WIDTH, NEXT = 40, 8
"""Sets of a size that are made larger, and by how many laws each, found among four times as many,
of which some would have to be negative. All single laws are. This takes seconds, fits minutes."""
ALONE = 1e-4
"""A direction of which less than this share is left by the others of a set adds nothing of its own:
responses are exact to about one in a hundred, in squares."""
SORTED, ALIKE = 60, 0.02
"""Sets of a size that are sorted into families, and the share of what they explain by which members
of one may differ: what first orders leave open."""
RIDGE = 1e-9
"""On the unit diagonal of G, so that equal directions can be solved for."""


@dataclass(frozen=True)
class Chosen:
    """A set of laws.

    Attributes:
        members: numbers of their directions.
        values: factors on their columns, in the order of the members.
        gain: what they explain together [nats].
    """

    members: tuple[int, ...]
    values: tuple[Vector, ...]
    gain: float


class Evidence:
    """What sets of directions explain.

    Args:
        directions: of the laws.
        wanted: what is to be explained, without what calibration absorbs.
    """

    def __init__(self, directions: Sequence[Direction], wanted: Vector) -> None:
        self.directions = directions
        columns: list[Vector] = []
        self._place: list[list[int]] = []
        for one in directions:
            count = one.rest.shape[1]
            self._place.append(list(range(len(columns), len(columns) + count)))
            columns += list(one.rest.T.astype(np.float64))
        matrix = np.array(columns).reshape(len(columns), wanted.size)
        self._size = np.linalg.norm(matrix, axis=1)
        self._size[self._size == 0.0] = 1.0
        matrix /= self._size[:, None]
        self._gram, self._b = matrix @ matrix.T, matrix @ wanted

    def sets(self, most: int) -> list[list[Chosen]]:
        """The best sets of one law, of two, ...; one for each choice of laws.

        Args:
            most: laws in a set.
        """
        alone = [self.solved([m]) for m in range(len(self.directions))]
        level = sorted((c for c in alone if c is not None), key=lambda c: -c.gain)
        found = [self._distinct(level)]
        for size in range(2, most + 1):
            grown: dict[tuple[int, ...], Chosen] = {}
            for chosen in level if size == 2 else level[:WIDTH]:
                for one in self._larger(chosen):
                    grown[one.members] = one
            level = sorted(grown.values(), key=lambda c: -c.gain)
            found.append(self._distinct(level))
        return found

    def solved(self, members: Sequence[int]) -> Chosen | None:
        """A set with its best values; None if a law would have to be negative that cannot be."""
        members = sorted(members)
        index = [k for m in members for k in self._place[m]]
        gram = self._gram[np.ix_(index, index)] + RIDGE * np.eye(len(index))
        values = np.linalg.solve(gram, self._b[index])
        gain = 0.5 * float(self._b[index] @ values)
        values = values / self._size[index]
        parts, first = [], 0
        for m in members:
            part = values[first : first + len(self._place[m])]
            first += part.size
            probe = self.directions[m].probe
            if probe.mix != "turn" and probe.strength.minimum >= 0.0 and part[0] <= 0.0:
                return None
            parts.append(part)
        return Chosen(tuple(members), tuple(parts), gain)

    def families(self, level: Sequence[Chosen]) -> list[list[Chosen]]:
        """Sets that do nearly the same to the model values, the simplest first in each.

        Friction may be Coulomb's, or a bristle's, on either side of a gearbox: one of them shows
        whether the others are worth a fit.
        """
        found: list[list[Chosen]] = []
        for chosen in level[:SORTED]:
            near = (f for f in found if self._apart(chosen, f[0]) < ALIKE * chosen.gain)
            family = next(near, None)
            if family is None:
                found.append([chosen])
            else:
                family.append(chosen)
        return [sorted(family, key=self._parameters) for family in found]

    def _parameters(self, chosen: Chosen) -> int:
        return sum(self.directions[m].probe.own for m in chosen.members)

    def _apart(self, first: Chosen, second: Chosen) -> float:
        """Half the squared distance between what two sets do [nats]."""
        factors = np.zeros(self._b.size)
        for sign, chosen in ((1.0, first), (-1.0, second)):
            for m, values in zip(chosen.members, chosen.values, strict=True):
                factors[self._place[m]] += sign * values * self._size[self._place[m]]
        return 0.5 * float(factors @ self._gram @ factors)

    def _larger(self, chosen: Chosen) -> list[Chosen]:
        """A set with one law more, the best ones."""
        index = [k for m in chosen.members for k in self._place[m]]
        here = self._gram[np.ix_(index, index)] + RIDGE * np.eye(len(index))
        cross = self._gram[index]
        solved = np.linalg.solve(here, np.column_stack([cross, self._b[index]]))
        gram, b = self._gram - cross.T @ solved[:, :-1], self._b - cross.T @ solved[:, -1]
        taken = {self.directions[m].candidate for m in chosen.members}
        gains = np.zeros(len(self.directions))
        for m, place in enumerate(self._place):
            part = gram[np.ix_(place, place)]
            if self.directions[m].candidate in taken or part[0, 0] < ALONE:
                continue
            part = part + ALONE * np.eye(len(place))
            gains[m] = 0.5 * float(b[place] @ np.linalg.solve(part, b[place]))
        found = []
        for m in np.argsort(-gains, kind="stable")[: 4 * NEXT].tolist():
            one = self.solved([*chosen.members, m]) if gains[m] > 0.0 else None
            if one is not None:
                found.append(one)
        return found[:NEXT]

    def _distinct(self, level: Sequence[Chosen]) -> list[Chosen]:
        """The best shapes of each choice of laws."""
        best: dict[frozenset[str], Chosen] = {}
        for chosen in level:
            best.setdefault(
                frozenset(self.directions[m].candidate.label for m in chosen.members), chosen
            )
        return list(best.values())
