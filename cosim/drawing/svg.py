"""Draws a system as SVG: boxes with ports, wires, power bonds, feedback.

    draw.to_svg(system, "bench.svg")

Wires that run to the left are feedback. The two wires of a power bond, effort one way and flow the
other, are thick. An open circle is an input that nothing drives.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from ..files import write_text
from .drawable import Drawable
from .layered import Layered, Port, Way
from .layers import Wire, columns

TITLE, SUBTITLE, LABEL, NOTE = 13.0, 10.0, 10.5, 9.5
"""Sizes of text."""
HEAD, ROW, PAD, EDGE = 38.0, 17.0, 9.0, 6.0
"""Height of a box's head and of a row of ports, distances of text inside it."""
BORDER, RADIUS = 22.0, 6.0
_RULES = {
    "text": 'font-family: "Helvetica Neue", Arial, "DejaVu Sans", sans-serif; fill: #1f2933',
    ".title": "font-size: 13px; font-weight: 600; text-anchor: middle",
    ".kind": "font-size: 10px; fill: #52606d; text-anchor: middle",
    ".port": "font-size: 10.5px",
    ".open": "fill: #7b8794; font-style: italic",
    ".note": "font-size: 9.5px; fill: #52606d",
    ".name": "font-size: 16px; font-weight: 600",
    ".about": "font-size: 11.5px; fill: #52606d",
    ".box": "fill: #ffffff; stroke: #52606d; stroke-width: 1.2",
    ".head": "fill: #e8edf3",
    ".wire": "fill: none; stroke: #52606d; stroke-width: 1.3; stroke-linejoin: round",
    ".stub": "stroke: #7b8794",
    ".free": "fill: #ffffff; stroke: #7b8794; stroke-width: 1.1",
    ".tip": "stroke: none; fill: #52606d",
    ".back": "stroke: #c2571a",
    ".bond": "stroke: #1c6e8c; stroke-width: 2.8",
    ".bond.back": "stroke: #59a5c0",
    ".loop": "stroke: #c81e1e; stroke-dasharray: 5 3",
    ".tip.back": "stroke: none; fill: #c2571a",
    ".tip.bond": "stroke: none; fill: #1c6e8c",
    ".tip.bond.back": "stroke: none; fill: #59a5c0",
    ".tip.loop": "stroke: none; fill: #c81e1e",
    ".halo": "fill: #fde3d3; stroke: #b3400a; stroke-width: 2.4",
    ".badge": "fill: #b3400a; stroke: #ffffff; stroke-width: 1.5",
    ".count": "font-size: 12px; font-weight: 700; fill: #ffffff; text-anchor: middle",
}
# rules reach a whole page if the drawing is part of one, so they are bound to its class
STYLE = "".join(f".cosim-system {name} {{ {rule} }}\n" for name, rule in _RULES.items())


_NO_MARKS: Mapping[str, Sequence[str]] = {}


@dataclass(frozen=True)
class _DrawnWire:
    """Connections that are drawn as one: a scalar, or the elements of a vector.

    Attributes:
        wire: for the layout.
        bond, loop: part of a power bond, or of an algebraic loop.
        note: factor and offset, "" where there are none.
        text: what a pointer over it shows.
    """

    wire: Wire
    bond: bool
    loop: bool
    note: str
    text: str


def svg(system: Drawable, marks: Mapping[str, Sequence[str]] | None = None) -> str:
    """A system as SVG.

    Args:
        system: what is drawn.
        marks: box -> short texts (a number, a letter) in badges on it; boxes with some stand out.
    """
    return "\n".join(_Drawing(system, marks or {}).lines()) + "\n"


def to_svg(system: Drawable, path: Path | str) -> Path:
    """Write a system as an SVG file."""
    path = Path(path)
    write_text(path, svg(system))
    return path


def _split(name: str) -> tuple[str, str]:
    """Vector and element of `q[2]`; no element for a scalar."""
    base, bracket, rest = name.rpartition("[")
    return (base, rest.rstrip("]")) if bracket and name.endswith("]") else (name, "")


