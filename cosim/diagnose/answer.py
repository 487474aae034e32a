"""What a diagnosis says: the facts of its verdict, as sentence, tables and JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from .facts import Force, Law, Left, Value


@dataclass(frozen=True)
class Hint:
    """A set of laws near the data that cannot be named.

    Attributes:
        laws: with the strengths that they would take.
        explained: share of what the declared model leaves beyond noise.
        left: the channel that stays farthest above its noise, None if none does, or not known.
        why: why it is no name.
        rough: told by a first order alone.
    """

    laws: tuple[Law, ...]
    explained: float
    left: Left | None
    why: tuple[str, ...]
    rough: bool = False

    def __str__(self) -> str:
        sizes = ", ".join(f"{law.label} ({_size(law)})" for law in self.laws)
        text = f"{sizes} would explain {100.0 * self.explained:.3g} %"
        if self.rough:
            text += " to first order"
        if self.left is not None:
            text += f" and leave {self.left.channel} at {_above(self.left)}"
        return text

    def to_dict(self) -> dict[str, Any]:
        """As in the JSON."""
        return {
            "effects": [
                {"effect": law.effect, "component": law.component, "port": law.port,
                 "place": law.place, "parameters": parameters(law)}
                for law in self.laws
            ],
            "explained": self.explained,
            "left": None if self.left is None else {
                "channel": self.left.channel, "purpose": self.left.purpose,
                "times_noise": self.left.rms,
            },
            "why": list(self.why),
            "first_order": self.rough,
        }  # fmt: skip


@dataclass(frozen=True)
class Verdict:
    """The verdict and what it says.

    Attributes:
        kind: effect_found, nothing_missing, confounded, unexplained or bad_data.
        model: place of the named set in the table, else that of the declared model (0).
        laws: named ones.
        explained: share of what the declared model leaves beyond noise that the named set explains.
        shares: law -> share of the excess that the model without it leaves.
        rivals: sets that explain the data as well, by their places in the table, with their log
            likelihood over that of the named set [nats].
        others: laws of these that the named set has not, by rival.
        replaced: laws of the named set that the rival does without, by rival.
        places: named law -> other places (or laws) with which it would do the same.
        alike: sets that the data do not tell from the named one, by their places in the table:
            rivals, and those with a law of it elsewhere.
        left: channels above their noise, worst first.
        hints: nearest sets, of `unexplained`.
        force: the free force that explains most of the rest.
        unused: whether there were unused runs.
        errors, ended, stopped: see `Table`.
        bounds: of `unexplained`: see `Table`, if unused runs want these bounds opened.
        opened: share of what the declared model leaves beyond noise that this explains.
        beyond: channels that it leaves above their noise.
    """

    kind: str
    model: int = 0
    laws: tuple[Law, ...] = ()
    explained: float = 0.0
    shares: dict[str, float] = field(default_factory=dict)
    rivals: tuple[tuple[int, float], ...] = ()
    others: tuple[tuple[str, ...], ...] = ()
    replaced: tuple[tuple[str, ...], ...] = ()
    places: dict[str, tuple[str, ...]] = field(default_factory=dict)
    alike: tuple[int, ...] = ()
    left: tuple[Left, ...] = ()
    hints: tuple[Hint, ...] = ()
    force: Force | None = None
    unused: bool = True
    errors: tuple[str, ...] = ()
    ended: tuple[tuple[str, float], ...] = ()
    stopped: str = ""
    bounds: tuple[Value, ...] = ()
    opened: float = 0.0
    beyond: tuple[Left, ...] = ()

    @property
    def white(self) -> bool:
        """Whether more than noise is left, and all of it is white."""
        return bool(self.left) and all(x.white for x in self.left)

    @property
    def reason(self) -> str:
        """Two or three sentences."""
        if self.kind == "bad_data":
            return "; ".join(self.errors)
        names = " and ".join(law.label for law in self.laws)
        explain = "explains" if len(self.laws) == 1 else "explain"
        tail = f" More than noise is left in {over(self.left)}." if self.left else ""
        if self.white:
            tail += (
                " What is left is white, which no force makes: the noise is larger than stated "
                "there, or an error of the sensor differs from sample to sample."
            )
        if self.kind == "effect_found":
            text = (
                f"{names} {explain} {percent(self.explained)} of what the declared model leaves "
                "beyond noise. The gain holds on runs that were not used for fitting, and no "
                + ("effect of the catalogue does better."
                   if any(map(_law, sum(self.places.values(), ())))
                   else "other effect of the catalogue does as well.")
            )  # fmt: skip
            return text + self._elsewhere() + tail + self._ended()
        if self.kind == "confounded":
            text = f"{names} {explain} the data, but so does {', '.join(self._instead())}."
            return text + self._elsewhere() + tail + self._ended()
        if self.kind == "nothing_missing":
            return (
                "The calibrated model leaves noise in all channels, and no effect of the catalogue "
                "does so much better that it could be named."
                if self.unused
                else "The calibrated model leaves noise in all channels; no run was kept to judge "
                "effects by."
            )
        if self.stopped:
            state = tail.strip() or "The calibrated model leaves noise in all channels."
            text = f"{state} The search was stopped {self.stopped}, so no effect is named."
        else:
            text = f"{tail.strip()} No effect of the catalogue can be named".strip()
            text += "." if self.unused else ": no run was kept unused to judge by."
        if self.bounds:
            text += (
                f" The declared model would explain {percent(self.opened)} of it with "
                f"{past(self.bounds)}: look at these bounds in the mapping first."
            )
        if self.hints:
            text += f" Nearest, but no name: {self.hints[0]}"
            text += "." if self.hints[0].left else f"; {self.hints[0].why[0]}."
        if self.force is not None:
            text += (
                f" A free force at {self.force.label} would explain "
                f"{percent(self.force.explained)} of it in the worst run."
            )
        return text + self._ended()

    def _elsewhere(self) -> str:
        text = ""
        for label, found in self.places.items():
            places = [name for name in found if not _law(name)]
            same = [f"the same at {', '.join(places)}"] if places else []
            others = ", ".join([*same, *filter(_law, found)])
            text += f" The data do not tell {label} from {others}."
        return text

    def _ended(self) -> str:
        if not self.ended:
            return ""
        until = ", ".join(f"{name} up to {time:.1f} s" for name, time in self.ended)
        return (
            f" Further effects were looked for in {until} only: after that, changes of the start "
            "values that nobody can see decide what the model does."
        )

    def effects(self) -> list[dict[str, Any]]:
        """The named laws, as in the JSON and in the tables."""
        return [
            {
                "effect": law.effect,
                "component": law.component,
                "port": law.port,
                "place": law.place,
                "text": law.text,
                "parameters": parameters(law),
                "held": dict(law.held),
                "p_value": law.p_value,
                "explained": self.shares[law.label],
                "gain_nats": law.missed.fitted if law.missed else None,
                "validation_gain_nats": law.missed.unused if law.missed else None,
                "other_places": list(self.places.get(law.label, ())),
            }
            for law in self.laws
        ]

    def _instead(self) -> list[str]:
        """Each rival's own laws, and which ones they replace where others stay."""
        found = []
        for labels, mine in zip(self.others, self.replaced, strict=True):
            stay = len(mine) < len(self.laws)
            found.append(" and ".join(labels) + stay * f" in place of {' and '.join(mine)}")
        return found

    def to_dict(self) -> dict[str, Any]:
        """Its part of the JSON."""
        return {
            "verdict": self.kind,
            "reason": self.reason,
            "effects": self.effects(),
            "alternatives": [
                {"effects": list(labels), "instead_of": list(mine), "score": score}
                for labels, mine, (_, score) in zip(
                    self.others, self.replaced, self.rivals, strict=True
                )
            ],
            "left": list(dict.fromkeys(x.channel for x in self.left)),
            "left_white": self.white,
            "hints": [hint.to_dict() for hint in self.hints],
            "stopped": self.stopped,
            "bounds_opened": {
                v.name: {
                    "value": v.value,
                    "ci95": [v.low, v.high],
                    "unit": v.unit,
                    "bounds": [v.minimum, v.maximum],
                }
                for v in self.bounds
            },
        }


