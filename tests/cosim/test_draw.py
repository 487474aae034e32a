"""Drawings of systems: complete, legible, without overlaps, always the same."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import pytest
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath

from cosim import System, read_system
from cosim.drawing import svg as draw
from cosim.drawing.layers import Wire, columns
from cosim.drawing.svg import _Drawing
from tests.fmus import fmu

SYSTEMS = Path(__file__).parents[2] / "scenarios" / "systems"
SVG = "{http://www.w3.org/2000/svg}"


class Built:
    def path(self, variant: str) -> Path:
        return fmu(variant)


@lru_cache(maxsize=None)
def stored(name: str) -> System:
    return read_system(SYSTEMS / f"{name}.toml").build(Built())


def ring(affine: Path, size: int = 9) -> System:
    """Each follows the one before; the first also drives all others; wires pass many columns."""
    system = System("ring", text="nine in a ring & <one> to all")
    for k in range(size):
        system.add(f"cell{k}", str(affine))
    for k in range(size):
        system.connect(f"cell{k}.y", f"cell{(k + 1) % size}.u")
    for k in range(1, size):
        system.connect("cell0.next", f"cell{k}.n")
    system.connect("cell3.off", "cell3.on", factor=-1.0, offset=1.0)
    return system


@pytest.fixture(params=["motor_bench", "mir250", "mobile_manipulator", "ring"])
def system(request: pytest.FixtureRequest, affine: Path) -> System:
    return ring(affine) if request.param == "ring" else stored(request.param)


def boxes(drawing: _Drawing) -> dict[str, tuple[float, float, float, float]]:
    found = {}
    for name in drawing.system.members:
        item = drawing.layout.items[name]
        x, y = drawing.layout.box(item)
        found[name] = (x, y, x + item.width, y + item.height)
    return found


def segments(d: str) -> list[tuple[float, float, float, float]]:
    """Straight parts of a path of M, H, V and q."""
    found = []
    x = y = 0.0
    for command, text in re.findall(r"([MHVq])([-\d. ]+)", d):
        numbers = [float(item) for item in text.split()]
        if command == "M":
            x, y = numbers
        elif command == "H":
            found.append((x, y, numbers[0], y))
            x = numbers[0]
        elif command == "V":
            found.append((x, y, x, numbers[0]))
            y = numbers[0]
        else:
            x, y = x + numbers[2], y + numbers[3]
    return found


def test_everything_is_there(system: System) -> None:
    root = ET.fromstring(system.svg())
    texts = [element.text for element in root.iter(f"{SVG}text")]
    titles = " ".join(element.text or "" for element in root.iter(f"{SVG}title"))
    for member in system.members.values():
        assert member.name in texts and member.reference in texts
    for wire in system.connections:
        source, target = (re.sub(r"\[\d+\]$", "", name) for name in (wire.source, wire.target))
        assert re.search(
            rf"{re.escape(source)}(\[\d+\])? → {re.escape(target)}(\[\d+\])?", titles
        ), wire  # fmt: skip


def test_boxes_do_not_overlap(system: System) -> None:
    found = list(boxes(_Drawing(system)).values())
    for index, (x0, y0, x1, y1) in enumerate(found):
        for a0, b0, a1, b1 in found[:index]:
            assert x1 <= a0 or a1 <= x0 or y1 + 8.0 <= b0 or b1 + 8.0 <= y0


def test_wires_run_between_boxes(system: System) -> None:
    drawing = _Drawing(system)
    root = ET.fromstring("\n".join(drawing.lines()))
    group = root.find(f"{SVG}g")
    assert group is not None
    checked = 0
    for path in group.findall(f"{SVG}path"):
        if not path.get("class", "").startswith("wire"):
            continue
        for x0, y0, x1, y1 in segments(path.attrib["d"]):
            left, right, top, bottom = min(x0, x1), max(x0, x1), min(y0, y1), max(y0, y1)
            for name, (a, b, c, d) in boxes(drawing).items():
                inside = left < c - 0.6 and right > a + 0.6 and top < d - 0.6 and bottom > b + 0.6
                assert not inside, (name, path.find(f"{SVG}title").text)
            checked += 1
    assert checked >= len(drawing.found)


def test_vertical_tracks_do_not_lie_on_each_other(system: System) -> None:
    layout = _Drawing(system).layout
    spans: dict[float, list[tuple[float, float]]] = {}
    for way in layout.ways:
        heights = [layout.y(port) for port in (way.root, *way.ends)]
        if max(heights) - min(heights) > 0.5:
            spans.setdefault(way.x, []).append((min(heights), max(heights)))
    for found in spans.values():
        found.sort()
        for (_, end), (start, _) in pairwise(found):
            assert end < start


def test_lines_of_different_nets_are_apart(system: System) -> None:
    """Horizontal parts between the same columns: nearer than 4 they would look like one."""
    layout = _Drawing(system).layout
    lines: dict[int, list[tuple[int, float, float, float]]] = {}
    for number, way in enumerate(layout.ways):
        for port in (way.root, *way.ends):
            ends = sorted((layout.x(port), way.x))
            lines.setdefault(way.layer, []).append((number, layout.y(port), *ends))
    for found in lines.values():
        for index, (way, y, left, right) in enumerate(found):
            for other, y1, left1, right1 in found[:index]:
                beside = min(right, right1) - max(left, left1)
                assert way == other or abs(y - y1) >= 4.0 or beside < 12.0


@pytest.mark.slow
def test_texts_fit_their_boxes(system: System) -> None:
    """Measured in DejaVu Sans, which is wider than what the style asks for first."""
    drawing = _Drawing(system)

    @lru_cache(maxsize=None)
    def width(text: str, size: float, weight: str = "normal") -> float:
        font = FontProperties(family="DejaVu Sans", weight=weight)
        return TextPath((0, 0), text, size=size, prop=font).get_extents().width

    for name, member in system.members.items():
        item = drawing.layout.items[name]
        assert width(name, draw.TITLE, "semibold") < item.width - 4.0
        assert width(member.reference, draw.SUBTITLE) < item.width - 4.0
        sides = [[p for p in item.ports.values() if p.side == side] for side in (-1, 1)]
        left = [port.name for port in sides[0]] + drawing.open[name]
        right = [port.name for port in sides[1]]
        for row in range(max(len(left), len(right))):
            pair = [text[row] for text in (left, right) if row < len(text)]
            assert sum(width(text, draw.LABEL) for text in pair) < item.width - 2.0 * draw.PAD


def test_the_same_system_gives_the_same_drawing(system: System) -> None:
    assert draw.svg(system) == draw.svg(system)


def test_few_wires_cross() -> None:
    layout = _Drawing(stored("mobile_manipulator")).layout
    # x, y, z and phi of the base go to two sensors each: of every two, one pair must cross
    assert layout.crossings() == 6
    assert _Drawing(stored("mir250")).layout.crossings() == 0


def test_power_bonds_and_feedback_are_marked() -> None:
    root = ET.fromstring(stored("mobile_manipulator").svg())
    kinds: dict[str, set[str]] = {}
    for path in root.iter(f"{SVG}path"):
        title = path.find(f"{SVG}title")
        if title is not None and title.text:
            kinds.setdefault(path.attrib["class"], set()).add(title.text.partition(" [")[0])
    assert "motor_left.tau → gearbox_left.tau_a" in kinds["wire bond"]
    assert "gearbox_left.w_a → motor_left.w" in kinds["wire bond back"]
    assert "drive.tau → arm.tau (6)" in kinds["wire bond"]
    assert "arm.q → drive.q (6)" in kinds["wire back"]
    assert "base.x → world_sensor.x" in kinds["wire"]


def test_algebraic_loops_are_marked() -> None:
    system = System("loop", Built())
    system.add("a", "gearbox/ratio")
    system.add("b", "gearbox/ratio")
    system.connect("a.tau_b", "b.tau_a")
    system.connect("b.tau_b", "a.tau_a", factor=0.01)
    text = system.svg()
    assert "wire loop" in text and "algebraic loop" in text and "×0.01" in text


def test_columns_follow_the_flow() -> None:
    wires = [
        Wire("plant", "y", "control", "y"),
        Wire("control", "u", "plant", "u", 3.0),
        Wire("set", "r", "control", "r"),
        Wire("far", "x", "plant", "d"),
    ]
    names = ["plant", "control", "set", "far"]
    assert columns(names, wires) == {"set": 0, "control": 1, "plant": 2, "far": 1}


def test_files(tmp_path: Path, affine: Path) -> None:
    path = ring(affine).to_svg(tmp_path / "deep" / "ring.svg")
    assert "nine in a ring &amp; &lt;one&gt; to all" in path.read_text(encoding="utf-8")
    single = System("single")
    single.add("a", str(affine))
    assert ET.fromstring(single.svg()).tag == f"{SVG}svg"
