"""Which variable of a system a column is: by names and units that fit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from ..errors import UnitError
from ..spec.units import parse
from ..system.system import System
from .guess import Guess
from .words import commands, pieces, words

NAME, INSTANCE, TEXT = 1.0, 0.5, 0.3
"""Weight of a word in a variable's name, in its instance's name, and in its description."""
MEASURED = 0.1
"""What a variable gains that is said to be measured: a log holds what a sensor says."""
MARGIN = 0.05
"""By which the best one must be better than the second."""
SELDOM = 0.6
"""What is left of what speaks for a column being an input, if it looks measured."""
ITSELF = 10.0
"""What a column is worth that has the variable's own name: more than all words of a name."""
WIDER = {"angle": "yaw"}
"""Words that may mean less: `theta` beside x and y is a heading."""
MAYBE = 0.5
"""What is left of a word's weight then."""
TOO_MUCH = 0.01
"""What each word of a variable's name costs that the column does not have."""


@dataclass(frozen=True)
class Place:
    """A variable that a column may be.

    Attributes:
        name: full name.
        unit: "" where the FMU declares none.
        role: `input` or `output`.
        text: its description.
        words: that speak for it, with their weights.
        start: value that an input has if nothing drives it.
    """

    name: str
    unit: str
    role: str
    text: str
    words: Mapping[str, float]
    start: float = 0.0


@dataclass(frozen=True)
class Column:
    """A column of a run.

    Attributes:
        part: key of the part that it is in.
        name: in there.
        unit: and why.
        moves: whether it changes in any run.
        command: whether its part holds commands.
    """

    part: str
    name: str
    unit: Guess
    moves: bool = True
    command: bool = False

    @property
    def source(self) -> str:
        """As a mapping names it."""
        return f"{self.part}.{self.name}" if self.part else self.name


@dataclass(frozen=True)
class Match:
    """A column that is a variable; `reason`: by what it was matched."""

    column: Column
    place: Place
    reason: str


@dataclass
class Matches:
    """What was matched.

    Attributes:
        inputs, channels: matches by full name of the variable.
        constants: inputs that are held, by name.
        left: inputs that are left at their start value, since no column can be them.
        open: inputs that nothing drives yet.
        unsure: columns that may be several outputs, with the best of them.
    """

    inputs: dict[str, Match] = field(default_factory=dict)
    channels: dict[str, Match] = field(default_factory=dict)
    constants: dict[str, float] = field(default_factory=dict)
    left: dict[str, float] = field(default_factory=dict)
    open: list[Place] = field(default_factory=list)
    unsure: dict[str, list[str]] = field(default_factory=dict)

    def used(self) -> set[str]:
        """Sources of the columns that are matched."""
        return {m.column.source for m in (*self.inputs.values(), *self.channels.values())}


def places_of(system: System) -> list[Place]:
    """Open inputs and outputs of a system; an output also goes by what it drives."""
    driven: dict[str, list[str]] = {}
    for connection in system.connections:
        driven.setdefault(connection.source, []).append(connection.target)
    found = []
    for role, names in (("input", system.open_inputs()), ("output", system.signals())):
        for name in names:
            declared = system.declaration(name)
            if declared.type != "Float64":
                continue
            weights: dict[str, float] = {}
            for other in (name, *driven.get(name, [])):
                instance, _, variable = other.partition(".")
                for word in words(instance):
                    weights[word] = max(weights.get(word, 0.0), INSTANCE)
                for word in words(variable):
                    weights[word] = max(weights.get(word, 0.0), NAME)
            for word in words(declared.text):
                weights.setdefault(word, TEXT)
            start = float((declared.start or (0.0,))[0] or 0.0)
            found.append(Place(name, declared.symbol, role, declared.text, weights, start))
    return found


def fits(unit: str, place: Place) -> bool:
    """Whether a unit measures what a variable does; an unknown one may."""
    if not unit or not place.unit:
        return True
    try:
        return parse(unit).exponents == parse(place.unit).exponents
    except UnitError:
        return False


