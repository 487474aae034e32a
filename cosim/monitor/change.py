"""A change of a series of logs, and all that was found in one."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .patterns import Direction
from .profiles import Profile

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Change:
    """Something that is other than in the first logs.

    Attributes:
        direction: what, None for what no direction explains.
        profile: how.
        amounts: per column, in scales (per day for a creep); of a channel, of the logarithm of the
            mean square of what is left.
        deviations: of these.
        gain: log likelihood [nats].
        low, high: index of the first log that differs, at least and at most, 95 %.
        rivals: names that do as well.
        channel: where no direction explains it.
        p: chance under no change, corrected for all that was asked.
        fits: whether the name explains what changed.
        spread: variance over that of the model of scatter.
        size, half: of the change at its largest, in scales, and half its 95 % interval, from
            numbers per log whose scatter needs no model; None where calibration absorbs it.
    """

    direction: Direction | None
    profile: Profile
    amounts: Vector
    deviations: Vector
    gain: float
    low: int
    high: int
    rivals: tuple[str, ...] = ()
    channel: str = ""
    p: float = 0.0
    fits: bool = True
    spread: float = 1.0
    size: float | None = None
    half: float = 0.0

    @property
    def by_shape(self) -> bool:
        """Whether its name hangs on the shape of its pattern: of laws, and of what is late."""
        d = self.direction
        return d is not None and (d.kind == "effect" or d.quantity == "latency")

    @property
    def full(self) -> float:
        """Largest value of its profile."""
        return float(np.max(np.abs(self.profile.values)))


@dataclass
class Found:
    """All that detection found.

    Attributes:
        changes: by date.
        tests: how many were made.
        root: of the scatter of declared parameters between logs.
        own: values and deviations of each column by log, all changes but its own taken off.
        left: mean square over the noise by log and channel, declared parameters fitted per log.
        rest: the same with all changes taken off.
        alone: declared parameters whose successive logs are alike: name -> correlation.
    """

    changes: list[Change]
    tests: int
    root: Vector
    own: tuple[Vector, Vector]
    left: Vector
    rest: Vector
    alone: dict[str, float] = field(default_factory=dict)
