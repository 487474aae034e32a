"""Layered layout of boxes with ports, and orthogonal ways between them.

1. Boxes stand in columns (`columns`). A wire to the left leaves the left side of its box, so that
   two boxes that act on each other face each other.
2. Wires that pass a column get a place in it.
3. Boxes and places are ordered within their columns to reduce crossings.
4. They are moved vertically towards what they are connected to.
5. Between two columns every net has a vertical track; those that would overlap get their own.

Source: Sugiyama, Tagawa and Toda, Methods for visual understanding of hierarchical system
structures, 1981.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from .layers import Wire

GAP, PASS = 26.0, 9.0
"""Free height between boxes, and between wires that pass a column."""
TRACK, MARGIN = 11.0, 24.0
"""Distance of vertical tracks, and of the outer ones to the columns."""
SWEEPS = 24
NUDGE, APART = 14.0, 4.5
"""How far an item is moved at the end, and how near lines of two nets may lie."""


@dataclass
class Port:
    """Where wires meet a box.

    Attributes:
        box: name of the box.
        name: of the port; on each side of a box it is there once.
        side: -1 for left, +1 for right.
        offset: height below the top of the box.
    """

    box: str
    name: str
    side: int
    offset: float = 0.0


@dataclass
class Item:
    """A box, or the place of a passing wire, in a column; `foot` is for wires to itself."""

    name: str
    layer: int
    width: float
    height: float
    foot: float = 0.0
    y: float = 0.0
    ports: dict[tuple[int, str], Port] = field(default_factory=dict)
    wire: bool = False


@dataclass
class Way:
    """A net between two neighbouring columns: one end on one side, the others on the other.

    Attributes:
        layer: left column.
        root: the end where the signal comes from.
        ends: where it goes.
        wires: indices of the wires that each end carries.
        x: of its vertical track.
        track: number of it.
    """

    layer: int
    root: Port
    ends: list[Port]
    wires: list[list[int]]
    x: float = 0.0
    track: int = 0


class Layered:
    """Positions of boxes and ways.

    Args:
        names: boxes, in the order in which equals are kept.
        wires: between them.
        layers: column of each box.
        size: width and height of a box, from its ports; sets their offsets.
        room: width that a wire needs between columns, for a note beside it.
    """

    def __init__(
        self,
        names: Sequence[str],
        wires: Sequence[Wire],
        layers: Mapping[str, int],
        size: Callable[[str, list[Port], list[Port]], tuple[float, float]],
        room: Sequence[float],
    ) -> None:
        self.wires, self.size, self.room = wires, size, room
        self.items = {name: Item(name, layers[name], 0.0, 0.0) for name in names}
        self.ways: list[Way] = []
        self._connect()
        self.columns = [
            [item for item in self.items.values() if item.layer == layer]
            for layer in range(max(layers.values(), default=0) + 1)
        ]
        self._neighbours: dict[tuple[str, int, str], list[tuple[Port, float]]] = {}
        for way in self.ways:
            for end, wires_ in zip(way.ends, way.wires, strict=True):
                weight = max(wires[index].weight for index in wires_)
                for a, b in ((way.root, end), (end, way.root)):
                    self._neighbours.setdefault((a.box, a.side, a.name), []).append((b, weight))
        self._resize()
        self._order()
        self._settle()
        self._route()

    # -- structure ---------------------------------------------------------------------------------

    def port(self, box: str, name: str, side: int) -> Port:
        """The port of a box on one of its sides, made if it is not there."""
        return self.items[box].ports.setdefault((side, name), Port(box, name, side))

    def _connect(self) -> None:
        """Nets: wires from the same port in the same direction share their way."""
        nets: dict[tuple[str, str, int], list[int]] = {}
        self.selves: list[tuple[int, Port, Port]] = []
        for index, wire in enumerate(self.wires):
            if wire.source == wire.target:
                out = self.port(wire.source, wire.source_port, 1)
                into = self.port(wire.target, wire.target_port, -1)
                self.items[wire.source].foot += 18.0
                self.selves.append((index, out, into))
                continue
            ahead = self.items[wire.target].layer > self.items[wire.source].layer
            nets.setdefault((wire.source, wire.source_port, 1 if ahead else -1), []).append(index)
        for (box, name, side), members in nets.items():
            layer = self.items[box].layer
            far = max(abs(self.items[self.wires[i].target].layer - layer) for i in members)
            root = self.port(box, name, side)
            for distance in range(1, far + 1):
                here = layer + side * distance
                ends: list[Port] = []
                carried: list[list[int]] = []
                for index in members:
                    wire = self.wires[index]
                    if self.items[wire.target].layer == here:
                        ends.append(self.port(wire.target, wire.target_port, -side))
                        carried.append([index])
                onward = [
                    i
                    for i in members
                    if abs(self.items[self.wires[i].target].layer - layer) > distance
                ]
                next_root = root
                if onward:
                    place = f"{box}.{name}@{here}{'<' if side < 0 else '>'}"
                    self.items[place] = Item(place, here, 0.0, 0.0, wire=True)
                    ends.append(self.port(place, "", -side))
                    carried.append(onward)
                    next_root = self.port(place, "", side)
                self.ways.append(Way(min(here, here - side), root, ends, carried))
                root = next_root

    def _resize(self) -> None:
        for item in self.items.values():
            if item.wire:
                item.height = 0.0
                continue
            sides = [[p for p in item.ports.values() if p.side == side] for side in (-1, 1)]
            item.width, item.height = self.size(item.name, *sides)

    # -- order -------------------------------------------------------------------------------------

    def _at(self, port: Port) -> float:
        return self.items[port.box].y + port.offset

    def _order(self) -> None:
        """Sweep over the columns; keep the order with the fewest crossings."""
        self._stack()
        best, kept = self.crossings(), self._snapshot()
        for sweep in range(SWEEPS):
            for layer in self._there_and_back(sweep):
                side = -1 if sweep % 2 == 0 else 1
                both = sweep >= SWEEPS // 2
                self._arrange(layer, (side,) if not both else (-1, 1))
            self._sort_ports()
            count = self.crossings()
            if count < best:
                best, kept = count, self._snapshot()
        self._restore(kept)
        while self._swap_neighbours():
            pass

    def _there_and_back(self, sweep: int) -> Iterable[int]:
        layers = range(len(self.columns))
        return layers if sweep % 2 == 0 else reversed(layers)

    def _snapshot(self) -> tuple[list[list[Item]], dict[str, list[tuple[int, str]]]]:
        return [list(column) for column in self.columns], {
            item.name: list(item.ports) for item in self.items.values()
        }

    def _restore(self, kept: tuple[list[list[Item]], dict[str, list[tuple[int, str]]]]) -> None:
        self.columns = [list(column) for column in kept[0]]
        for item in self.items.values():
            item.ports = {key: item.ports[key] for key in kept[1][item.name]}
        self._resize()
        self._stack()

    def _stack(self, layers: Iterable[int] | None = None) -> None:
        """Put the items of columns on top of each other, centred."""
        for layer in range(len(self.columns)) if layers is None else layers:
            column = self.columns[layer]
            y = 0.0
            for above, item in zip([None, *column], column, strict=False):
                y += _distance(above, item)
                item.y = y
                y += item.height + item.foot
            for item in column:
                item.y -= y / 2.0

    def _arrange(self, layer: int, sides: Sequence[int]) -> None:
        """Order a column by the mean height of what its items are connected to."""

        def centre(item: Item) -> float:
            found = [
                (self._at(other), weight)
                for port in item.ports.values()
                if port.side in sides
                for other, weight in self._neighbours.get((item.name, port.side, port.name), ())
            ]
            if not found:
                return item.y + item.height / 2.0
            return sum(y * w for y, w in found) / sum(w for _, w in found)

        self.columns[layer].sort(key=centre)
        self._stack((layer,))

    def _sort_ports(self) -> None:
        """Ports of a side in the order of what they are connected to."""
        for item in self.items.values():

            def key(entry: tuple[tuple[int, str], Port], name: str = item.name) -> float:
                port = entry[1]
                found = self._neighbours.get((name, port.side, port.name), [])
                if not found:
                    return float("inf")
                return sum(self._at(other) for other, _ in found) / len(found)

            item.ports = dict(sorted(item.ports.items(), key=key))
        self._resize()

    def crossings(self, layers: Iterable[int] | None = None) -> int:
        """Pairs of wires that cross between neighbouring columns."""
        wanted = None if layers is None else set(layers)
        total = 0
        by_layer: dict[int, list[tuple[float, float, str]]] = {}
        for way in self.ways:
            if wanted is not None and way.layer not in wanted:
                continue
            for end in way.ends:
                a, b = (way.root, end) if way.root.side > 0 else (end, way.root)
                root = f"{way.root.box}.{way.root.name}"
                by_layer.setdefault(way.layer, []).append((self._at(a), self._at(b), root))
        for lines in by_layer.values():
            for index, (left, right, root) in enumerate(lines):
                for other_left, other_right, other in lines[:index]:
                    crossed = (left - other_left) * (right - other_right) < 0.0
                    total += root != other and crossed
        return total

    def _swap_neighbours(self) -> bool:
        """Exchange neighbours in columns where that removes crossings."""
        changed = False
        for layer, column in enumerate(self.columns):
            for index in range(len(column) - 1):
                around = (layer - 1, layer)
                before = self.crossings(around)
                column[index], column[index + 1] = column[index + 1], column[index]
                self._stack((layer,))
                if self.crossings(around) < before:
                    changed = True
                else:
                    column[index], column[index + 1] = column[index + 1], column[index]
                    self._stack((layer,))
        return changed

    # -- positions ---------------------------------------------------------------------------------

    def _settle(self) -> None:
        """Move items towards what they are connected to, keeping order and distance."""
        for sweep in range(2 * SWEEPS):
            for layer in self._there_and_back(sweep):
                column = self.columns[layer]
                wanted: list[tuple[float, float]] = []
                for item in column:
                    pulls = [
                        (self._at(other) - port.offset, weight * (4.0 if item.wire else 1.0))
                        for port in item.ports.values()
                        for other, weight in self._neighbours.get(
                            (item.name, port.side, port.name), ()
                        )
                    ]
                    total = sum(weight for _, weight in pulls)
                    wanted.append(
                        (sum(y * w for y, w in pulls) / total, total) if total else (item.y, 0.1)
                    )
                for item, y in zip(column, _separated(column, wanted), strict=True):
                    item.y = y
            if sweep < SWEEPS:
                self._sort_ports()
        self._adjust()
        top = min((item.y for item in self.items.values()), default=0.0)
        for item in self.items.values():
            item.y = round(item.y - top, 1)

    def _adjust(self) -> None:
        """Shift items a little: wires straight, and those of other nets not beside each other."""
        for column in [*self.columns, *reversed(self.columns)]:
            for index, item in enumerate(column):
                low, high = item.y - NUDGE, item.y + NUDGE
                if index:
                    above = column[index - 1]
                    gap = 0.75 * _distance(above, item)
                    low = max(low, above.y + above.height + above.foot + gap)
                if index + 1 < len(column):
                    below = column[index + 1]
                    high = min(
                        high, below.y - item.height - item.foot - 0.75 * _distance(item, below)
                    )
                tries = {item.y, *(item.y + shift for shift in range(-int(NUDGE), int(NUDGE) + 1))}
                for port in item.ports.values():
                    for other, _ in self._partners(port):
                        tries.add(self._at(other) - port.offset)
                inside = sorted(y for y in tries if low <= y <= high)
                costs = {y: self._cost(item, y) for y in inside}
                item.y = min(inside, key=costs.__getitem__, default=item.y)

    def _partners(self, port: Port) -> list[tuple[Port, float]]:
        return self._neighbours.get((port.box, port.side, port.name), [])

    def _cost(self, item: Item, y: float) -> float:
        """What is bad about a height: lines of other nets beside those of its own."""
        cost = 0.05 * abs(y - item.y)
        for port in item.ports.values():
            partners = {id(other): weight for other, weight in self._partners(port)}
            across = item.layer + port.side
            for other in self.columns[across] if 0 <= across < len(self.columns) else ():
                for facing in other.ports.values():
                    if facing.side != -port.side:
                        continue
                    distance = abs(y + port.offset - self._at(facing))
                    if id(facing) in partners:
                        cost -= 2.0 * partners[id(facing)] * (distance <= 0.5)
                    elif distance < APART:
                        cost += 3.0
        return cost

    # -- ways --------------------------------------------------------------------------------------

    def _route(self) -> None:
        """Tracks between columns, and with them the columns' positions."""
        self.left: list[float] = []
        x = 0.0
        for layer, column in enumerate(self.columns):
            self.left.append(x)
            width = max((item.width for item in column), default=0.0)
            x += width
            ways = [way for way in self.ways if way.layer == layer]
            count = _tracks(ways, self._at)
            for way in ways:
                way.x = round(x + MARGIN + TRACK * way.track, 1)
            needed = max((self.room[i] for way in ways for m in way.wires for i in m), default=0.0)
            x += max(2.0 * MARGIN + TRACK * max(count - 1, 0), needed)
        last = self.columns[-1] if self.columns else []
        self.width = (self.left[-1] if self.left else 0.0) + max(
            (i.width for i in last), default=0.0
        )
        self.height = max((i.y + i.height + i.foot for i in self.items.values()), default=0.0)
        for way in self.ways:
            for port in (way.root, *way.ends):
                self.height = max(self.height, self._at(port))

    def x(self, port: Port) -> float:
        """Where a port is."""
        item = self.items[port.box]
        column = max((other.width for other in self.columns[item.layer]), default=0.0)
        left = self.left[item.layer]
        if item.wire:
            return left if port.side < 0 else left + column
        return self.box(item)[0] + (item.width if port.side > 0 else 0.0)

    def box(self, item: Item) -> tuple[float, float]:
        """Left upper corner of a box; boxes are centred in their column."""
        column = max(other.width for other in self.columns[item.layer])
        return self.left[item.layer] + (column - item.width) / 2.0, item.y

    def y(self, port: Port) -> float:
        """Where a port is."""
        return self._at(port)


