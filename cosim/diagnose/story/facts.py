"""The facts of a diagnosis: its JSON, and how each of its numbers is printed.

Sentences and tables of a report print a fact by its path in the JSON and mark it with that path
(`data-fact`), so that whatever shows the same fact shows the same digits.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from ...display.html import Cell, Html, number, quantity, tag, text, unit
from ..whiteness import CALIBRATED


def place_in_words(place: str) -> str:
    """`load.left.axle` as "the axle of left of load"."""
    parts = [part.replace("_", " ") for part in reversed(place.split("."))]
    return " of ".join([f"the {parts[0]}", *parts[1:-1], *(f"the {p}" for p in parts[1:][-1:])])


def place_label(place: Mapping[str, Any]) -> str:
    """A place of the localisation as tables name it."""
    element = f"[{place['element']}]" if place["element"] else ""
    return f"{place['component']}.{place['port']}{element}"


def sentence(of: str) -> str:
    """A text without its full stop."""
    return of.strip().rstrip(".")


def inside(of: str) -> str:
    """A text as part of a sentence: its first letter small where the word is no name."""
    whole = sentence(of)
    named = {"Coulomb", "Stribeck", "PWM"}
    first = whole.partition(" ")[0]
    return whole if first in named or first.isupper() else whole[:1].lower() + whole[1:]


@dataclass(frozen=True)
class Facts:
    """What a diagnosis found.

    Attributes:
        table: as of `cosim diagnose --json`.
        signals: channel -> what it is in the model.
    """

    table: Mapping[str, Any]
    signals: Mapping[str, str] = field(default_factory=dict)

    def at(self, *path: str | int) -> Any:
        """The value at a path of the JSON."""
        found: Any = self.table
        for key in path:
            found = found[key]
        return found

    def places_in_words(self, effect: Mapping[str, Any]) -> str:
        """The place of an effect; with FMUs without sources, also where it would do the same."""
        others = effect.get("other_places", ()) if self.table.get("adapters") else ()
        places = [effect["place"], *(other.rpartition(" at ")[2] for other in others)]
        return " or ".join(dict.fromkeys(map(self.in_words, places)))

    def in_words(self, place: str) -> str:
        """A place in words; of an adapter at an FMU without sources, where that is."""
        instance = place.partition(".")[0]
        adapter = self.table.get("adapters", {}).get(instance)
        return str(adapter["where"]) if adapter else f"at {place_in_words(place)}"

    # -- printed ----------------------------------------------------------------------------------

    def _shown(self, printed: str, kind: str, path: Sequence[str | int], class_: str = "") -> Html:
        return tag(
            "span", printed, data_fact=f"{kind}: {' > '.join(map(str, path))}", class_=class_
        )

    def number(self, *path: str | int) -> Html:
        """A number at a path."""
        return self._shown(number(self.at(*path)), "number", path)

    def percent(self, *path: str | int) -> Html:
        """A share at a path."""
        return self._shown(f"{100.0 * self.at(*path):.1f} %", "percent", path)

    def ratio(self, *path: str | int) -> Html:
        """An error at a path, over its channel's noise."""
        return self._shown(f"{self.over_noise(*path):.2f}×", "ratio", path)

    def error_cell(self, *path: str | int) -> Cell:
        """An error with its ratio to the noise, as a cell."""
        value = self.at(*path)
        if value is None:
            return Cell("–")
        ratio = self.over_noise(*path)
        shown = text(number(value)) + " (" + self.ratio(*path) + ")"
        return Cell(Html(shown), ratio, "over" if ratio > CALIBRATED else "good")

    def value(self, *path: str | int) -> Html:
        """A parameter's value with its unit; the path leads to its entry."""
        entry = self.at(*path)
        of = entry.get("unit", "") or self.at(*path[:-1]).get("unit", "")
        return self._shown(quantity(entry["value"], of), "value", path)

    def interval(self, *path: str | int) -> Html:
        """A parameter's 95 % interval; "open" where the data say no more than the bounds."""
        return self._shown(interval(self.at(*path)), "interval", path)

    def over_noise(self, *path: str | int) -> float:
        """An error at `channels > NAME > ...` over the channel's noise."""
        error: float = self.at(*path)
        noise: float = self.at(*path[:2], "noise_rms") if path[0] == "channels" else self.at(
            *path[:4], "noise_rms")  # fmt: skip
        return error / noise if noise else float("nan")

    # -- what follows ------------------------------------------------------------------------------

    @property
    def verdict(self) -> str:
        """The verdict's name."""
        return str(self.table["verdict"])

    @property
    def effects(self) -> list[dict[str, Any]]:
        """The effects that were found."""
        return list(self.table["effects"])

    @property
    def rivals(self) -> list[list[Mapping[str, str]]]:
        """Other explanations that do as well: the effects of each that were not found."""

        def told(label: str) -> Mapping[str, str]:
            effect, _, place = label.partition(" at ")
            return {"effect": effect, "place": place, "text": effect.replace("_", " ")}

        return [[told(label) for label in item["effects"]] for item in self.table["alternatives"]]

    @cached_property
    def purpose(self) -> str:
        """The runs that judge: unused ones, or those that were fitted where there are no others."""
        rows = self.table["channels"].values()
        unused = any(row["before"]["validation"] is not None for row in rows)
        return "validation" if unused else "identification"

    @property
    def judged(self) -> bool:
        """Whether there are unused runs, which judge."""
        return self.purpose == "validation"

    @property
    def asked(self) -> bool:
        """Whether effects of the catalogue were looked for."""
        return bool(self.table.get("catalogue_asked", True))

    @property
    def runs_in_words(self) -> str:
        """The runs that judge."""
        return (
            "runs that were not used for fitting" if self.judged
            else "the fitted runs"
        )  # fmt: skip

    @cached_property
    def worst(self) -> str:
        """The channel that the declared model misses most, "" where nothing was simulated."""
        sizes = {
            name: row["before"][self.purpose] / row["noise_rms"]
            for name, row in self.table["channels"].items()
            if row["before"][self.purpose] is not None and row["noise_rms"]
        }
        return max(sizes, key=lambda name: sizes[name], default="")

    @property
    def left(self) -> list[str]:
        """Channels that hold more than noise in the end."""
        found = self.table["left"]
        return [name for name in self.table["channels"] if name in found]

    @property
    def errors(self) -> list[dict[str, str]]:
        """What makes the data useless."""
        return [f for f in self.table.get("findings", []) if f["severity"] == "error"]

    def concerned(self, finding: Mapping[str, str]) -> list[str]:
        """Channels that a finding on the data names: one, whatever its name, or several."""
        said = finding["column"]
        if said in self.signals:
            return [said]
        ends = r"(?:^|,\s*|\sand\s){}(?:$|,|\sand\s)"
        return [name for name in self.signals if re.search(ends.format(re.escape(name)), said)]

    def faulty_instances(self) -> dict[str, list[str]]:
        """Instance -> channels with a fault that are measured there."""
        found: dict[str, list[str]] = {}
        for name in dict.fromkeys(n for f in self.errors for n in self.concerned(f)):
            found.setdefault(self.signals[name].partition(".")[0], []).append(name)
        return found

    def main_parameter(self, effect: Mapping[str, Any]) -> str:
        """Name of an effect's strength, "" where it has no parameters."""
        entry = self.table["power"].get(f"{effect['effect']} at {effect['place']}", {})
        known = str(entry.get("parameter", "")).rpartition(".")[2]
        names = list(effect["parameters"])
        return known if known in names else next(iter(names), "")


def interval(entry: Mapping[str, Any]) -> str:
    """Both ends, and "open" if the data say no more than the bounds."""
    low, high = entry["ci95"]
    return f"{number(low)} to {number(high)}{'' if entry['identifiable'] else ', open'}"


def named_unit(of: str) -> str:
    """A unit in a column of its own."""
    return unit(of) or "–"


def misses(facts: Facts, which: str) -> Html:
    """How far a model is off, in its worst channel."""
    return facts.ratio("channels", facts.worst, which, facts.purpose)


def some(items: list[Html]) -> list[Html]:
    """Those that say something."""
    return [item for item in items if item]
