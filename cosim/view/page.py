"""A recording in 3D as one web page that works without a server and without a network."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data.comparison import Reference, convert_reference
from ..data.recording import Recording
from ..errors import UnknownNameError, ValueRangeError
from ..files import write_text
from ..spec.scene import evaluate, formulas, mapped, names

Vector = NDArray[np.float64]
FRAMES = 1500
"""Most frames of a page: a quarter of a minute at 100 per second, between which it interpolates."""
PLOTS, SIGNALS = 3, 400
"""Plots of a page, and most signals that it can plot."""
DEFAULTS = {"at": [0, 0, 0], "opacity": 1.0, "axis": "z"}
PALETTE = ("#2f6fb3", "#7a3e9d", "#23855b", "#b3541e", "#8a7a12", "#3f6b7d", "#a1325b", "#4b5b8c")
"""Of instances: their paths, and their bodies where several instances look the same."""

PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
html,body{{height:100%;margin:0}}
body{{font:14px/1.4 system-ui,sans-serif;color:#1f2937;display:grid;
grid-template:auto 1fr auto/1fr minmax(260px,26%)}}
header{{grid-column:1/3;padding:.5em 1em;display:flex;gap:1.2em;align-items:baseline;
border-bottom:1px solid #e5e7eb}}h1{{font-size:1.05em;margin:0}}
#stage{{position:relative;min-height:0}}#scene{{position:absolute;width:100%;
height:100%;touch-action:none}}#scale{{position:absolute;right:.8em;bottom:.5em;color:#6b7280}}
#groups{{position:absolute;left:.8em;top:.6em;display:flex;flex-direction:column;gap:.1em}}
#groups label{{display:flex;align-items:center;gap:.3em}}.mark{{width:.8em;height:.8em;
border-radius:50%}}aside{{border-left:1px solid #e5e7eb;padding:.5em;min-height:0;display:flex;
flex-direction:column}}#plots{{flex:1;display:flex;flex-direction:column;gap:.4em;min-height:0}}
#plots>div{{flex:1;display:flex;flex-direction:column;min-height:0}}#plots canvas{{flex:1;
width:100%;min-height:0;touch-action:none}}select,button{{font:inherit}}#plots select{{
max-width:100%;border:0;background:none;color:#1f2937}}
footer{{grid-column:1/3;display:flex;gap:.8em;align-items:center;padding:.5em 1em;
border-top:1px solid #e5e7eb}}#slider{{flex:1}}#clock{{width:5em;text-align:right;
font-variant-numeric:tabular-nums}}.note{{color:#6b7280}}
</style></head><body>
<header><h1>{title}</h1><span class="note">{note}</span><span id="message" class="note"></span>
</header>
<div id="stage"><canvas id="scene"></canvas><div id="groups"></div><div id="scale"></div></div>
<aside><div id="plots"></div></aside>
<footer><button id="play">Play</button>
<select id="speed" title="speed">{speeds}</select>
<input id="slider" type="range"><span id="clock"></span>
<select id="from" title="seen from"><option>oblique</option><option>above</option>
<option>side</option><option>behind</option></select>
<label><input id="follow" type="checkbox"> follow</label><button id="fit">Fit</button></footer>
<script id="content" type="application/json">{content}</script>
<script>{script}</script></body></html>
"""
SPEEDS = (0.1, 0.25, 0.5, 1, 2, 5, 10)


class Channels:
    """Values over the frames, each once; a number where nothing changes."""

    def __init__(self, count: int) -> None:
        self._count, self._index = count, dict[bytes, int]()
        self.rows: list[NDArray[np.float32]] = []

    def put(self, values: Any) -> float | list[int]:
        """A number, or the channel of an array in brackets."""
        row = np.broadcast_to(np.asarray(values, dtype=np.float32), (self._count,))
        if (row == row[0]).all():
            return float(row[0])
        return [self.channel(row)]

    def channel(self, values: Any) -> int:
        """The channel of an array."""
        row = np.array(np.broadcast_to(values, (self._count,)), dtype=np.float32)
        key = row.tobytes()
        if key not in self._index:
            self._index[key] = len(self.rows)
            self.rows.append(row)
        return self._index[key]


