"""What each direction gains with each way to change, beside changes that are known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..diagnose.models import GATE
from .amounts import Sums
from .patterns import Direction

Vector = NDArray[np.float64]


class Scored(NamedTuple):
    """A direction with a profile.

    Attributes:
        score: log likelihood over the model's, to compare directions by.
        direction, profile: indices.
    """

    score: float
    direction: int
    profile: int


@dataclass
class Gains:
    """Log likelihoods over what is known.

    Attributes:
        sums: they come from.
        directions: all.
        shapes: (profiles, logs).
        dates: per direction, by profile: over that of constants, to compare its dates by.
        chance: by direction and profile, what the best of many gains by chance.
    """

    sums: Sums
    directions: Sequence[Direction]
    shapes: Vector
    dates: list[Vector]
    chance: list[Vector]
    _scores: dict[tuple[int, int], float] = field(default_factory=dict)

    def score(self, direction: int, profile: int) -> float:
        """See `Scored`; 0 for what need not have changed, as it may as well be so always."""
        place = direction, profile
        if place not in self._scores:
            found = 0.0
            if self.dates[direction][profile] > GATE:
                found = self.sums.score(self.directions[direction].columns, self.shapes[profile])
                found -= float(self.chance[direction][profile])
            self._scores[place] = found
        return self._scores[place]

    def best(self, allowed: Callable[[Direction], NDArray[np.bool_]]) -> list[Scored]:
        """Each direction with its likeliest profile, the one with the best score first.

        Args:
            allowed: which profiles a direction may have.
        """
        found = []
        for index, direction in enumerate(self.directions):
            may = allowed(direction)
            if may.any():
                profile = int(np.argmax(np.where(may, self.dates[index], -np.inf)))
                found.append(Scored(self.score(index, profile), index, profile))
        return sorted(found, reverse=True)
