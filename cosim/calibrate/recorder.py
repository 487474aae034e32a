"""What a recorder makes of a column: targets `column:gain:NAME` and `column:bias:NAME`.

    column = (1 + error) reading + bias

Where a system takes a reading for the truth, since no sensor of it stands between, what is wrong
with that sensor is in the log only: no loop sees it, and nothing moves otherwise.

The same quantity has two roles: declared, it is a parameter of the mapping; undeclared, it is the
effect `gain` or `bias` at a column of the log (`Reading`).

Source: textbook.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from ..errors import UnknownNameError, listing
from ..spec.units import Unit, parse
from .parts import BIAS, COLUMN, GAIN, Parameter

if TYPE_CHECKING:
    from .problem import Problem

GAIN_REACH = 1.0
"""Greatest error of a gain: beyond it a column would have the other sign, or twice what is there,
which is no sensor's error but another column."""
TRIED_GAIN = 0.02
"""Error of a gain that is tried: sensors of currents and speeds are right to a few per cent."""
BIAS_REACH = 1000.0
"""Greatest bias, over the noise: where more shows, a column has another zero."""


@dataclass(frozen=True)
class Reading:
    """A gain's error, or a bias, of a column of the log that nobody declared.

    Attributes:
        channel: the column.
        effect: `gain` or `bias`, as in the system.
    """

    channel: str
    effect: Literal["gain", "bias"]

    def added_to(self, problem: Problem, prefix: str) -> Problem:
        """The problem with the error as a parameter, 0 at its nominal value.

        Args:
            problem: with this channel.
            prefix: of the parameter's name.
        """
        if self.effect == "gain":
            name, unit, text = "error", "1", "relative error, 0 = absent"
            most, span, target = GAIN_REACH, TRIED_GAIN, COLUMN + GAIN + self.channel
        else:
            own = next(c for c in problem.channels if c.name == self.channel)
            name, unit, text = "bias", own.unit, "constant error, 0 = absent"
            most, span, target = BIAS_REACH * own.sigma, own.sigma, COLUMN + BIAS + self.channel
        error = Parameter(
            prefix + name, unit, 0.0, -most, most, ((target, 1.0),), "effect", strength=True,
            span=span, text=text,
        )  # fmt: skip
        return problem.with_parameters([*problem.parameters, error])


def recorded(parameters: Iterable[Parameter]) -> set[str]:
    """`gain:CHANNEL` and `bias:CHANNEL` for what a parameter sets."""
    return {
        n.removeprefix(COLUMN) for p in parameters for n, _ in p.targets if n.startswith(COLUMN)
    }


def check_column(target: str, channels: Iterable[str], where: str) -> None:
    """Refuse a gain or a bias of what is no channel.

    Raises:
        UnknownNameError: with the nearest names.
    """
    known = [kind + name for name in channels for kind in (GAIN, BIAS)]
    if target.removeprefix(COLUMN) not in known:
        raise UnknownNameError(
            f"{where}: {target!r}: a recorder's gain and bias are those of a channel that is "
            f"measured; {listing([COLUMN + name for name in known], target)}"
        )


def column_unit(target: str, columns: Mapping[str, str]) -> Unit | None:
    """Of a gain's error, or of a bias: that of its column, None where nobody says it.

    Args:
        target: `column:gain:NAME` or `column:bias:NAME`.
        columns: unit of each channel's column that has one.
    """
    name = target.removeprefix(COLUMN)
    if name.startswith(GAIN):
        return parse("1")
    unit = columns.get(name.removeprefix(BIAS), "")
    return parse(unit) if unit else None
