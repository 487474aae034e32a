"""What a recorder makes of a column: targets `column:gain:NAME`, `column:bias:NAME`,
`column:zero_drift:NAME` and, of an angle, `column:wave:NAME` with `column:cycles:NAME` and
`column:phase:NAME`.

    reading = (1 + error) truth + bias + rate (t - t_0),   column = reading + A sin(n reading + psi)

t_0 is the run's first sample.

Where a system takes a reading for the truth, since no sensor of it stands between, what is wrong
with that sensor is in the log only: no loop sees it, and nothing moves otherwise. An angle's
reading is wrong once per turn where a disc or a magnet is off its centre (a compass: beside iron),
twice where two windings of a resolver differ in size or are not square to each other.

The same quantity has two roles: declared, it is a parameter of the mapping; undeclared, it is the
effect `gain`, `bias`, `zero_drift` or `angle_ripple` at a column of the log (`Reading`).

Not modelled: further harmonics.

Source: textbook; Hanselman, Resolver signal requirements for high accuracy resolver-to-digital
conversion, IEEE Trans. Ind. Electron. 37(6), 1990.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from ..errors import UnknownNameError, listing
from ..spec.hints import NO_HINTS, SearchHints
from ..spec.units import Unit, parse, per_second
from .parts import BIAS, COLUMN, CYCLES, GAIN, PHASE, WAVE, ZERO_DRIFT, Parameter

if TYPE_CHECKING:
    from .problem import Problem

GAIN_REACH = 1.0
"""Greatest error of a gain: beyond it a column would have the other sign, or twice what is there,
which is no sensor's error but another column."""
TRIED_GAIN = 0.02
"""Error of a gain that is tried: sensors of currents and speeds are right to a few per cent."""
BIAS_REACH = 1000.0
"""Greatest bias, over the noise, and what a drift of the zero gains at most in the longest run:
where more shows, a column has another zero."""
GREATEST_WAVE, TRIED_WAVE = 1.0, 0.01
"""Amplitude of an angle's wave at most [rad], from which the reading goes back while the shaft goes
on, and the one that is tried: half a degree, of a disc some tenths of a millimetre off its centre.
"""
FEWEST, MOST_CYCLES, WINDING = 0.1, 200.0, 100.0
"""Cycles per turn, of the slow side of a gear or of all lines that an absolute track has, and the
phase [rad], which winds without changing anything."""
KINDS = (GAIN, BIAS, ZERO_DRIFT, WAVE, CYCLES, PHASE)
"""Errors of a column."""
UNITS = {GAIN: "1", CYCLES: "1", PHASE: "rad"}
"""Units of those that have not their channel's."""


@dataclass(frozen=True)
class Reading:
    """An error of a column of the log that nobody declared.

    Attributes:
        channel: the column.
        effect: `gain`, `bias` or `zero_drift`, as in the system, or `angle_ripple`.
    """

    channel: str
    effect: Literal["gain", "bias", "zero_drift", "angle_ripple"]

    def added_to(self, problem: Problem, prefix: str) -> Problem:
        """The problem with the error as a parameter, 0 at its nominal value.

        Args:
            problem: with this channel.
            prefix: of the parameter's name.
        """
        own = next(c for c in problem.channels if c.name == self.channel)

        def free(
            name: str, target: str, low: float, high: float, start: float = 0.0,
            span: float = 1.0, unit: str = "1", text: str = "", hints: SearchHints = NO_HINTS,
        ) -> Parameter:  # fmt: skip
            targets = ((COLUMN + target + self.channel, 1.0),)
            return Parameter(
                prefix + name, unit, start, low, high, targets, "effect",
                strength=target not in (CYCLES, PHASE), span=span, text=text, hints=hints,
            )  # fmt: skip

        if self.effect == "gain":
            added = [free("error", GAIN, -GAIN_REACH, GAIN_REACH, span=TRIED_GAIN,
                          text="relative error, 0 = absent")]  # fmt: skip
        elif self.effect == "bias":
            most = BIAS_REACH * own.sigma
            added = [free("bias", BIAS, -most, most, span=own.sigma, unit=own.unit,
                          text="constant error, 0 = absent")]  # fmt: skip
        elif self.effect == "zero_drift":
            span = own.sigma / max(float(run.times[-1] - run.times[0]) for run in problem.runs)
            most = BIAS_REACH * span
            added = [free("rate", ZERO_DRIFT, -most, most, span=span,
                          unit=per_second(own.unit) if own.unit else "",
                          text="error gained per time, 0 = absent")]  # fmt: skip
        else:
            most, tried = GREATEST_WAVE / own.angle, TRIED_WAVE / own.angle
            cycle = self._one_cycle(problem, own.angle)
            added = [
                free("A", WAVE, -most, most, span=tried, unit=own.unit,
                     text="amplitude of the error, 0 = absent"),
                free("n", CYCLES, FEWEST, MOST_CYCLES, start=1.0, text="cycles per turn",
                     span=cycle, hints=SearchHints(cycles=own.signal)),
                free("psi", PHASE, -WINDING, WINDING, unit="rad", text="phase at angle 0",
                     hints=SearchHints(mix="turn")),
            ]  # fmt: skip
        return problem.with_parameters([*problem.parameters, *added])

    def _one_cycle(self, problem: Problem, angle: float) -> float:
        """How much more cycles per turn are one cycle more in a run, of angles in so many rad."""
        column = [c.name for c in problem.channels].index(self.channel)
        turned = [np.nanmax(rows) - np.nanmin(rows) for run in problem.chosen("identification")
                  if np.isfinite(rows := run.data[:, column]).any()]  # fmt: skip
        most = max(turned, default=0.0)
        return 2.0 * math.pi / (most * angle) if most > 0.0 else 1.0


def recorded(parameters: Iterable[Parameter]) -> set[str]:
    """`gain:CHANNEL`, `bias:CHANNEL` and so on for what a parameter sets."""
    return {
        n.removeprefix(COLUMN) for p in parameters for n, _ in p.targets if n.startswith(COLUMN)
    }


def check_column(target: str, channels: Iterable[str], where: str) -> None:
    """Refuse an error of what is no channel.

    Raises:
        UnknownNameError: with the nearest names.
    """
    known = [kind + name for name in channels for kind in KINDS]
    if target.removeprefix(COLUMN) not in known:
        raise UnknownNameError(
            f"{where}: {target!r}: what a recorder makes of a column is told of a channel that is "
            f"measured; {listing([COLUMN + name for name in known], target)}"
        )


def column_unit(target: str, columns: Mapping[str, str]) -> Unit | None:
    """Of an error of a column; None where it hangs on its channel's, and nobody says that.

    Args:
        target: `column:KIND:NAME`.
        columns: unit of each channel that has one.
    """
    kind, _, name = target.removeprefix(COLUMN).partition(":")
    if kind + ":" in UNITS:
        return parse(UNITS[kind + ":"])
    unit = columns.get(name, "")
    if not unit:
        return None
    return parse(per_second(unit) if kind + ":" == ZERO_DRIFT else unit)