def _law(name: str) -> bool:
    """Whether what does the same is another law, not the same elsewhere."""
    return " at " in name


def parameters(law: Law) -> dict[str, dict[str, Any]]:
    """A law's parameters, as in the JSON."""
    return {
        v.name: {"value": v.value, "ci95": [v.low, v.high], "unit": v.unit,
                 "identifiable": v.identifiable}
        for v in law.values
    }  # fmt: skip


def past(bounds: Sequence[Value]) -> str:
    """Values beyond their bounds, for people."""
    return " and ".join(
        f"{v.name} beyond its bound {v.maximum if v.value > v.maximum else v.minimum:.4g}, at "
        f"{v.value:.4g} [{v.low:.4g}, {v.high:.4g}] {v.unit}".rstrip()
        for v in bounds
    )


def over(left: Sequence[Left]) -> str:
    """Channels above their noise, for people."""
    worst: dict[str, str] = {}
    for x in left:
        worst.setdefault(x.channel, _above(x))
    return ", ".join(f"{name} ({size})" for name, size in worst.items())


def _above(left: Left) -> str:
    """By how much a channel is above its noise."""
    if left.structured:
        return f"{left.rms:.3g} times its noise"
    return f"slow parts of {left.slow:.3g} times its noise's"


def _size(law: Law) -> str:
    value = law.size
    return f"{value.name} = {value.value:.4g} [{value.low:.4g}, {value.high:.4g}] {value.unit}"


def percent(share: float) -> str:
    """A share, for people."""
    return f"{100.0 * share:.3g} %"
