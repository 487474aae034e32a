"""Which run would separate two explanations best."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..calibrate.parts import Run
from ..calibrate.problem import Problem
from ..errors import CosimError
from ..signals import Table
from .linear import Layout
from .models import Fitted
from .secant import model_values

Vector = NDArray[np.float64]
FACTORS = (1.0, -1.0, 0.3, 1.5)
"""The library: every run of the data set again, reversed, gentler and stronger."""
ENOUGH = 4.0
"""Distance in standard deviations at which two explanations are told apart reliably (2 for the
decision plus 2 for its power)."""


def scaled(run: Run, factor: float) -> Run | None:
    """A run with its inputs scaled; None if they cannot be."""
    inputs = {}
    for name, signal in run.inputs.items():
        if not isinstance(signal, Table):
            return None
        inputs[name] = Table(
            signal.times, np.asarray(signal.values) * factor, unit=signal.unit,
            interpolation=signal.interpolation, text=signal.text,
        )  # fmt: skip
    return replace(run, inputs=inputs)


def propose(first: Fitted, second: Fitted) -> dict[str, Any] | None:
    """The run of the library in which two fitted models differ most, and by how much per channel.

    What calibration of the first would absorb in that run alone is not subtracted, since the runs
    at hand already fix the declared parameters.
    """
    best: dict[str, Any] | None = None
    for run in first.problem.runs:
        for factor in FACTORS:
            changed = scaled(run, factor) if factor != 1.0 else run
            if changed is None:
                continue
            try:
                distance, channels = _distance(first, second, changed)
            except (CosimError, ValueError):
                continue
            if best is None or distance > best["distance"]:
                names = [c.name for c in first.problem.channels]
                best = {
                    "run": run.name,
                    "input_factor": factor,
                    "distance": distance,
                    "repetitions": max(int(np.ceil((ENOUGH / max(distance, 1e-9)) ** 2)), 1),
                    "channels": dict(zip(names, channels, strict=True)),
                }
    return best


def _distance(first: Fitted, second: Fitted, run: Run) -> tuple[float, list[float]]:
    values = []
    layout = None
    for item in (first, second):
        p = item.problem
        problem: Problem = p._with(runs=[run], parameters=p.parameters)
        layout = Layout(problem, [run])
        values.append(model_values(problem, item.estimate.theta, layout))
        problem.close()
    assert layout is not None
    squares = np.bincount(layout.channel, (values[1] - values[0]) ** 2, layout.channels)
    return float(np.sqrt(squares.sum())), np.sqrt(squares).tolist()
