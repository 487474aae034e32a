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
            right one; for a strength, values near which fits begin.
        decades: smallest and largest value that nature has, for a parameter that may have any size
            between them (a time constant).
        cycles: output of the effect over which it repeats so many times per turn, for a parameter
            that counts whole cycles.
        lattice: distance of the values at which the model is exact, 0 if it is everywhere (a held
            signal is delayed by whole samples; between, its steps are smeared).
        visits: output of the component among whose values along a run the right value is, for a
            parameter that tells nothing where it is wrong (where a patch lies).
        times: parameter of the same effect with which it is multiplied, if little but the product
            shows (a mass, and where it sits).
    """

    mix: Mix = ""
    tries: tuple[float, ...] = ()
    decades: tuple[float, ...] = ()
    cycles: str = ""
    lattice: float = 0.0
    visits: str = ""
    times: str = ""

    def __post_init__(self) -> None:
        if self.mix not in get_args(Mix):
            raise ValueError(f"hint mix = {self.mix!r} is none of 'turn', 'shift' and '' for none")
        if self.decades and not (
            len(self.decades) == 2 and 0.0 < self.decades[0] < self.decades[1]
        ):
            raise ValueError(f"hint decades = {self.decades!r} is no pair 0 < smallest < largest")

    def within(self, instance: str, parameter: str) -> SearchHints:
        """The hints in a system, where variables are named with their instance.

        Args:
            instance: of the system.
            parameter: whose hints these are, as its FMU calls it.
        """
        own = f"{instance}.{parameter}".rpartition(".")[0]
        visits = f"{instance}.{self.visits}" if self.visits else ""
        return replace(self, visits=visits, cycles=f"{own}.{self.cycles}" if self.cycles else "")


NO_HINTS = SearchHints()
_TABLES = {"mix": "mixes", "tries": "tries", "decades": "decades", "cycles": "cycles",
           "lattice": "lattices", "visits": "visits", "times": "products"}  # fmt: skip
_LISTS = ("tries", "decades")


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
            kept = tuple(map(float, value)) if hint in _LISTS else value
            found.setdefault(name, {})[hint] = kept
    return {name: SearchHints(**entries) for name, entries in found.items()}
