"""Clocks of channels that are late by what is estimated: targets `clock:CHANNEL` of a parameter."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import UnknownNameError, listing
from .parts import CLOCK, Channel, Parameter

if TYPE_CHECKING:
    from .estimate import Estimate

Vector = NDArray[np.float64]


def check_clock(target: str, channels: Iterable[str], where: str) -> None:
    """Refuse the clock of a channel that does not exist.

    Raises:
        UnknownNameError: with the nearest names.
    """
    name = target.removeprefix(CLOCK)
    if name not in channels:
        raise UnknownNameError(
            f"{where}: {target!r}: there is no channel {name!r} that is measured; "
            f"{listing(channels, name)}"
        )


def clocked(parameters: Iterable[Parameter]) -> set[str]:
    """Channels whose clock a parameter sets."""
    return {n.removeprefix(CLOCK) for p in parameters for n, _ in p.targets if n.startswith(CLOCK)}


def offsets(estimate: Estimate) -> dict[str, dict[str, Any]]:
    """How late clocks were found to be, by the name of the parameter."""
    return {
        p.name: {
            "value": float(estimate.theta[i]),
            "ci95": [float(estimate.low[i]), float(estimate.high[i])],
            "unit": p.unit,
            "identifiable": bool(estimate.identifiable[i]),
            "at_bound": p.name in estimate.at_bound,
        }
        for i, p in enumerate(estimate.problem.parameters)
        if clocked([p])
    }


def bounds(parameters: Iterable[Parameter], run: str) -> dict[str, tuple[float, float]]:
    """Least and greatest lateness [s] of the clocks of a run, by channel."""
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

    Else the number of residuals would depend on what is estimated.

    Args:
        times: of the samples [s].
        data: one column per channel.
        channels: of the columns.
        late: bounds of the lateness, by channel.
        begin: of the simulation [s].
    """
    data = data.copy()
    for index, channel in enumerate(channels):
        if channel.name in late:
            low, high = late[channel.name]
            out = (times - high < begin) | (times - low > times[-1])
            data[out, index] = np.nan
    return data
