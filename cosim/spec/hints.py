"""Hints for whoever searches a parameter's value: an FMU carries them beside what FMI describes.

They lie in `extra/cosim/component.json`, one table of parameter -> value per kind of hint; a kind
that no parameter has is left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

Mix = Literal["", "turn", "shift"]


@dataclass(frozen=True)
class SearchHints:
    """What is known beforehand of how to find a parameter's value.

    Attributes:
        mix: how two simulations tell this parameter of a weak effect: `turn`, an angle (effect =
            strength * (cos * effect at 0 + sin * effect at pi/2)); `shift`, an offset
            (effect = strength * (effect at 0 + value * derivative)).
        tries: values that a search should try, where a model with another one tells nothing of the
            right one (cycles per revolution); for a strength, values near which fits begin.
        lattice: distance of the values at which the model is exact, 0 if it is everywhere (a held
            signal is delayed by whole samples; between, its steps are smeared).
        visits: output of the component among whose values along a run the right value is, for a
            parameter that tells nothing where it is wrong (where a patch lies).
    """

    mix: Mix = ""
    tries: tuple[float, ...] = ()
    lattice: float = 0.0
    visits: str = ""

    def __post_init__(self) -> None:
        if self.mix not in get_args(Mix):
            raise ValueError(f"hint mix = {self.mix!r} is none of 'turn', 'shift' and '' for none")

    def within(self, instance: str) -> SearchHints:
        """The hints in a system, where variables are named with their instance."""
        return replace(self, visits=f"{instance}.{self.visits}") if self.visits else self


NO_HINTS = SearchHints()
_TABLES = {"mix": "mixes", "tries": "tries", "lattice": "lattices", "visits": "visits"}


def to_json(hints: Mapping[str, SearchHints]) -> dict[str, dict[str, Any]]:
    """Tables of a component's JSON, of the hints by parameter."""
    tables = {}
    for hint, plural in _TABLES.items():
        entries = {name: value for name, item in hints.items() if (value := getattr(item, hint))}
        if entries:
            tables[plural] = entries
    return tables


def from_json(content: Mapping[str, Any]) -> dict[str, SearchHints]:
    """Hints by parameter, of a component's JSON; parameters without any are left out.

    Raises:
        ValueError: a table has a value that is none of its kind.
    """
    found: dict[str, dict[str, Any]] = {}
    for hint, plural in _TABLES.items():
        for name, value in content.get(plural, {}).items():
            kept = tuple(map(float, value)) if hint == "tries" else value
            found.setdefault(name, {})[hint] = kept
    return {name: SearchHints(**entries) for name, entries in found.items()}
