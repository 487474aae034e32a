"""Noise of logged inputs that drive the model: what it adds to the residuals of a run.

A logged speed e_k off at sample k drives the model wrongly from there on: what it integrates from
white noise is a random walk (heading). To first order, with g_k the response of all channels to the
input's sample k over their noise, the residuals of a right model have the covariance

    C = 1 + A A',    A = sigma (g_1, g_2, ...)

and `whitening` makes them white. A is taken once, at the declared system's nominal values, and is
the same for all models that are compared: the determinant of C cancels. Inputs that one column
drives share its noise: they are moved at once. What the anchor of relative poses adds (`anchored`)
is the same for all samples of a run, and counts beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..data.signals import Table
from .anchored import anchor_noise, anchor_sizes
from .between import Parts
from .checks.finding import Finding
from .whitening import LEAST, InputNoise

if TYPE_CHECKING:
    from .parts import MeasuredRun
    from .simulator import Simulator

Vector = NDArray[np.float64]
NODES = 25
"""Moments of a run at which an input is moved; responses to others are interpolated."""
BLOCKS = 150
"""Columns of an input: samples are taken together, lest there be more. Their mean is kept exactly,
and so is what the model integrates from it once they are over; what it does meanwhile (a bridge
between both ends, of a sixth of their variance) counts as more noise of these samples."""
LARGE = 10.0
"""Times its noise by which an input is moved: far above rounding, and still a small speed."""


def propagated(simulator: Simulator) -> tuple[Simulator, list[Finding]]:
    """The simulator of a problem that counts noise of its inputs and anchors; notes on inputs.

    Args:
        simulator: of the problem at its nominal values, whose runs say how noisy inputs are.

    Raises:
        CosimError: it cannot be simulated.
    """
    problem = simulator.problem
    noisy = any(sigma for run in problem.runs for sigma in run.noisy.values())
    if not noisy and not problem.relative:
        return simulator, []
    sizes = anchor_sizes(problem)
    found = simulator.spread(
        lambda run: _noise(simulator, run, anchor_noise(problem, run, sizes)), problem.runs
    )
    largest: dict[tuple[str, ...], tuple[float, float, str]] = {}
    runs = []
    for run, (noise, moved) in zip(problem.runs, found, strict=True):
        runs.append(replace(run, noise=noise))
        for targets, (size, channel) in moved.items():
            if size > largest.get(targets, (0.0, 0.0, ""))[0]:
                largest[targets] = size, abs(run.noisy[targets[0]]), channel
    findings = [
        Finding(
            "note", "input", "", ", ".join(targets),
            f"its noise of {sigma:.3g} moves {channel} by up to {size:.3g} times that channel's "
            "own; intervals and tests count it",
        )
        for targets, (size, sigma, channel) in largest.items() if size**2 > LEAST
    ]  # fmt: skip
    return simulator.of(problem.changed(runs=runs)), findings


def _noise(
    simulator: Simulator, run: MeasuredRun, parts: list[Vector]
) -> tuple[InputNoise | None, dict[tuple[str, ...], tuple[float, str]]]:
    """Directions of a run; inputs -> the largest deviation that they give a channel, and which.

    Args:
        simulator, run: of the problem.
        parts: columns of A that are known.
    """
    channels = [c.name for c in simulator.problem.channels]
    parts, sizes = list(parts), {}
    beyond = np.zeros(run.data.shape)
    for tables in _shared(run):
        part, bridges = _columns(simulator, run, tables)
        beyond += bridges
        spread = np.sqrt(np.sum(part**2, axis=2))
        place = np.unravel_index(int(np.argmax(spread)), spread.shape)
        sizes[tuple(tables)] = float(spread[place]), channels[int(place[1])]
        parts.append(part)
    if not parts:
        return None, sizes
    weights = 1.0 / np.sqrt(1.0 + beyond)
    return InputNoise.of(np.concatenate(parts, axis=2) * weights[:, :, None], weights), sizes


def _shared(run: MeasuredRun) -> list[dict[str, Table]]:
    """The noisy inputs of a run, by the column that drives them.

    Those that take one column in different ways (`hold` and `window`) have its noise in different
    ways, and count one by one.
    """
    found: dict[tuple[str, int, bytes], dict[str, Table]] = {}
    for target, sigma in run.noisy.items():
        table = run.inputs[target]
        if isinstance(table, Table) and sigma:
            key = table.text, _parts(table), table.times.tobytes()
            found.setdefault(key, {})[target] = table
    return list(found.values())


def _parts(table: Table) -> int:
    """Values of a table that share one noise."""
    return table.parts if isinstance(table, Parts) else 1


def _columns(
    simulator: Simulator, run: MeasuredRun, tables: Mapping[str, Table]
) -> tuple[Vector, Vector]:
    """What noise of one column adds to residuals: (samples, channels, blocks of its samples).

    And the variance over the noise's of what these blocks leave of each sample.

    Args:
        simulator, run: of the problem.
        tables: of all inputs that the column drives.
    """
    problem = simulator.problem
    first = next(iter(tables.values()))
    count = int(np.searchsorted(first.times, run.times[-1], "right"))
    each = _parts(first)
    samples = max(1, -(-count // (each * BLOCKS)))
    width = each * samples
    blocks = np.arange(0, count, width)
    nodes = np.unique(np.linspace(0, blocks.size - 1, NODES).round().astype(int))

    def moved(block: int) -> dict[str, Table]:
        found = {}
        for target, table in tables.items():
            values = table.values.copy()
            values[blocks[block] : blocks[block] + width] += LARGE * run.noisy[target]
            found[target] = Table(
                table.times, values, unit=table.unit, interpolation=table.interpolation,
                text=table.text, extend=table.extend,
            )  # fmt: skip
        return found

    base, *rest = simulator.driven(problem.nominal, run, [{}, *(moved(int(k)) for k in nodes)])
    one = 1.0 / np.sqrt(samples) / LARGE / problem.sigma
    known = np.isfinite(run.data) & np.isfinite(base)  # not what a clock moves out of the run
    responses = [np.where(known, (r - base) * one, 0.0) for r in rest]
    begins = np.searchsorted(run.times, first.times[blocks])
    between = _better(responses, begins[nodes])
    found = np.empty((*run.data.shape, blocks.size))
    for block in range(blocks.size):
        after = int(np.searchsorted(nodes, block, "right"))
        low, high = max(after - 1, 0), min(after, nodes.size - 1)
        share = (block - nodes[low]) / max(nodes[high] - nodes[low], 1)
        found[:, :, block] = between(
            responses[low], responses[high], begins[nodes[low]], begins[nodes[high]],
            begins[block], share,
        )  # fmt: skip
    bridges = np.zeros(run.data.shape)
    ends = np.append(begins[1:], run.times.size)
    for block, (begin, end) in enumerate(zip(begins, ends, strict=True)):
        last = found[min(end, run.times.size - 1), :, block]
        bridges[begin:end] += last**2 * (1.0 - 1.0 / samples**2) / 6.0
    return found, bridges


Between = Callable[[Vector, Vector, int, int, int, float], Vector]


def _better(responses: list[Vector], begins: NDArray[np.intp]) -> Between:
    """The way between two responses that gives those which were simulated between them."""
    left = {}
    for way in (_at_one_time, _after_one_time):
        left[way] = sum(
            float(np.sum((way(a, c, i, k, j, (j - i) / max(k - i, 1)) - b) ** 2))
            for a, b, c, i, j, k in zip(
                responses, responses[1:], responses[2:], begins, begins[1:], begins[2:],
                strict=False,
            )
        )  # fmt: skip
    return min(left, key=lambda way: left[way])


def _at_one_time(first: Vector, second: Vector, i: int, k: int, j: int, share: float) -> Vector:
    """Between responses at the same time: what is integrated stays where it was put."""
    found = _after_one_time(first, first, i, i, j, 0.0)
    found[k:] = (1.0 - share) * first[k:] + share * second[k:]
    return found


def _after_one_time(first: Vector, second: Vector, i: int, k: int, j: int, share: float) -> Vector:
    """Between responses so long after the input was moved: what dies out again."""
    found = np.zeros_like(first)
    for response, begin, part in ((first, i, 1.0 - share), (second, k, share)):
        if part and begin <= j:
            found[j:] += part * response[begin : begin + found.shape[0] - j]
        elif part:
            found[j : j + found.shape[0] - begin] += part * response[begin:]
            # its run ended too soon: as it was then
            found[j + found.shape[0] - begin :] += part * response[-1]
    return found
