"""What a diagnosis found out, as values: the table of models that the verdict is a function of.

Plain numbers and texts, so a table can be written to a file and judged again without a simulation.
"""

from __future__ import annotations

import types
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, is_dataclass
from functools import cache
from typing import Any, Protocol, Union, get_args, get_origin, get_type_hints

from .whiteness import structured, white


@dataclass(frozen=True)
class Value:
    """A parameter of a law.

    Attributes:
        name, unit: of the parameter, without its place.
        value, low, high: with its 95 % interval.
        minimum, maximum: bounds.
        identifiable: whether the data say more than the bounds.
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
    minimum: float
    maximum: float
    identifiable: bool

    @property
    def determined(self) -> bool:
        """Whether the data know it, within its bounds."""
        return self.identifiable and self.low > self.minimum and self.high < self.maximum


@dataclass(frozen=True)
class Gain:
    """What one model is better by than another one.

    Attributes:
        fitted, unused: log likelihood on identification runs, and on unused ones [nats].
        fitted_z, unused_z: the same in standard deviations, residuals correlated within blocks.
        change: largest RMS over the noise, in a channel of a run, by which the two differ.
    """

    fitted: float
    unused: float
    fitted_z: float
    unused_z: float
    change: float


class Effect(Protocol):
    """What the catalogue says of a law: its name, and those of its special cases."""

    @property
    def effect(self) -> str:
        """Name in the catalogue."""

    @property
    def contains(self) -> tuple[str, ...]:
        """Effects that its law becomes for some values of its parameters."""


def one_law(first: Effect, second: Effect) -> bool:
    """Whether two effects are one, or one of them a case of the other, wherever they are."""
    return first.effect in (second.effect, *second.contains) or second.effect in first.contains


@dataclass(frozen=True)
class Law:
    """An effect at a place, with its parameters as fitted in a model.

    Attributes:
        effect, text: of the catalogue.
        component, port: instance of the system, and its balance.
        strength: name of the parameter whose value `absent` makes the law absent.
        absent: see there.
        values: its fitted parameters, the strength among them.
        own: number of its parameters, fitted or held.
        contains: effects that its law becomes for some values of its parameters.
        twins: labels of laws that do the same to the first order.
        p_value: of its score on identification runs, corrected for the number of candidates.
        missed: what the model is better by than the one without this law; None if not known.
        tick: the least strength that shifts something by a tick of the rig, 0 if it shifts nothing
            in time: a smaller one says when within a tick something is read.
        held: its other parameters, and the values at which they were held: as they are usually, or
            as the search has chosen them (cycles per turn).
    """

    effect: str
    component: str
    port: str
    strength: str
    values: tuple[Value, ...]
    text: str = ""
    absent: float = 0.0
    own: int = 1
    contains: tuple[str, ...] = ()
    twins: tuple[str, ...] = ()
    p_value: float | None = None
    missed: Gain | None = None
    tick: float = 0.0
    held: tuple[tuple[str, float], ...] = ()

    @property
    def place(self) -> str:
        """Instance and balance."""
        return f"{self.component}.{self.port}" if self.port else self.component

    @property
    def label(self) -> str:
        """As shown."""
        return f"{self.effect} at {self.place}"

    @property
    def size(self) -> Value:
        """The strength."""
        return next(v for v in self.values if v.name == self.strength)

    @property
    def there(self) -> bool:
        """Whether the interval of its strength excludes absence.

        A strength that cannot be absent (a delay of a tick at least) must exclude its bound.
        """
        low, high, edge = self.size.low, self.size.high, max(self.absent, self.size.minimum)
        return low > edge or high < self.absent


@dataclass(frozen=True)
class Left:
    """What a model leaves of a channel in the runs of a purpose.

    Attributes:
        channel, purpose: which.
        rms: residual over noise.
        lasting: the same without the few worst windows (`whiteness.BURST`).
        p_value: that noise alone has such slow parts.
        slow: these parts over what noise has, likewise (`whiteness.WhitenessTest`).
        p_fast: that noise alone has neighbours so alike.
        p_white: that white noise of any size has such slow parts; 0 if not asked.
        foretold: whether it is more than noise, and no more than the deviations of the parameters
            make of it: in runs that were not fitted. All but `rms` is then what is left beside.
    """

    channel: str
    purpose: str
    rms: float
    lasting: float
    p_value: float
    slow: float = 1.0
    p_fast: float = 1.0
    p_white: float = 0.0
    foretold: bool = False

    @property
    def white(self) -> bool:
        """Noise that is only larger than stated: see `whiteness.white`."""
        return self.structured and white(self.lasting, self.p_fast, self.p_white)

    @property
    def structured(self) -> bool:
        """More than noise: see `whiteness.structured`."""
        return structured(self.lasting, self.p_value, self.p_fast)


@dataclass(frozen=True)
class Force:
    """A free curve of an unknown force at a place, of what a model leaves in one run.

    Attributes:
        component, port, element: where it enters: instance, balance, element of a vector.
        explained: share of the run's excess over the noise that it takes away.
    """

    component: str
    port: str
    element: str
    explained: float

    @property
    def label(self) -> str:
        """As shown."""
        return f"{self.component}.{self.port}" + (f"[{self.element}]" if self.element else "")


@dataclass(frozen=True)
class Model:
    """The declared system with some laws, fitted to the identification runs.

    Attributes:
        laws: that were added, none for the declared system.
        free: number of parameters that were fitted or chosen.
        fitted, unused: log likelihood on identification runs, and on unused ones [nats].
        left: by channel and purpose.
        gain: over the declared model, None of itself.
        forces: what free forces would explain of the rest, the best first; None if not asked.
        worst: sum of squares over sigma beyond noise that it leaves in the run in which free forces
            were tried on the declared model.
        squares: the same in all runs, every window in full; likelihoods count those far off by
            their logarithm where runs may turn unstable.
        rough: not fitted, a first order from the declared model: it can be a hint alone.
        beyond: what it is better by than the declared model with bounds opened (`Table.opened`).
    """

    laws: tuple[Law, ...]
    free: int
    fitted: float
    unused: float
    left: tuple[Left, ...]
    gain: Gain | None = None
    forces: tuple[Force, ...] | None = None
    worst: float = 0.0
    squares: float = 0.0
    rough: bool = False
    beyond: Gain | None = None

    @property
    def labels(self) -> frozenset[str]:
        """Of its laws."""
        return frozenset(law.label for law in self.laws)

    @property
    def score(self) -> float:
        """Log likelihood on all runs, less one per parameter (Akaike)."""
        return self.fitted + self.unused - self.free


@dataclass(frozen=True)
class Comparison:
    """Two models of a table, by their places in it, and what the second is better by."""

    first: int
    second: int
    gain: Gain


@dataclass(frozen=True)
class Table:
    """All that the verdict needs.

    Attributes:
        models: the declared one first.
        comparisons: of models that are about as likely.
        candidates: number of laws that there were to choose from.
        fitted_count, unused_count: measured values in identification and in unused runs, 0 if no
            run was kept unused.
        errors: what makes the data useless.
        ended: run -> time from which it did not count for later laws.
        stopped: why the search was ended before its end, "" if it was not.
        opened: the declared model with the bounds opened at which its parameters ended, if it was
            fitted.
        bounds: these parameters' values in it, with the bounds that they have in the mapping.
        columns: number of columns that are measured or drive the system; 0 if not known.
    """

    models: tuple[Model, ...] = ()
    comparisons: tuple[Comparison, ...] = ()
    candidates: int = 0
    fitted_count: int = 0
    unused_count: int = 0
    errors: tuple[str, ...] = ()
    ended: tuple[tuple[str, float], ...] = ()
    stopped: str = ""
    opened: Model | None = None
    bounds: tuple[Value, ...] = ()
    columns: int = 0

    def to_dict(self) -> dict[str, Any]:
        """For a file; `read` is the inverse."""
        return asdict(self)

    @staticmethod
    def read(content: Mapping[str, Any]) -> Table:
        """A table from a file's content.

        Raises:
            KeyError, TypeError: it is none.
        """
        found = _made(Table, content)
        assert isinstance(found, Table)
        return found


@cache
def _kinds(kind: type) -> tuple[tuple[str, Any], ...]:
    """Names and kinds of a dataclass's fields."""
    known = get_type_hints(kind)
    return tuple((f.name, known[f.name]) for f in fields(kind))


def _made(kind: Any, content: Any) -> Any:
    """A value of a kind from what JSON keeps of it."""
    if is_dataclass(kind) and isinstance(kind, type):
        return kind(**{name: _made(of, content[name]) for name, of in _kinds(kind)})
    if get_origin(kind) in (Union, types.UnionType):
        if content is None:
            return None
        return _made(next(k for k in get_args(kind) if k is not types.NoneType), content)
    if get_origin(kind) is tuple:
        inner = get_args(kind)
        kinds_of = [inner[0]] * len(content) if inner[-1] is Ellipsis else list(inner)
        return tuple(_made(k, v) for k, v in zip(kinds_of, content, strict=True))
    return kind(content)
