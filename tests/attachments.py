"""Every effect on every balance of a variant that takes it, and what must hold for each."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from sources.function import Oracle
from sources.model import Model, misfit
from sources.variant import build_model, effects
from tests.support import oracle_of


@lru_cache(maxsize=None)
def oracle(name: str) -> Oracle:
    return oracle_of(name)


def attachable(plain: str) -> Iterator[str]:
    """Names of `plain` with each effect at each balance that takes it."""
    for balance in build_model(plain).balances.values():
        for effect, module in effects().items():
            if not misfit(module.EFFECT, balance):
                yield f"{plain}+{effect}@{balance.name}"


def random_point(model: Model, rng: np.random.Generator) -> dict[str, float]:
    """States, sampled values and inputs of their nominal size, within their bounds."""
    point = {}
    for variable in model.variables.values():
        if variable.role in ("state", "discrete", "input"):
            q = variable.quantity
            value = (q.nominal or 1.0) * float(rng.normal())
            value = value if q.minimum is None else max(value, q.minimum)
            point[variable.name] = value if q.maximum is None else min(value, q.maximum)
    return point


def check_energy(name: str, **values: float) -> None:
    """The energy balance closes at random points."""
    rng = np.random.default_rng(1)
    for _ in range(10):
        point = random_point(oracle(name).model, rng) | values
        defect, largest = oracle(name).energy_defect(point)
        # an identity: some hundred operations of 1e-16 on the terms
        assert abs(defect) <= 1e-12 * max(largest, 1.0), (name, point)


def check_absence(name: str) -> None:
    """Strength 0 gives the variant without the effect, bit for bit."""
    full, bare = oracle(name), oracle(name.partition("+")[0])
    parameters = full.model.of_role("parameter")
    absent = {v.name: 0.0 for v in parameters if v.of_effect and v.quantity.strength}
    assert absent
    rng = np.random.default_rng(2)
    for _ in range(5):
        point = random_point(full.model, rng)
        shared = {key: value for key, value in point.items() if key in bare.model.variables}
        for ask in ("outputs", "derivatives"):
            with_effect = getattr(full, ask)({**point, **absent})
            without = getattr(bare, ask)(shared)
            assert {key: with_effect[key] for key in without} == without, name


def check_presence(name: str) -> None:
    """At its declared strength the effect changes something that the variant shows."""
    full, bare = oracle(name), oracle(name.partition("+")[0])
    rng = np.random.default_rng(3)
    changed = False
    for _ in range(5):
        point = random_point(full.model, rng)
        shared = {key: value for key, value in point.items() if key in bare.model.variables}
        for ask in ("outputs", "derivatives"):
            # not at 0, where a law over time alone may have its zero
            with_effect = getattr(full, ask)(point, 0.3)
            without = getattr(bare, ask)(shared, 0.3)
            changed = changed or any(with_effect[key] != without[key] for key in without)
    assert changed, name


def check_rest(name: str) -> None:
    """Values, Jacobian and directional derivatives are finite at the start values."""
    functions, arguments = oracle(name).functions, oracle(name).arguments()
    seeds = [np.ones_like(item) for item in arguments]
    for result in (
        *functions.outputs(*arguments),
        *functions.jacobian(*arguments),
        *functions.directional(*arguments, *seeds),
    ):
        assert np.all(np.isfinite(np.asarray(result))), name
