"""What a model consists of: variables, sample clocks, balances, and the effects asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from .effect import Effect, Law
from .quantity import Quantity
from .units import coherent

SX = Any
Role = Literal["input", "state", "parameter", "discrete", "output"]


class ModelError(ValueError):
    """A description that cannot become a model; the text names the culprit and the way out."""


class Symbols:
    """Declared symbols by their names, as the formulas write them: `p.k * x.twist`."""

    def __init__(self, named: Mapping[str, SX]) -> None:
        self._named = dict(named)

    def __getattr__(self, name: str) -> SX:
        if name.startswith("__") or name not in self._named:
            raise AttributeError(f"no symbol {name!r}; declared are {', '.join(self._named)}")
        return self._named[name]


@dataclass
class Declared:
    """One scalar variable of a variant.

    Attributes:
        name: full name, `prefix.name[index]`.
        quantity: its declaration.
        role: input, state, parameter, discrete (held between samples) or output.
        start: start value.
        symbol: the CasADi symbol (outputs: the defining expression).
        of_effect: name of the strength of the effect that declared it, "" for the fidelity's own.
    """

    name: str
    quantity: Quantity
    role: Role
    start: float
    symbol: SX
    of_effect: str = ""


@dataclass
class Clock:
    """A sample clock: ticks at `k * period`, k = 0, 1, ...; the updates act simultaneously.

    Clocks due at the same instant act in the order in which they were declared, later ones seeing
    what earlier ones wrote.
    """

    name: str
    period: SX
    updates: dict[str, SX] = field(default_factory=dict)


@dataclass
class Balance:
    """The sum of an equation that effects may add to.

    Attributes:
        group: name shared with the like balances of parts that share parameters
            (`caster.swivel` of `caster_fl.swivel`), else the balance's own name.
        sensor: output that is the reading of a sensor, if it is one that may be wrong.
        effort: what the attached effects add (scalar or vector SX; 0 without effects).
        share: part of what they add from now on that the balance gets (None: all).
        lean: what effects add to gravity (3), body axes [m/s2]; only of kind `body`. Its wrench on
            the mass that the balance names, and on what effects add, is part of `effort`.
        mass, first_moment, inertia: additional mass [kg], mass times position (3) [kg.m] and
            rotational inertia about the reference point (3x3) [kg.m2]; only of kind `body`.
    """

    name: str
    kind: str
    unit: str
    signals: dict[str, SX]
    effort: SX
    group: str = ""
    sensor: str = ""
    share: SX = None
    lean: SX = None
    mass: SX = 0.0
    first_moment: SX = None
    inertia: SX = None


@dataclass(frozen=True)
class Attachment:
    """An effect that a variant asks for: `name` or `name@balance`."""

    effect: Effect
    law: Law
    balance: str = ""

    @property
    def spelling(self) -> str:
        """As in a variant's name."""
        return f"{self.effect.name}@{self.balance}" if self.balance else self.effect.name


def misfit(effect: Effect, balance: Balance) -> str:
    """Why an effect cannot act on a balance, "" if it can."""
    if balance.kind not in effect.kinds:
        return (
            f"effect {effect.name!r} cannot act on balance {balance.name!r} of kind "
            f"{balance.kind!r}; it fits {', '.join(effect.kinds)}"
        )
    if effect.unit and coherent(effect.unit).exponents != coherent(balance.unit or "1").exponents:
        return (
            f"effect {effect.name!r} adds {effect.unit}, but balance {balance.name!r} "
            f"is in {balance.unit or '1'}"
        )
    lacking = [need for need in effect.needs if need not in balance.signals]
    if lacking:
        return (
            f"effect {effect.name!r} needs {', '.join(lacking)}, which balance "
            f"{balance.name!r} does not offer"
        )
    odd = [signal for signal in effect.unless if signal in balance.signals]
    if odd:
        return (
            f"effect {effect.name!r} has no place at balance {balance.name!r}, "
            f"which has {', '.join(odd)}"
        )
    return ""