def _distance(above: Item | None, item: Item) -> float:
    if above is None:
        return 0.0
    return PASS if above.wire and item.wire else GAP if not (above.wire or item.wire) else 0.8 * GAP


def _separated(column: Sequence[Item], wanted: Sequence[tuple[float, float]]) -> list[float]:
    """The tops nearest to the wanted ones (least squares) that keep order and distances."""
    shift, shifts = 0.0, []
    for above, item in zip([None, *column], column, strict=False):
        shift += _distance(above, item) + (above.height + above.foot if above else 0.0)
        shifts.append(shift)
    blocks: list[tuple[float, float, int]] = []  # mean, weight, count
    for (y, weight), offset in zip(wanted, shifts, strict=True):
        blocks.append((y - offset, weight, 1))
        while len(blocks) > 1 and blocks[-2][0] > blocks[-1][0]:
            (a, u, m), (b, w, n) = blocks[-2:]
            blocks[-2:] = [((a * u + b * w) / (u + w), u + w, m + n)]
    means = [mean for mean, _, count in blocks for _ in range(count)]
    return [mean + offset for mean, offset in zip(means, shifts, strict=True)]


def _tracks(ways: Sequence[Way], at: Callable[[Port], float]) -> int:
    """Give every way that is not straight a track; returns how many there are.

    Going down, the way that starts lowest turns first (and going up the highest), which leaves
    the others uncrossed.
    """

    def span(way: Way) -> tuple[float, float]:
        heights = [at(port) for port in (way.root, *way.ends)]
        return min(heights), max(heights)

    def start(way: Way) -> tuple[float, float]:
        left = [way.root] if way.root.side > 0 else way.ends
        right = way.ends if way.root.side > 0 else [way.root]
        return (
            sum(at(port) for port in left) / len(left),
            sum(at(port) for port in right) / len(right),
        )

    bent = [way for way in ways if span(way)[1] - span(way)[0] > 0.5]
    down = sorted((w for w in bent if start(w)[1] >= start(w)[0]), key=lambda w: -start(w)[0])
    up = sorted((w for w in bent if start(w)[1] < start(w)[0]), key=lambda w: start(w)[0])
    placed: list[Way] = []
    count = 0
    for way in [*down, *up]:
        low, high = span(way)
        over = [
            other.track
            for other in placed
            if span(other)[0] < high + 4.0 and low < span(other)[1] + 4.0
        ]
        way.track = max(over) + 1 if over else 0
        count = max(count, way.track + 1)
        placed.append(way)
    return count