def _lines(system: Drawable) -> list[_DrawnWire]:
    """The wires to be drawn, elements of vectors bundled."""
    efforts: set[tuple[str, str]] = set()
    flows: set[tuple[str, str]] = set()
    for bond in system.bonds():
        first = bond.first.partition(".")[0]
        for given, _, _ in bond.terms:
            targets = {c.target for c in system.connections if c.source == given}
            ends = {t for t in targets if t in {taken for _, taken, _ in bond.terms}}
            (efforts if given.startswith(f"{first}.") else flows).update((given, t) for t in ends)
    looped = {
        (a, b)
        for loop in system.algebraic_loops()
        for a, b in zip(loop, [*loop[1:], loop[0]], strict=True)
    }
    groups: dict[tuple[str, str, str, str], list[int]] = {}
    for index, wire in enumerate(system.connections):
        source, _, output = wire.source.partition(".")
        target, _, into = wire.target.partition(".")
        groups.setdefault((source, _split(output)[0], target, _split(into)[0]), []).append(index)
    found = []
    for (source, output, target, into), members in groups.items():
        wires = [system.connections[index] for index in members]
        names = [(w.source.partition(".")[2], w.target.partition(".")[2]) for w in wires]
        whole = len(wires) > 1
        pairs = {(w.source, w.target) for w in wires}
        effort, flow = bool(pairs & efforts), bool(pairs & flows)
        changes = {(w.gain, w.offset) for w in wires}
        (gain, offset), *others = sorted(changes)
        note = "" if (gain, offset) == (1.0, 0.0) else f"×{gain:.4g}" if gain != 1.0 else ""
        note += f"{offset:+.4g}" if offset else ""
        unit = system.unit(wires[0].target)
        count = f" ({len(wires)})" if whole else ""
        found.append(
            _DrawnWire(
                Wire(
                    source,
                    f"{output}[{len(wires)}]" if whole else names[0][0],
                    target,
                    f"{into}[{len(wires)}]" if whole else names[0][1],
                    # a bond runs the way its effort does
                    3.0 if effort else 0.01 if flow else 1.0,
                ),
                effort or flow,
                bool(pairs & looped),
                "…" if others else note,
                f"{source}.{output if whole else names[0][0]} → "
                f"{target}.{into if whole else names[0][1]}{count}"
                + (f" [{unit}]" if unit else ""),
            )
        )
    return found


def _width(text: str, size: float) -> float:
    """About the width of a text in a sans-serif font, rather too wide than too narrow."""
    narrow, wide = sum(c in "ijlftI.,[]()|' " for c in text), sum(c in "mwMWÅ@_" for c in text)
    return size * (0.60 * len(text) - 0.26 * narrow + 0.22 * wide)


