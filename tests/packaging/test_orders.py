"""Claimed orders of the solvers inside the FMUs, measured through the FMUs.

Errors are those of the states at the end, relative to each state's largest value, against scipy's
Radau with tolerances of 1e-12.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
import pytest

from sources.packaging.layout import METHODS
from tests.fmus import Slave, fmu
from tests.support import oracle_of

pytestmark = pytest.mark.slow

# smooth runs, away from limits: values, end [s], and numbers of steps in the asymptotic range
CASES: dict[str, tuple[dict[str, float], float, tuple[int, ...], tuple[int, ...]]] = {
    "dc_motor/electrical": ({"w_ref": 1.0, "w": 0.5}, 0.004, (32, 64, 128, 256), (64, 128, 256)),
    "gearbox/elastic": ({"tau_a": 0.5, "w_b": 2.0}, 0.02, (64, 128, 256, 512), (128, 256, 512)),
    "inertia/pendulum": ({"tau": 1.0, "angle": 0.5}, 1.0, (128, 256, 512), (128, 256, 512)),
    "ur5_arm/rigid": (
        {f"tau[{k}]": float(k) for k in range(1, 7)},
        0.1,
        (128, 256, 512),
        (512, 1024, 2048),
    ),
    # derivatives that depend on time alone: a product of two cubics, speed and curvature
    "trajectory/body": (
        {
            "t_0": 0.0,
            "duration[1]": 0.0,
            "duration[2]": 10.0,
            "speed[2]": 0.3,
            "curvature[2]": 2.0,
            "t_curve": 0.6,
            "smooth": 1.0,
        },
        0.5,
        (4, 8, 16),
        (32, 64, 128),
    ),
}
ADAPTIVE = [name for name in CASES if name != "trajectory/body"]


@lru_cache
def reference(name: str) -> tuple[list[str], np.ndarray, np.ndarray]:
    values, end, *_ = CASES[name]
    oracle = oracle_of(name)
    found = oracle.simulate(np.linspace(0.0, end, 20), values, rtol=1e-12, atol=1e-13)
    states = np.array([found[state] for state in oracle.state_names])
    return oracle.state_names, states[:, -1], np.abs(states).max(axis=1)


def end_states(name: str, settings: Mapping[str, float]) -> np.ndarray:
    values, end, *_ = CASES[name]
    with Slave(fmu(name), {**values, **settings}) as slave:
        slave.step(0.0, end)
        return slave.get(reference(name)[0])


def error(name: str, settings: Mapping[str, float]) -> float:
    _, expected, scale = reference(name)
    moved = scale > 0
    difference = np.abs(end_states(name, settings) - expected)[moved]
    return float((difference / scale[moved]).max())


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize(("method", "order"), [("rk4", 4), ("rodas3", 3)])
def test_error_falls_with_the_order(name: str, method: str, order: int) -> None:
    _, end, explicit, implicit = CASES[name]
    counts = explicit if method == "rk4" else implicit
    settings = {"solver.method": METHODS[method][0]}
    errors = [error(name, {**settings, "solver.step": end / n}) for n in counts]
    assert min(errors) > 1e-12  # above the reference's own error
    slope = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    # terms of the next order at these steps bend the line by less than a tenth
    assert slope == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize("name", ADAPTIVE)
@pytest.mark.parametrize("method", ["dopri5", "rodas3_adaptive", "rosw3_adaptive"])
def test_error_follows_the_tolerance(name: str, method: str) -> None:
    tolerances = 10.0 ** -np.arange(5, 11)
    settings = {"solver.method": METHODS[method][0], "solver.step": CASES[name][1]}
    errors = [error(name, {**settings, "solver.tolerance": value}) for value in tolerances]
    slope = np.polyfit(np.log(tolerances), np.log(errors), 1)[0]
    # local errors per step are kept at the tolerance: their number grows slowly with it
    assert slope == pytest.approx(1.0, abs=0.15)
    # and some ten of them add up over these runs
    np.testing.assert_array_less(errors, 20 * tolerances)


STIFF = {
    # filters and current loop of some 1000 rad/s under steps of 1 ms
    "dc_motor/electrical": ({"w_ref": 1.0, "w": 0.5}, 0.05),
    # the damper alone would stop the rotor within microseconds; it starts at the load's speed
    "gearbox/elastic": (
        {"d": 1e3, "tau_a": 0.5, "w_b": 2.0, "rotor_speed": 20.334, "ratio": 10.167},
        0.05,
    ),
}


@pytest.mark.parametrize("name", STIFF)
def test_linearly_implicit_steps_are_stable_where_explicit_ones_are_not(name: str) -> None:
    values, end = STIFF[name]
    oracle = oracle_of(name)
    found = oracle.simulate([0.0, end], values, rtol=1e-10, atol=1e-12)
    expected = np.array([found[state][-1] for state in oracle.state_names])
    ends = {}
    for method in ("rk4", "rodas3"):
        settings = {"solver.method": METHODS[method][0], "solver.step": 1e-3}
        with Slave(fmu(name), {**values, **settings}) as slave:
            slave.step(0.0, end)
            ends[method] = slave.get(oracle.state_names)
    # the fast modes are damped, not resolved; what is left is the error of the slow ones
    np.testing.assert_allclose(ends["rodas3"], expected, rtol=1e-3)
    assert np.abs(ends["rk4"]).max() > 1e20