def view_page(
    recording: Recording,
    references: Sequence[Reference] = (),
    title: str = "",
    plots: Sequence[str] = (),
) -> str:
    """A page with the systems of a recording in 3D, its time and its curves.

    Args:
        recording: of `cosim.run` or of a twin that `cosim.open` opened.
        references: measured signals: they are shown beside the curves, and as a ghost beside what
            they place.
        title: of the page; the scenario's name if not given.
        plots: signals that are plotted at first.

    Raises:
        ValueRangeError: nothing in it has a scene, or it is empty.
    """
    title = title or str(recording.provenance.get("scenario") or "recording")
    found = content(recording, references, plots)
    where = recording.provenance
    note = f"{where.get('algorithm', '')}, steps of {float(where.get('step_s', 0.0)):g} s"
    speeds = "".join(
        f'<option value="{s}"{" selected" if s == 1 else ""}>{s} x</option>' for s in SPEEDS
    )
    script = Path(__file__).with_name("viewer.js").read_text(encoding="utf-8")
    return PAGE.format(
        title=escape(title), note=escape(note), speeds=speeds, script=script,
        content=json.dumps(found, separators=(",", ":")).replace("</", "<\\/"),
    )  # fmt: skip


def write_view(
    path: Path | str,
    recording: Recording,
    references: Sequence[Reference] = (),
    title: str = "",
    plots: Sequence[str] = (),
) -> Path:
    """Write the page of `view_page`; the path.

    Raises:
        ValueRangeError: as of `view_page`.
    """
    path = Path(path)
    write_text(path, view_page(recording, references, title, plots))
    return path


def content(
    recording: Recording, references: Sequence[Reference], plots: Sequence[str]
) -> dict[str, Any]:
    """What the script shows.

    Raises:
        ValueRangeError: as of `view_page`.
    """
    scenes = recording.provenance.get("scene") or {}
    if not scenes:
        raise ValueRangeError(
            "nothing in this recording has a scene: its FMUs carry none, or it was not made by "
            "cosim run, cosim.run or cosim.open; docs/view.md says how an FMU gets one"
        )
    if not len(recording):
        raise ValueRangeError("the recording is empty: there is nothing to show")
    rows = np.unique(np.linspace(0, len(recording) - 1, FRAMES).round().astype(np.int64))
    rows = rows if len(recording) > FRAMES else np.arange(len(recording))
    times, channels = recording.time[rows], Channels(rows.size)
    columns = {name: column for column, name in enumerate(recording.names)}
    measured = _measured(recording, references, times)

    def modelled(name: str) -> Vector:
        found: Vector = recording.values[rows, columns[name]]
        return found

    def reported(name: str) -> Vector:
        return measured[name] if name in measured else modelled(name)

    nodes: list[dict[str, Any]] = []
    tints = _tints(scenes)
    for number, (instance, scene) in enumerate(scenes.items()):
        colour = PALETTE[number % len(PALETTE)]
        nodes += _nodes(
            instance,
            scene,
            len(nodes),
            columns,
            modelled,
            channels,
            colour,
            tints.get(instance, ""),
        )
        ghosts = _placed(instance, scene, measured)
        if ghosts:
            extra = _nodes(instance, scene, len(nodes), columns, reported, channels, colour, "")
            for node, original in zip(extra, scene, strict=True):
                node.update(measured=True, group=f"{instance}, measured")
                if original["name"] not in ghosts:
                    node.update(shapes=[], trail=False)
            nodes += extra
    shown = [name for name in recording.names if np.isfinite(modelled(name)).all()][:SIGNALS]
    signals = [
        {
            "name": name,
            "unit": recording.units.get(name, ""),
            "channel": channels.channel(modelled(name)),
        }
        | ({"measured": channels.channel(measured[name])} if name in measured else {})
        for name in shown
    ]
    wanted = dict.fromkeys(
        [*(n for n in plots if n in shown), *(n for n in measured if n in shown), *shown]
    )
    groups = {
        node["group"]: "#e8710a" if node.get("measured") else _hex(node["rgb"]) for node in nodes
    }
    blob = np.concatenate(channels.rows) if channels.rows else np.zeros(0, dtype=np.float32)
    leaders = [i for i, node in enumerate(nodes) if node["trail"]] or [0]
    return {
        "times": [round(float(time), 9) for time in times],
        "samples": base64.b64encode(blob.astype("<f4").tobytes()).decode(),
        "nodes": nodes,
        "groups": [{"name": name, "colour": colour} for name, colour in groups.items()],
        "signals": signals,
        "plots": list(wanted)[:PLOTS],
        "follow": leaders[0],
        "size": _size(nodes),
    }