class _Drawing:
    def __init__(self, system: Drawable, marks: Mapping[str, Sequence[str]] = _NO_MARKS) -> None:
        self.system, self.found, self.marks = system, _lines(system), marks
        self.open: dict[str, list[str]] = {name: [] for name in system.members}
        for name in system.open_inputs():
            instance, _, variable = name.partition(".")
            base, element = _split(variable)
            label = f"{base}[…]" if element else variable
            if label not in self.open[instance]:
                self.open[instance].append(label)
        wires = [line.wire for line in self.found]
        rooms = [_width(line.note, NOTE) + 34.0 if line.note else 0.0 for line in self.found]
        names = list(system.members)
        self.layout = Layered(names, wires, columns(names, wires), self._size, rooms)
        self.kinds: set[str] = set()

    def _size(self, name: str, left: list[Port], right: list[Port]) -> tuple[float, float]:
        for side in (left, right):
            for row, port in enumerate(side):
                port.offset = _row(row)
        labels = [port.name for port in left] + self.open[name]
        inside = max((_width(text, LABEL) for text in labels), default=0.0)
        inside += max((_width(port.name, LABEL) for port in right), default=0.0)
        width = max(
            inside + 2.0 * PAD + 16.0,
            _width(name, TITLE) * 1.08 + 2.0 * PAD,  # semibold
            _width(self.system.members[name].reference, SUBTITLE) + 2.0 * PAD,
            84.0,
        )
        return float(round(width)), HEAD + ROW * max(len(labels), len(right), 1) + EDGE

    # -- page --------------------------------------------------------------------------------------

    def lines(self) -> Iterator[str]:
        """The file, line by line."""
        layout, system = self.layout, self.system
        top = BORDER + (44.0 if system.text else 30.0)
        stub = 16.0 if any(self.open.values()) else 0.0
        marked = [name for name in system.members if self.marks.get(name)]
        inside = [line for name in marked for line in self._halo(name)]
        inside += [line for way in layout.ways for line in self._way(way, False)]
        inside += [
            line for way in layout.ways for line in self._way(way, True)
        ]  # bonds over signals
        inside += [
            line for index, entry in enumerate(layout.selves) for line in self._self(index, *entry)
        ]
        inside += [line for name in system.members for line in self._box(name)]
        legend = list(self._legend())
        width = max(
            layout.width + 2.0 * BORDER + stub,
            _width(system.name, 16.0) * 1.08 + 2.0 * BORDER,
            _width(system.text, 11.5) + 2.0 * BORDER,
            sum(_width(text, LABEL) + 58.0 for _, text in legend) + 2.0 * BORDER,
        )
        height = top + layout.height + 2.0 * BORDER + 18.0
        yield (
            f'<svg xmlns="http://www.w3.org/2000/svg" class="cosim-system" '
            f'viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" height="{height:.0f}">'
        )
        yield f"<title>{escape(system.name, quote=False)}</title>"
        yield f"<style>\n{STYLE}</style>"
        yield f'<rect width="{width:.0f}" height="{height:.0f}" fill="#ffffff"/>'
        yield _text("name", BORDER, BORDER + 12.0, system.name)
        if system.text:
            yield _text("about", BORDER, BORDER + 30.0, system.text)
        yield f'<g transform="translate({BORDER + stub:.0f} {top:.0f})">'
        yield from inside
        yield "</g>"
        x, y = BORDER, height - BORDER
        for kind, text in legend:
            if kind == "open":
                yield _circle("free", x + 12.0, y - 4.0)
                x += 22.0
            else:
                ends = (x, x + 32.0) if "back" not in kind else (x + 32.0, x)
                yield from self._arrow(f"M{ends[0]:.1f} {y - 4.0:.1f}H", ends[1], y - 4.0, kind, "")
                x += 40.0
            yield _text("port", x, y, text)
            x += _width(text, LABEL) + 18.0
        yield "</svg>"

    def _legend(self) -> Iterator[tuple[str, str]]:
        texts = {
            "": "signal", "back": "fed back", "bond": "power bond, effort",
            "bond back": "power bond, flow", "loop": "algebraic loop",
        }  # fmt: skip
        drawn = {"loop" if "loop" in kind else kind for kind in self.kinds}
        yield from ((kind, text) for kind, text in texts.items() if kind in drawn)
        if any(self.open.values()):
            yield "open", "open input"

    # -- wires -------------------------------------------------------------------------------------

    def _kind(self, members: list[int], back: bool) -> str:
        loop = any(self.found[index].loop for index in members)
        names = (("bond", self.found[members[0]].bond), ("back", back), ("loop", loop))
        kind = " ".join(name for name, given in names if given)
        self.kinds.add(kind)
        return kind

    def _way(self, way: Way, bond: bool) -> Iterator[str]:
        """The wires of a net between two columns."""
        layout, back = self.layout, way.root.side < 0
        x0, y0 = layout.x(way.root), layout.y(way.root)
        for end, members in zip(way.ends, way.wires, strict=True):
            if self.found[members[0]].bond != bond:
                continue
            kind = self._kind(members, back)
            x1, y1 = layout.x(end), layout.y(end)
            text = "; ".join(self.found[index].text for index in members)
            item = layout.items[end.box]
            if item.wire:  # on through the column
                x1 = layout.x(layout.port(item.name, "", -end.side))
                yield _path(kind, _bend(x0, y0, way.x, y1) + f"{x1:.1f}", text)
            else:
                yield from self._arrow(_bend(x0, y0, way.x, y1), x1, y1, kind, text)
                if note := self.found[members[0]].note:
                    x, anchor = (x1 - 12.0, "end") if not back else (x1 + 12.0, "start")
                    yield _text("note", x, y1 - 4.0, note, anchor)
        if len(way.ends) > 1 and bond == self.found[way.wires[0][0]].bond:
            heights = [layout.y(end) for end in way.ends]
            inner = sorted({y0, *heights})[1:-1]
            straight = any(abs(y - y0) <= 0.5 for y in heights)
            for y in dict.fromkeys([*inner, *([y0] if straight or y0 in inner else [])]):
                yield _circle(f"tip {self._kind(way.wires[0], back)}", way.x, y)

    def _self(self, number: int, index: int, out: Port, into: Port) -> Iterator[str]:
        """A wire from a box around its foot to itself."""
        layout, item = self.layout, self.layout.items[out.box]
        before = [entry for entry in layout.selves[:number] if entry[1].box == out.box]
        reach = 10.0 + 6.0 * len(before)
        x0, y0, x1, y1 = layout.x(out), layout.y(out), layout.x(into), layout.y(into)
        foot = item.y + item.height + reach - 1.0
        start = f"M{x0:.1f} {y0:.1f}H{x0 + reach:.1f}V{foot:.1f}H{x1 - reach - 8.0:.1f}V{y1:.1f}H"
        yield from self._arrow(start, x1, y1, self._kind([index], False), self.found[index].text)
        if note := self.found[index].note:
            yield _text("note", (x0 + x1) / 2.0, foot + 10.0, note, "middle")

    def _arrow(self, start: str, x: float, y: float, kind: str, text: str) -> Iterator[str]:
        """A path, complete but for its last x, with a tip there."""
        size = 5.2 if "bond" in kind else 4.2
        way = -1.0 if "back" in kind else 1.0
        yield _path(kind, f"{start}{x - way * 7.0:.1f}", text)
        tail = x - way * 1.9 * size
        points = f"{x:.1f},{y:.1f} {tail:.1f},{y - size:.1f} {tail:.1f},{y + size:.1f}"
        yield f'<polygon class="{f"tip {kind}".strip()}" points="{points}"/>'

    def _halo(self, name: str) -> Iterator[str]:
        """What makes a marked box stand out, below the wires."""
        item = self.layout.items[name]
        x, y = self.layout.box(item)
        yield (
            f'<rect class="halo" x="{x - 5:.1f}" y="{y - 5:.1f}" width="{item.width + 10:.0f}" '
            f'height="{item.height + 10:.0f}" rx="8"/>'
        )

    # -- boxes -------------------------------------------------------------------------------------

    def _box(self, name: str) -> Iterator[str]:
        item, member = self.layout.items[name], self.system.members[name]
        (x, y), w, h = self.layout.box(item), item.width, item.height
        yield "<g>"
        if member.description.text:
            yield f"<title>{escape(member.description.text, quote=False)}</title>"
        yield f'<rect class="box" x="{x:.1f}" y="{y:.1f}" width="{w:.0f}" height="{h:.0f}" rx="5"/>'
        yield (
            f'<path class="head" d="M{x + 0.6:.1f} {y + HEAD:.1f}v{5.6 - HEAD:.1f}q0 -5 5 -5'
            f'h{w - 11.2:.1f}q5 0 5 5v{HEAD - 5.6:.1f}z"/>'
        )
        yield _text("title", x + w / 2.0, y + 17.0, name)
        yield _text("kind", x + w / 2.0, y + 31.0, member.reference)
        left = 0
        for port in item.ports.values():
            at = y + port.offset + 3.6
            if port.side < 0:
                left += 1
                yield _text("port", x + PAD, at, port.name)
            else:
                yield _text("port", x + w - PAD, at, port.name, "end")
        for row, label in enumerate(self.open[name], left):
            at = y + _row(row)
            yield f'<path class="wire stub" d="M{x - 9.0:.1f} {at:.1f}H{x:.1f}"/>'
            yield _circle("free", x - 11.5, at)
            yield _text("port open", x + PAD, at + 3.6, label)
        for number, mark in enumerate(self.marks.get(name, ())):
            middle = x + w - 6.0 - 22.0 * number
            yield f'<circle class="badge" cx="{middle:.1f}" cy="{y - 5:.1f}" r="10.5"/>'
            yield _text("count", middle, y - 0.8, mark)
        yield "</g>"


