"""Lines of a stream: samples, the begin of a run, the end.

{"time": 0.001, "speed_set": 20.0, "speed": 19.8}      a sample: clock and columns
{"n": 7, "time": 0.007, "q": [0.1, null, 0.3]}         numbered; q_1, q_2 (a gap), q_3
{"run": {"initial_motor_angle": 1.73}}                 a run begins, with entries of its own
{"end": true}                                          the stream ends
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

NUMBER, RUN, END = "n", "run", "end"
"""Keys that are no columns."""


@dataclass(frozen=True)
class Sample:
    """What was measured at one time.

    Attributes:
        time: of the machine's clock [s].
        values: by column; gaps are NaN.
        number: of the message, None where messages are not numbered.
    """

    time: float
    values: Mapping[str, float]
    number: int | None = None


@dataclass(frozen=True)
class Begin:
    """A run begins.

    Attributes:
        values: its entries, as those of a `[[run]]`.
    """

    values: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class End:
    """The stream ends."""


def read_message(line: str | bytes, clock: str = "time") -> Sample | Begin | End:
    """The message in a line.

    Args:
        line: one JSON object.
        clock: name of the clock.

    Raises:
        ValueError: it is none; the text says why.
    """
    try:
        table = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"is no JSON ({error})") from None
    if not isinstance(table, dict):
        raise ValueError("is no JSON object")
    if END in table and table[END] is True:
        return End()
    if isinstance(table.get(RUN), dict):
        return Begin(table[RUN])
    if clock not in table:
        raise ValueError(f"has no {clock!r}, the clock")
    number = table.pop(NUMBER, None)
    if number is not None and (not isinstance(number, int) or isinstance(number, bool)):
        raise ValueError(f"{NUMBER} is {number!r}, no whole number")
    values: dict[str, float] = {}
    for name, item in table.items():
        items = {f"{name}_{i}": one for i, one in enumerate(item, 1)} if isinstance(
            item, list) else {name: item}  # fmt: skip
        for column, one in items.items():
            values[column] = _number(column, one)
    time = values.pop(clock)
    if not math.isfinite(time):
        raise ValueError(f"{clock} is {time}")
    return Sample(time, values, number)


def _number(column: str, item: Any) -> float:
    if item is None:
        return math.nan
    if isinstance(item, (int, float)):  # true and false count 1 and 0
        try:
            return float(item)
        except OverflowError:
            raise ValueError(f"{column} is too large") from None
    raise ValueError(f"{column} is {item!r}, no number")
