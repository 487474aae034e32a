"""Coupled FMUs against the same equations solved as one; energy that the coupling invents."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.monolith import Monolith
from cosim.master.master import Master
from tests.coupling.test_coupling_orders import INPUTS, SIGNALS, drive


@pytest.fixture(scope="module")
def exact() -> np.ndarray:
    from tests.coupling.conftest import Built

    times = np.linspace(0.0, 0.1, 11)
    return Monolith(drive(Built()), INPUTS).solve(times, SIGNALS)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("algorithm", "options", "limit"),
    [
        # bounds of the error at 0.1 ms relative to the one at 1 ms, tenfold and hundredfold
        # smaller steps in first and second order, with room for the next order at 1 ms
        ("jacobi", {}, 0.1),
        ("jacobi", {"extrapolation": 1}, 0.02),
        ("gauss_seidel", {"extrapolation": 1}, 0.02),
        ("iterated", {}, 0.02),
    ],
)
def test_coupled_fmus_converge_to_the_equations_solved_as_one(
    provider, exact, algorithm: str, options: dict[str, int], limit: float
) -> None:
    errors = []
    for h in (1e-3, 1e-4):
        master = Master(drive(provider), algorithm, h, options=options)
        run = master.run(0.1, inputs=INPUTS, record=SIGNALS, every=round(0.01 / h))
        errors.append(np.max(np.abs(run.values - exact), axis=0))
    assert np.all(errors[1] < limit * errors[0])


@pytest.mark.parametrize(
    ("algorithm", "options", "order"),
    [("jacobi", {}, 1), ("gauss_seidel", {}, 1), ("jacobi", {"extrapolation": 1}, 2)],
)
def test_invented_energy_shrinks_with_the_step(provider, algorithm, options, order) -> None:
    steps = np.array([5e-4, 2.5e-4, 1.25e-4])
    energy = []
    for h in steps:
        run = Master(drive(provider), algorithm, h, options=options).run(0.1, inputs=INPUTS)
        energy.append(abs(sum(run.bond_energy.values())))
    slope = np.polyfit(np.log(steps), np.log(energy), 1)[0]
    assert slope == pytest.approx(order, abs=0.35)  # as of the errors


def test_iterated_coupling_invents_nothing(provider) -> None:
    run = Master(drive(provider), "iterated", 1e-3).run(0.1, inputs=INPUTS)
    through = float(np.trapezoid(np.abs(run["motor.tau"] * run["gearbox.w_a"]), run.time))
    # both ends see means of the same values; what is left is the tolerance of 1e-8
    assert abs(sum(run.bond_energy.values())) < 1e-6 * through