def _row(number: int) -> float:
    """Height of a port's row below the top of its box."""
    return HEAD + ROW * (number + 0.5) + EDGE / 2.0


def _text(kind: str, x: float, y: float, text: str, anchor: str = "") -> str:
    where = f' text-anchor="{anchor}"' if anchor else ""
    return f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}"{where}>{escape(text, quote=False)}</text>'


def _circle(kind: str, x: float, y: float) -> str:
    return f'<circle class="{kind.strip()}" cx="{x:.1f}" cy="{y:.1f}" r="2.6"/>'


def _path(kind: str, d: str, text: str) -> str:
    head = f'<path class="{f"wire {kind}".strip()}" d="{d}"'
    return f"{head}><title>{escape(text, quote=False)}</title></path>" if text else f"{head}/>"


def _bend(x0: float, y0: float, x: float, y1: float) -> str:
    """Sideways to the track, up or down with round corners, sideways; without the last x."""
    if abs(y1 - y0) <= 0.5:
        return f"M{x0:.1f} {y0:.1f}H"
    r = min(RADIUS, abs(y1 - y0) / 2.0, abs(x - x0))
    h = r if x > x0 else -r
    v = r if y1 > y0 else -r
    return (
        f"M{x0:.1f} {y0:.1f}H{x - h:.1f}q{h:.1f} 0 {h:.1f} {v:.1f}V{y1 - v:.1f}"
        f"q0 {v:.1f} {h:.1f} {v:.1f}H"
    )