def score(column: Column, place: Place) -> float:
    """How much speaks for a column being a variable; 0 if nothing does."""
    if not column.moves or not fits(column.unit.unit, place):
        return 0.0
    said = _said(column)
    ordered = column.command or commands(column.name)
    if ordered and place.role == "output":
        return 0.0
    if "measured" in said and place.role == "input":
        return 0.0
    if column.name in (place.name, place.name.partition(".")[2]):
        return ITSELF
    total = 0.0
    for word in dict.fromkeys(said):
        less = MAYBE * place.words.get(WIDER.get(word, ""), 0.0)
        total += max(place.words.get(word, 0.0), less)
    if total <= 0.0:
        return 0.0
    if place.role == "output" and "measured" in place.words:
        total += MEASURED
    if place.role == "input" and not ordered and _moves(column, place):
        total *= SELDOM
    missing = sum(w >= NAME and word not in said for word, w in place.words.items())
    return total - TOO_MUCH * missing


def _moves(column: Column, place: Place) -> bool:
    """Whether a column is a place, an angle or their speed: these are measured, if not ordered."""
    unit = column.unit.unit or place.unit
    try:
        return parse(unit).exponents in [
            parse(one).exponents for one in ("m", "rad", "m/s", "rad/s")
        ]
    except UnitError:
        return False


def _said(column: Column) -> list[str]:
    """Words of a column without its unit."""
    parts = pieces(column.name)
    if column.unit.sure and len(parts) > 1 and "ends" in column.unit.reason:
        parts = parts[:-1]
    return [word for part in parts for word in words(part)]


def guess(columns: Sequence[Column], places: Sequence[Place], matches: Matches) -> None:
    """Match what names and units tell, on top of what is matched already.

    First what one name tells better than all others; then, of what is left, inputs of whose unit
    there is one column only, and outputs likewise.
    """
    outputs = [p for p in places if p.role == "output"]
    for role in ("input", "output"):
        into = matches.inputs if role == "input" else matches.channels
        free = [p for p in places if p.role == role and p.name not in into
                and p.name not in matches.constants]  # fmt: skip
        left = [c for c in columns if c.source not in matches.used()]
        rated = {(c.source, p.name): score(c, p) for c in left for p in free}
        for column in left:
            order = sorted(free, key=lambda p: -rated[column.source, p.name])
            if not order or rated[column.source, order[0].name] <= 0.0:
                continue
            best = rated[column.source, order[0].name]
            if role == "input" and best < max(score(column, p) for p in outputs):
                continue
            rivals = [p.name for p in order if rated[column.source, p.name] > best - MARGIN]
            others = [c for c in left if c is not column
                      and rated[c.source, order[0].name] > best - MARGIN]  # fmt: skip
            if len(rivals) == 1 and not others:
                into[order[0].name] = Match(column, order[0], "name and unit fit")
            elif role == "output":
                matches.unsure[column.source] = rivals
    _by_unit(columns, places, matches)
    for source in matches.used():
        matches.unsure.pop(source, None)
    matches.open.clear()
    unused = [c for c in columns if c.source not in matches.used()]
    for place in places:
        if place.role != "input" or place.name in (*matches.inputs, *matches.constants):
            continue
        if matches.inputs and not candidates(place, unused):
            matches.left[place.name] = place.start
        else:
            matches.open.append(place)


def _by_unit(columns: Sequence[Column], places: Sequence[Place], matches: Matches) -> None:
    """Inputs of whose unit there is one moving column, and no other input."""
    free = [p for p in places if p.role == "input" and p.name not in matches.inputs
            and p.name not in matches.constants]  # fmt: skip
    left = [c for c in columns if c.source not in matches.used() and c.moves and c.unit.unit]
    ordered = [c for c in left if c.command or commands(c.name)]
    for place in free:
        may = ordered or [c for c in left if not _moves(c, place)]
        own = [c for c in may if place.unit and fits(c.unit.unit, place)]
        rivals = [p for p in free if p.unit and own and fits(own[0].unit.unit, p)]
        if len(own) == 1 and len(rivals) == 1:
            matches.inputs[place.name] = Match(
                own[0], place, f"the only moving column in {own[0].unit.unit}"
            )


def candidates(place: Place, columns: Iterable[Column]) -> list[Column]:
    """Columns that a variable may be by their unit, the likeliest first."""
    own = [c for c in columns if c.moves and fits(c.unit.unit, place)]
    return sorted(own, key=lambda c: -score(c, place))
