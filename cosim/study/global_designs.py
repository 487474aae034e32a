"""Designs that draw all sampled parameters together, for indices of their influence.

SALib makes them (extra `study`): Saltelli's on a Sobol sequence, and Morris' trajectories.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..spec.distribution import needed
from .definition import Sample

Vector = NDArray[np.float64]
LEVELS = 4
"""Of Morris' grid: its usual number, with steps of 2/3 of the range."""


def problem(count: int) -> dict[str, Any]:
    """So many probabilities between 0 and 1, as SALib takes them."""
    return {
        "num_vars": count,
        "names": [str(i) for i in range(count)],
        "bounds": [[0.0, 1.0]] * count,
    }


def salib(kind: str, method: str) -> Any:
    """A module of SALib: `sample` or `analyze` of a method.

    Raises:
        InputError: it is not installed.
    """
    return needed(f"SALib.{kind}.{method}", f"method = {method!r} of [sample]", "study")


def _sobol(sample: Sample, count: int) -> Vector:
    found: Vector = salib("sample", "sobol").sample(
        problem(count), sample.count, calc_second_order=False, seed=sample.seed
    )
    return found


def _morris(sample: Sample, count: int) -> Vector:
    found: Vector = salib("sample", "morris").sample(
        problem(count), sample.count, num_levels=LEVELS, seed=sample.seed
    )
    return found


DESIGNS: Mapping[str, Callable[[Sample, int], Vector]] = {"sobol": _sobol, "morris": _morris}
"""Methods that draw all parameters together: probabilities, one row per run."""


def block(method: str, parameters: int) -> int:
    """Runs that belong together; if one of them is missing the others say nothing."""
    return {"sobol": parameters + 2, "morris": parameters + 1}.get(method, 1)
