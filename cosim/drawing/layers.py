"""Columns of a drawing: boxes so that most wires run to the right and the others are few.

Source: Eades, Lin and Smyth, A fast and effective heuristic for the feedback arc set problem, 1993.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Wire:
    """From an output of a box to an input of another one; heavy ones are kept short and forward."""

    source: str
    source_port: str
    target: str
    target_port: str
    weight: float = 1.0


def columns(names: Sequence[str], wires: Iterable[Wire]) -> dict[str, int]:
    """The column of each box."""
    weight: dict[tuple[str, str], float] = {}
    for wire in wires:
        if wire.source != wire.target:
            pair = (wire.source, wire.target)
            weight[pair] = weight.get(pair, 0.0) + wire.weight
    place = {name: index for index, name in enumerate(_sequence(names, weight))}
    pull: dict[tuple[str, str], float] = {}
    for (a, b), value in weight.items():
        pair = (a, b) if place[a] < place[b] else (b, a)
        pull[pair] = pull.get(pair, 0.0) + value
    order = sorted(names, key=place.__getitem__)
    before = {name: {a: w for (a, b), w in pull.items() if b == name} for name in names}
    after = {name: {b: w for (a, b), w in pull.items() if a == name} for name in names}
    layer: dict[str, int] = {}
    for name in order:
        layer[name] = max((layer[other] + 1 for other in before[name]), default=0)
    for _ in names:  # nearer to those that they are tied to more
        for name in reversed(order):
            if after[name] and sum(after[name].values()) > sum(before[name].values()):
                layer[name] = min(layer[other] for other in after[name]) - 1
    first = min(layer.values(), default=0)
    return {name: layer[name] - first for name in names}


def _sequence(names: Sequence[str], weight: Mapping[tuple[str, str], float]) -> list[str]:
    """Boxes in an order with little weight from later to earlier ones."""
    left: list[str] = []
    right: list[str] = []
    rest = list(names)

    def degree(name: str, outgoing: bool) -> float:
        return sum(
            value
            for (a, b), value in weight.items()
            if (a if outgoing else b) == name and (b if outgoing else a) in rest and a != b
        )

    while rest:
        sinks = [name for name in rest if degree(name, True) == 0.0]
        sources = [name for name in rest if degree(name, False) == 0.0]
        if sources:
            left.append(sources[0])
            rest.remove(sources[0])
        elif sinks:
            right.insert(0, sinks[-1])
            rest.remove(sinks[-1])
        else:
            best = max(rest, key=lambda name: degree(name, True) - degree(name, False))
            left.append(best)
            rest.remove(best)
    return left + right
