"""Clocks of a log's columns that are late by what is estimated: targets `clock:NAME`.

A late clock stamps t what was there at t - late. For a channel the comparison is shifted: it reads
the simulated signal at t - late. A column that drives an input is read at t + late, so a late
sensor that drives the model needs no future of the model. Both may be negative.

A channel's clock that runs slow becomes later all the time: `clock:drift:NAME` is how much, per
time since the first sample. Of two clocks that drift apart one is taken to be right, that of what
drives the model; where it is the other, the drift has the other sign.

The same quantity has two roles: declared, it is a parameter of the mapping; undeclared, it is the
effect `delay`, or `clock_skew`, at a column of the log (`Shift`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import UnknownNameError, listing
from ..spec.hints import SearchHints
from ..spec.units import Unit, parse
from .parts import CLOCK, DRIFT, Channel, Parameter

if TYPE_CHECKING:
    from .estimate import Estimate
    from .problem import Problem

Vector = NDArray[np.float64]
LONGEST, PART = 0.5, 0.25
"""Longest delay that is looked for [s]: messages of robots are no older; and the share of the
shortest run that it may be, lest hardly anything is left to compare."""
SHORTEST, APART = 2e-3, 1.5
"""Shortest delay that is tried on its own [s], and the factor from one to the next: between two, a
signal of 1 / (pi delay) still keeps a cosine of 0.9 with what is tried."""


@dataclass(frozen=True)
class Shift:
    """A delay of columns of the log that nobody declared, of either sign.

    Attributes:
        channels: that read what was there so much earlier.
        inputs: driven inputs that follow their columns so much later; negative where the columns
            themselves are late.
        grows: whether the clock of the channels drifts instead: it is right when a run begins.
    """

    channels: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    grows: bool = False

    def added_to(self, problem: Problem, prefix: str) -> Problem:
        """The problem with the delay, or drift, as a parameter, 0 at its nominal value.

        Args:
            problem: with these channels and inputs.
            prefix: of the parameter's name.
        """
        shortest = min(float(run.times[-1] - run.times[0]) for run in problem.runs)
        reach = min(LONGEST, PART * shortest)
        count = max(1, math.ceil(math.log(reach / SHORTEST) / math.log(APART)))
        sizes = [SHORTEST * (reach / SHORTEST) ** (k / count) for k in range(count + 1)]
        if self.grows:
            return self._drifting(problem, prefix, sizes)
        targets = [(CLOCK + name, 1.0) for name in self.channels]
        targets += [(CLOCK + name, -1.0) for name in self.inputs]
        # held commands act at ticks of a rig that has them
        lattice = problem.search.step if self.inputs and problem.tick else 0.0
        hints = SearchHints(tries=(*(-d for d in sizes), *sizes), lattice=lattice)
        delay = Parameter(
            prefix + "t_d", "s", 0.0, -reach, reach, tuple(targets), "effect", strength=True,
            span=5.0 * SHORTEST, text="delay, 0 = absent", hints=hints,
        )  # fmt: skip
        return problem.with_parameters([*problem.parameters, delay])

    def _drifting(self, problem: Problem, prefix: str, sizes: list[float]) -> Problem:
        """The problem with a clock that has become as late as `sizes` when the longest run ends."""
        longest = max(float(run.times[-1] - run.times[0]) for run in problem.runs)
        rates = [size / longest for size in sizes]
        skew = Parameter(
            prefix + "skew", "1", 0.0, -rates[-1], rates[-1],
            tuple((CLOCK + DRIFT + name, 1.0) for name in self.channels), "effect", strength=True,
            span=5.0 * rates[0], text="time lost per time, 0 = absent",
            hints=SearchHints(tries=(*(-r for r in rates), *rates)),
        )  # fmt: skip
        return problem.with_parameters([*problem.parameters, skew])


def check_clock(target: str, channels: Iterable[str], inputs: Iterable[str], where: str) -> None:
    """Refuse the clock of what is neither a channel nor a driven input, drifts of inputs too.

    Raises:
        UnknownNameError: with the nearest names.
    """
    name = target.removeprefix(CLOCK)
    known = [*channels, *inputs]
    if name.startswith(DRIFT):
        name, known = name.removeprefix(DRIFT), list(channels)
        if name not in known:
            raise UnknownNameError(
                f"{where}: {target!r}: there is no channel {name!r} that is measured; of two "
                f"clocks that drift apart, state that of the channels; {listing(known, name)}"
            )
    if name not in known:
        raise UnknownNameError(
            f"{where}: {target!r}: there is no channel {name!r} that is measured, and no input of "
            f"this name that a column drives; {listing(known, name)}"
        )


def clock_unit(target: str) -> Unit:
    """Of a lateness, or of a drift."""
    return parse("1" if target.startswith(CLOCK + DRIFT) else "s")


def clocked(parameters: Iterable[Parameter]) -> set[str]:
    """Channels and inputs whose clock a parameter sets, and `drift:CHANNEL`."""
    return {n.removeprefix(CLOCK) for p in parameters for n, _ in p.targets if n.startswith(CLOCK)}


def offsets(estimate: Estimate) -> dict[str, dict[str, Any]]:
    """How late declared clocks were found to be, by the name of the parameter."""
    return {
        p.name: {
            "value": float(estimate.theta[i]),
            "ci95": [float(estimate.low[i]), float(estimate.high[i])],
            "unit": p.unit,
            "identifiable": bool(estimate.identifiable[i]),
            "at_bound": p.name in estimate.at_bound,
        }
        for i, p in enumerate(estimate.problem.parameters)
        if clocked([p]) and p.role != "effect"
    }


def bounds(parameters: Iterable[Parameter], run: str) -> dict[str, tuple[float, float]]:
    """Least and greatest lateness [s] of the clocks of a run, by channel or input.

    Drifts are `drift:CHANNEL`, per time.
    """
    found: dict[str, tuple[float, float]] = {}
    for p in parameters:
        if p.run not in ("", run):
            continue
        low, high = p.set(p.minimum), p.set(p.maximum)
        for name in low:
            if name.startswith(CLOCK):
                ends = low[name], high[name]
                found[name.removeprefix(CLOCK)] = min(ends), max(ends)
    return found


def masked(
    times: Vector,
    data: Vector,
    channels: Sequence[Channel],
    late: Mapping[str, tuple[float, float]],
    begin: float,
) -> Vector:
    """Measured values without those that a late clock may move out of what is simulated.

    Else the number of residuals would depend on what is estimated. Where a column that drives an
    input is late, nothing counts once it has ended.

    Args:
        times: of the samples [s].
        data: one column per channel.
        channels: of the columns.
        late: bounds of the lateness, by channel or input, and of drifts.
        begin: of the simulation [s].
    """
    data = data.copy()
    names = {name for c in channels for name in (c.name, DRIFT + c.name)}
    ahead = max((high for name, (_, high) in late.items() if name not in names), default=0.0)
    data[times + ahead > times[-1]] = np.nan
    for index, channel in enumerate(channels):
        if {channel.name, DRIFT + channel.name} & late.keys():
            low, high = late.get(channel.name, (0.0, 0.0))
            least, most = late.get(DRIFT + channel.name, (0.0, 0.0))
            since = times - times[0]
            out = (times - high - most * since < begin) | (times - low - least * since > times[-1])
            data[out, index] = np.nan
    return data
