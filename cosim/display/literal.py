"""Texts of pictures letter by letter."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def literal(figure: Figure) -> Figure:
    """The figure, in whose titles, labels and keys a `$` is a `$`, and begins no formula.

    Numbers at the axes stay as they are: those of a logarithmic axis are formulas.
    """
    from matplotlib.text import Text

    numbers = {
        text
        for axes in figure.axes
        for axis in (axes.xaxis, axes.yaxis)
        for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks())
        for text in (tick.label1, tick.label2)
    }
    for text in figure.findobj(Text):
        if text not in numbers:
            text.set_parse_math(False)
    return figure
