"""How results show themselves in a notebook: a title, charts without scripts, tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from .chart import COLOURS, Line, lines
from .html import Html, join, tag, unit

Vector = NDArray[np.float64]
SIGNALS, CHARTS = 8, 4
"""Lines of a chart, and charts of a view."""
STYLE = """
.cosim-view{font:14px/1.45 system-ui,sans-serif;max-width:760px;color:#1f2933;background:#fff;
padding:.5em .8em;border:1px solid #e3e8ee;border-radius:6px}
.cosim-view svg{width:100%;height:auto;font:11px system-ui,sans-serif;fill:#5b6875}
.cosim-view svg .title{font-weight:600;fill:#1f2933}
.cosim-view .key{margin-right:1.2em;font-size:12px}
.cosim-view .key i{display:inline-block;width:1.2em;height:.25em;margin-right:.4em;
vertical-align:.25em}
.cosim-view table{border-collapse:collapse;font-size:13px;margin:.4em 0;color:inherit}
.cosim-view :is(th,td){padding:.15em .7em;text-align:right;border-bottom:1px solid #e3e8ee;
background:#fff;white-space:nowrap}
.cosim-view :is(th,td):first-child,.cosim-view :is(td,th).text{text-align:left}
.cosim-view td.text{white-space:normal}
.cosim-view th button{all:unset}
.cosim-view .wide{overflow-x:auto}
.cosim-view .over{color:#b3400a;font-weight:600}
.cosim-view .good{color:#15703a}
.cosim-view .command button{display:none}
.cosim-view p{margin:.3em 0}
.cosim-view small{color:#5b6875}
"""


def view(title: object, about: object, *parts: object) -> str:
    """A result as HTML for a notebook."""
    head = tag("p", tag("b", title), " ", tag("small", about))
    return tag("div", Html(f"<style>{STYLE}</style>"), head, join(*parts), class_="cosim-view")


def signal_charts(
    time: Vector, columns: Mapping[str, Vector], units: Mapping[str, str]
) -> tuple[Html, int]:
    """Charts of signals over time, one per unit, and how many signals are in none of them.

    Args:
        time: [s].
        columns: signal -> values.
        units: signal -> unit.
    """
    groups: dict[str, list[str]] = {}
    for name in columns:
        groups.setdefault(units.get(name, ""), []).append(name)
    shown, charts = 0, []
    for of, names in list(groups.items())[:CHARTS]:
        items = [
            Line(name, time, np.asarray(columns[name], dtype=np.float64), colour)
            for name, colour in zip(names, COLOURS, strict=False)
        ]
        shown += len(items)
        title = names[0] if len(names) == 1 else "signals"
        charts.append(lines(items, title=f"{title} [{unit(of)}]" if unit(of) else title))
    return join(*charts), len(columns) - shown


def more(count: int) -> Html:
    """A line on what is not shown."""
    return tag("small", f"and {count} more") if count > 0 else Html("")


def key_values(pairs: Sequence[tuple[str, object]]) -> Html:
    """Short facts in a line."""
    items = [join(name, ": ", tag("b", value)) for name, value in pairs]
    return tag("p", *(piece for item in items for piece in (item, Html(" &nbsp; "))))
