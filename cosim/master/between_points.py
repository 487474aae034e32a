"""What is recorded inside a long step: read off its begin, its middle and its end.

Continuous values are read off the parabola through the three, at x from 0 to 1. The middle of the
step before, at x = p < 0, makes it a cubic, which differs from the parabola by at most

    |f[p, 0, 1/2, 1]| / (12 sqrt(3)),    f[...] the third divided difference,

since |x (x - 1/2) (x - 1)| is 1/(12 sqrt(3)) at most. Without a step before (at the begin, after a
jump of an input) the straight line through both ends is compared with the middle, which asks for
more. Values that jump, truths, whole numbers and texts may not change in a step that is longer than
the communication step: those that are recorded would come late, those that are connected act late.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..system.system import System
from .extrapolation import continuous
from .plan import Layout

Vector = NDArray[np.float64]
LARGEST = 1.0 / (12.0 * 3.0**0.5)
"""Of |x (x - 1/2) (x - 1)| for x from 0 to 1."""


class Moment(NamedTuple):
    """All values of a run at one time."""

    values: Vector
    objects: NDArray[np.object_]


class BetweenPoints:
    """Recorded values inside steps, and how far they may be off.

    Args:
        system, layout: what is run.
        held: slots of connected outputs that jump.
        tolerance: relative error.
    """

    def __init__(
        self, system: System, layout: Layout, held: NDArray[np.int64], tolerance: float
    ) -> None:
        self._source, self._tolerance = layout.record_source, tolerance
        slots = layout.record_source.tolist()
        declared = [system.declaration(layout.names[slot]) for slot in slots]
        external = set(layout.external.tolist())  # change at the ends of steps only
        smooth = [
            slot not in external and continuous(variable)
            for slot, variable in zip(slots, declared, strict=True)
        ]
        self._smooth = np.array(smooth, dtype=np.bool_)
        self._curves = layout.record_source[self._smooth]
        self._jumps = np.union1d(layout.record_source[~self._smooth], held)
        self._nominal = np.array(
            [abs(v.nominal or 1.0) for v, known in zip(declared, smooth, strict=True) if known]
        )
        self._past: tuple[float, Vector] | None = None

    def forget(self) -> None:
        """There is no step before: at the begin, or after a jump."""
        self._past = None

    @property
    def memory(self) -> tuple[float, Vector] | None:
        """Middle of the step before: time [s] and continuous values."""
        return self._past

    @memory.setter
    def memory(self, past: tuple[float, Vector] | None) -> None:
        self._past = past

    def keep(self, time: float, middle: Moment) -> None:
        """Remember the middle of a step that was taken."""
        self._past = time, middle.values[self._curves]

    def error(
        self, begin: Moment, middle: Moment, end: Moment, whole: Vector, time: float, size: float
    ) -> float:
        """How far recorded values inside a step may be off, 1 at the tolerance; inf after a jump.

        Args:
            begin, middle, end: of the step, gone in two halves.
            whole: values at its end, gone at once.
            time: of its begin [s].
            size: of the step [s].
        """
        jumps = self._jumps
        for other in (middle, end):
            if (begin.values[jumps] != other.values[jumps]).any():
                return np.inf
            if any(begin.objects[slot] != other.objects[slot] for slot in jumps.tolist()):
                return np.inf
        if not self._curves.size:
            return 0.0
        first, half, last = (moment.values[self._curves] for moment in (begin, middle, end))
        if self._past is None:
            off = np.abs(half - 0.5 * (first + last))
        else:
            before = (self._past[0] - time) / size
            rise = (half - first) / 0.5
            bend = (rise - (first - self._past[1]) / -before) / (0.5 - before)
            off = np.abs(2.0 * (last - 2.0 * half + first) - bend) / (1.0 - before) * LARGEST
        scale = np.maximum(np.maximum(np.abs(first), np.abs(last)), self._nominal)
        errors = np.maximum(off, np.abs(last - whole[self._curves])) / (self._tolerance * scale)
        return float(errors.max()) if np.isfinite(errors).all() else np.inf

    def values(self, begin: Moment, middle: Moment, end: Moment, x: float) -> Vector:
        """Recorded values at a part `x` of a step, before their gains."""
        first, half, last = (moment.values[self._source] for moment in (begin, middle, end))
        curve = (
            first * ((2.0 * x - 1.0) * (x - 1.0))
            + half * (4.0 * x * (1.0 - x))
            + last * (x * (2.0 * x - 1.0))
        )
        return np.where(self._smooth, curve, first)