def _nodes(
    instance: str, scene: Sequence[Mapping[str, Any]], first: int, columns: Mapping[str, int],
    value: Callable[[str], Vector], channels: Channels, colour: str, tint: str,
) -> list[dict[str, Any]]:  # fmt: skip
    """Nodes as the script takes them; what names a signal that was not recorded is left out."""
    places = {node["name"]: first + index for index, node in enumerate(scene)}

    def recorded(item: Any) -> bool:
        return all(f"{instance}.{name}" in columns for f in formulas(item) for name in names(f))

    def number(formula: float | str) -> Any:
        return channels.put(evaluate(formula, lambda name: value(f"{instance}.{name}")))

    found = []
    for node in scene:
        shapes = [mapped({**DEFAULTS, **item}, number) for item in node["shapes"] if recorded(item)]
        for shape in shapes:
            shape["rgb"] = _mixed(shape.pop("colour", "#9aa3ad"), tint)
        found.append(
            {
                "name": f"{instance}: {node['name']}",
                "group": instance,
                "parent": places[node["parent"]] if "parent" in node else -1,
                "pose": [mapped(item, number) for item in node["pose"] if recorded(item)],
                "shapes": shapes,
                "trail": bool(node.get("trail")),
                "rgb": _mixed(colour, ""),
            }
        )
    return found


def _measured(
    recording: Recording, references: Sequence[Reference], times: Vector
) -> dict[str, Vector]:
    """Measured signals at these times, held beyond their ends."""
    found: dict[str, Vector] = {}
    for reference in references:
        try:
            values = convert_reference(recording, reference)
        except UnknownNameError:
            continue
        for name, column in zip(reference.signals, values.T, strict=True):
            good = np.isfinite(column)
            if good.any():
                found[name] = np.interp(times, np.asarray(reference.times)[good], column[good])
    return found


def _placed(
    instance: str, scene: Sequence[Mapping[str, Any]], measured: Mapping[str, Vector]
) -> set[str]:
    """Nodes that measured signals place, and all below them."""
    found: set[str] = set()
    for node in scene:
        used = {f"{instance}.{name}" for f in formulas(node["pose"]) for name in names(f)}
        if node.get("parent") in found or used & measured.keys():
            found.add(node["name"])
    return found


def _tints(scenes: Mapping[str, Sequence[Mapping[str, Any]]]) -> dict[str, str]:
    """Colours for instances that would look the same."""
    looks = {instance: tuple(n["name"] for n in nodes) for instance, nodes in scenes.items()}
    alike = list(looks.values())
    return {
        instance: PALETTE[number % len(PALETTE)]
        for number, (instance, look) in enumerate(looks.items())
        if alike.count(look) > 1
    }


def _rgb(colour: str) -> list[float]:
    digits = colour.lstrip("#")
    digits = "".join(2 * c for c in digits) if len(digits) == 3 else digits
    return [int(digits[i : i + 2], 16) / 255.0 for i in (0, 2, 4)]


def _hex(rgb: Sequence[float]) -> str:
    return "#" + "".join(f"{round(255 * part):02x}" for part in rgb)


def _mixed(colour: str, tint: str) -> list[float]:
    """A colour, half way to a tint."""
    own, other = _rgb(colour), _rgb(tint or colour)
    return [round(0.5 * (a + b), 4) for a, b in zip(own, other, strict=True)]


def _size(nodes: Sequence[Mapping[str, Any]]) -> float:
    """About how large the largest thing is [m]."""
    sizes = [
        float(part)
        for node in nodes
        for shape in node["shapes"]
        for key in ("box", "cylinder", "sphere", "frame")
        for part in (shape[key] if isinstance(shape.get(key), list) else [shape.get(key)])
        if isinstance(part, (int, float))
    ]
    return max([0.1, *sizes])
