"""The points of a study: lists combined, distributions sampled."""

from __future__ import annotations

import hashlib
import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from ..errors import ScenarioError
from .definition import Algorithm, Distribution, Sample, Study
from .global_designs import DESIGNS

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Point:
    """What one run of a study is made with.

    Attributes:
        scenario: its name, with that of the run.
        variants: short forms, "" left out.
        parameters: full name -> value.
        algorithm, step: None for the scenario's own.
    """

    scenario: str
    variants: Mapping[str, str]
    parameters: Mapping[str, Any]
    algorithm: Algorithm | None = None
    step: float | None = None

    @property
    def group(self) -> tuple[Any, ...]:
        """Points with the same one differ in parameters only."""
        return (self.scenario, tuple(self.variants.items()), str(self.algorithm), self.step)


def drawn(axes: Mapping[str, Distribution], sample: Sample) -> list[dict[str, float]]:
    """Sampled values, one row per run of each variant.

    With `latin_hypercube` and `random` each parameter has random numbers of its own, from the seed
    and its name: another parameter in the study leaves them as they are, and so does a larger count
    with `random`. `sobol` and `morris` draw all parameters together.

    Raises:
        InputError: `sobol` and `morris` need SALib.
        ScenarioError: a distribution without ends, of which `morris` takes both.
    """
    if sample.method in DESIGNS:
        columns = DESIGNS[sample.method](sample, len(axes)).T
    else:
        columns = np.array([_alone(name, sample) for name in axes])
    rows = zip(*(quantile(axes[n], u) for n, u in zip(axes, columns, strict=True)), strict=True)
    found = [dict(zip(axes, map(float, row), strict=True)) for row in rows]
    for name, axis in axes.items():
        if not all(math.isfinite(row[name]) for row in found):
            raise ScenarioError(
                f"[param] {name}: {sample.method} takes both ends of a distribution, and normal = "
                f"[{axis.first:g}, {axis.second:g}] has none; give minimum and maximum"
            )
    return found


def _alone(name: str, sample: Sample) -> Vector:
    """Probabilities of one parameter's values."""
    words = np.frombuffer(hashlib.sha256(name.encode()).digest(), dtype=np.uint32)
    random = np.random.default_rng([sample.seed, *words.tolist()])
    if sample.method == "random":
        return random.random(sample.count)
    # one value in each of `count` equally probable intervals, in random order
    return (random.permutation(sample.count) + random.random(sample.count)) / sample.count


def quantile(axis: Distribution, u: Vector) -> Vector:
    """Values below which a distribution lies with given probabilities."""
    found: Vector
    if axis.kind == "uniform":
        found = axis.first + (axis.second - axis.first) * u
    elif axis.kind == "log_uniform":
        found = axis.first * (axis.second / axis.first) ** u
    else:
        low, high = (ndtr((end - axis.first) / axis.second) for end in (axis.minimum, axis.maximum))
        found = axis.first + axis.second * ndtri(low + (high - low) * u)
        found = np.clip(found, axis.minimum, axis.maximum)  # rounding may leave the interval
    return found


def points(study: Study, scenarios: list[str]) -> list[Point]:
    """All points, without reference runs.

    Raises:
        InputError: lists of different lengths in a `zip`; as of `drawn`.
    """
    samples = drawn(study.sampled, study.sample) if study.sample is not None else [{}]
    return [
        replace(point, scenario=scenario, parameters={**point.parameters, **values})
        for scenario in scenarios
        for point in _listed(study)
        for values in samples
    ]


def _listed(study: Study) -> Iterator[Point]:
    """Points of the lists alone; those that differ in parameters only follow each other."""
    axes: list[tuple[str, str, tuple[Any, ...]]] = [
        *(("set", name, values) for name, values in study.variants.items()),
        ("algorithm", "", study.algorithms or (None,)),
        ("step", "", study.steps or (None,)),
        *(
            ("param", name, values)
            for name, values in study.parameters.items()
            if not isinstance(values, Distribution)
        ),
    ]
    rows: Iterator[tuple[Any, ...]]
    if study.combine == "grid":
        rows = itertools.product(*(values for _, _, values in axes))
    else:
        longest = max(axes, key=lambda axis: len(axis[2]))
        for kind, name, values in axes:
            if len(values) not in (1, len(longest[2])):
                raise ScenarioError(
                    f'{study.name}: combine = "zip" takes lists of one length, but '
                    f"{_called(kind, name)} has {len(values)} values and "
                    f"{_called(*longest[:2])} has {len(longest[2])}"
                )
        count = len(longest[2])
        rows = zip(*(v * count if len(v) == 1 else v for _, _, v in axes), strict=True)
    for row in rows:
        found: dict[str, dict[str, Any]] = {"set": {}, "param": {}, "algorithm": {}, "step": {}}
        for (kind, name, _), value in zip(axes, row, strict=True):
            if kind != "set" or value:
                found[kind][name] = value
        yield Point("", found["set"], found["param"], found["algorithm"][""], found["step"][""])


def _called(kind: str, name: str) -> str:
    return f"[{kind}] {name}" if name else kind


def reference_of(point: Point, study: Study) -> Point:
    """The point that a point is compared with; it may be itself."""
    wanted = study.reference
    assert wanted is not None  # asked only where there is one
    return Point(
        point.scenario,
        {k: v for k, v in {**point.variants, **wanted.variants}.items() if v},
        {**point.parameters, **wanted.parameters},
        wanted.algorithm or point.algorithm,
        min(study.steps) if wanted.finest else wanted.step or point.step,
    )
