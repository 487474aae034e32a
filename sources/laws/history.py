"""The recent past of a signal: samples on a regular grid, read back by linear interpolation."""

from __future__ import annotations

import math
from typing import Any

import casadi as ca

from ..effect_model import EffectModel
from ..model import Model
from ..quantity import Quantity

SX = Any
NEVER, ONCE = 1e9, math.inf
"""Periods [s] of clocks that interrupt no solver: one that has nothing to do, and one that ticks at
the start of a run, whenever that is, and never again."""

PERIOD = Quantity(
    "period",
    "s",
    "shortest distance of the samples of the past",
    start=5e-4,
    minimum=1e-6,
    variability="fixed",
)


class History:
    """Keeps `slots` samples of a signal, `period` apart, and reads them back.

    At the first tick the past is filled with the signal's value then (with a straight line of
    slope `slope` through it), as if it had been so before.

    Args:
        m: where the samples are declared.
        name: prefix of the sampled values and name of the clock.
        value: the signal (scalar or column).
        unit: its unit.
        period: distance of the samples [s], an expression of fixed parameters.
        slots: number of samples; the memory reaches back `(slots - 1) * period`.
        slope: rate of the signal before the start.
    """

    def __init__(
        self,
        m: Model | EffectModel,
        name: str,
        value: SX,
        *,
        unit: str,
        period: SX,
        slots: int,
        slope: SX = 0.0,
    ) -> None:
        self._t = m.t
        self._value = ca.SX(value)
        self._period = period
        self._slope = slope
        self._count = int(self._value.numel())
        total = self._count * slots
        samples = m.discrete(
            Quantity(f"{name}_samples", unit, "past values, newest first", size=total)
        )
        self.since = m.discrete(Quantity(f"{name}_time", "s", "time of the newest sample"))
        self.started = m.discrete(Quantity(f"{name}_started", "1", "1 once the first is taken"))
        self._slots = [samples[k * self._count : (k + 1) * self._count] for k in range(slots)]
        clock = m.clock(name, period)
        initial = [self._value - slope * (k * period) for k in range(slots)]
        shifted = [self._value, *self._slots[:-1]]
        m.update(
            clock,
            samples,
            ca.if_else(self.started > 0.5, ca.vertcat(*shifted), ca.vertcat(*initial)),
        )
        m.update(clock, self.since, m.t)
        m.update(clock, self.started, ca.SX(1.0))

    def at(self, delay: SX) -> SX:
        """The signal `delay` seconds ago (0 to `(slots - 1) * period`); `delay` 0 is the present.

        Between the newest sample and the present it is interpolated too.
        """
        elapsed = self._t - self.since
        age = delay - elapsed
        index = ca.fmin(ca.fmax(age / self._period, 0.0), len(self._slots) - 1.0)
        past = ca.SX.zeros(self._count)
        for k, slot in enumerate(self._slots):
            past += slot * ca.fmax(0.0, 1.0 - ca.fabs(index - k))
        newest = self._slots[0]
        share = ca.fmin(1.0, ca.fmax(0.0, -age) / ca.fmax(elapsed, 1e-12))
        recent = newest + share * (self._value - newest)
        recorded = ca.if_else(age < 0.0, recent, past)
        before = self._value - self._slope * delay
        return before + self.started * (recorded - before)
