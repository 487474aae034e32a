"""Pictures: texts are drawn letter by letter, and constants however large."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from cosim.display.chart import Line, lines
from cosim.display.literal import literal


def test_a_dollar_begins_no_formula_and_logarithms_keep_theirs(tmp_path: Path) -> None:
    figure = Figure()
    axes = figure.subplots()
    axes.loglog([1.0, 100.0], [1.0, 10.0], label=r"\foo_ $")
    axes.set_title(r"from $\foo_ to $5")  # as a formula: an error while it is drawn
    axes.legend()
    figure.suptitle("cost of $5_ or $7")
    literal(figure).savefig(tmp_path / "plot.svg")
    numbers = [text for text in axes.get_xticklabels() if "10^{" in text.get_text()]
    assert numbers and all(text.get_parse_math() for text in numbers)


@pytest.mark.parametrize("value", [0.0, 1.0, 1e16, -1.7e18])
def test_a_constant_has_a_chart(value: float) -> None:
    drawn = str(lines([Line("x", np.arange(3.0), np.full(3, value), "#000")], title="x"))
    assert drawn.count("<path") >= 2 and "nan" not in drawn
