"""Numbers among the entries of a run or a rig sheet."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..errors import ScenarioError, listing
from ..reading.schema import shown
from .columns import ITEM


def lookup(values: Mapping[str, Any], key: str, where: str) -> float:
    """A number among entries; `key` may be an element, `initial_pose[0]`.

    Raises:
        ScenarioError: there is none.
    """
    match = ITEM.fullmatch(key)
    if match is None or match["key"] not in values:
        raise ScenarioError(f"{where}: there is no entry {key!r}; {listing(values, key)}")
    value = values[match["key"]]
    try:
        return float(value[int(match["index"])] if match["index"] else value)
    except (TypeError, ValueError, IndexError, OverflowError):
        raise ScenarioError(
            f"{where}: entry {key!r} is no number, it reads {shown(value)}; name an element as "
            f"{match['key']}[0]"
        ) from None
