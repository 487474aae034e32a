"""Fits along valleys: little but a product shows, and differences claim more than there is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from cosim.calibrate import descent
from cosim.calibrate.descent import CORRECTIONS, FIRM, STEPS, Descent
from cosim.calibrate.making_up import walk
from cosim.calibrate.normal import Normal
from cosim.calibrate.problem import Problem
from cosim.calibrate.simulator import Simulator
from tests.problems import simulator

Vector = NDArray[np.float64]
MASS, PLACE = "J_load", "R_a"


def begun(
    short: Problem,
    monkeypatch: pytest.MonkeyPatch,
    law: Callable[[float, float, Sequence[Vector]], Vector],
    start: tuple[float, float],
    span: float,
) -> Descent:
    """A fit of mass and place, which are 1 in the data, from other values.

    Args:
        short, monkeypatch: of the test.
        law: model over the noise of mass, place and three shapes.
        start: mass and place.
        span: of both.
    """
    run = short.chosen("identification")[0]
    own = [short.index(MASS), short.index(PLACE)]
    problem = short.with_parameters(
        [
            replace(p, nominal=1.0, minimum=0.01, maximum=100.0, span=span)
            if p.name in (MASS, PLACE) else p
            for p in short.parameters
        ]
    )  # fmt: skip
    random = np.random.default_rng(3)
    shapes = [random.standard_normal(run.data.shape) for _ in range(3)]

    def simulate(self: Simulator, values: Vector, run: object) -> Vector:
        rest = float(np.sum(np.delete(values - problem.nominal, own)))
        mass, place = values[own]
        return np.asarray((law(mass, place, shapes) + shapes[0][::-1] * rest) * problem.sigma)

    monkeypatch.setattr(Simulator, "simulate", simulate)
    data = simulate(simulator(problem), problem.nominal, run)
    data += random.standard_normal(data.shape) * problem.sigma
    problem = problem.changed(runs=[replace(run, data=data)])
    theta = problem.nominal
    theta[own] = start
    return Descent(simulator(problem), [run.name], theta)


def away(short: Problem, monkeypatch: pytest.MonkeyPatch, steep: float) -> Descent:
    """A fit that begins at three times a mass and a third of its place.

    100 times the noise goes with the product, a tenth of it with m p^2. Differences over a step h
    see `steep` h^2 where product and place should undo each other.

    Args:
        short, monkeypatch: of the test.
        steep: size over the noise of what goes with the cube of the product.
    """

    def law(m: float, p: float, shapes: Sequence[Vector]) -> Vector:
        one, other, faint = shapes
        return 100.0 * one * m * p + steep * other * (m * p) ** 3 + 0.1 * faint * m * p**2

    found = begun(short, monkeypatch, law, (3.0, 1.0 / 3.0), 1.0)
    found.products = [(short.index(PLACE), short.index(MASS))]
    return found


@pytest.mark.parametrize(("steep", "shorter"), [(10.0, False), (100.0, True)])
def test_a_fit_goes_on_where_differences_were_too_long_for_a_valley(
    short: Problem, monkeypatch: pytest.MonkeyPatch, steep: float, shorter: bool
) -> None:
    """They are taken again, shorter, if the quadratic is poor; where it is good they stay."""
    run = away(short, monkeypatch, steep)
    truth = run.problem.nominal
    best = run.total(truth, run.simulator.residuals(truth, run.purpose))
    assert run.cost > best + 30.0
    run.correct()
    # noise moves the minimum: half a nat by each parameter
    assert best - 10.0 < run.cost < best
    # 43 nats are 9.2 deviations, from 3 to 1
    assert run.theta[run.problem.index(MASS)] == pytest.approx(1.0, abs=3.0 * 2.0 / 9.2)
    assert (run.length < STEPS[-1]) is shorter


def test_a_draft_takes_its_differences_once(
    short: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is only to be compared with others that are no nearer to their minima."""
    run = away(short, monkeypatch, 100.0)
    before = run.cost
    run.correct(draft=True)
    assert run.cost <= before
    assert run.length == STEPS[-1]


@pytest.mark.parametrize("bend", [1.0, 0.0])
def test_a_bent_valley_is_walked(
    short: Problem, monkeypatch: pytest.MonkeyPatch, bend: float
) -> None:
    """Steep walls keep the place to the square of the mass, and little tells the mass."""

    def law(m: float, p: float, shapes: Sequence[Vector]) -> Vector:
        return 100.0 * shapes[0] * (p - m ** (1.0 + bend)) + shapes[1] * m

    walks: list[Descent] = []

    def seen(run: Descent, step: Vector) -> None:
        walks.append(run)
        walk(run, step)

    monkeypatch.setattr(descent, "walk", seen)
    run = begun(short, monkeypatch, law, (4.0, 4.0 ** (1.0 + bend)), 0.1)
    run.correct()
    samples = sum(r.size for _, r in run.residuals)
    # one over the root of so many samples is what the noise leaves: four deviations
    assert run.theta[run.problem.index(MASS)] == pytest.approx(1.0, abs=4.0 / np.sqrt(samples))
    assert bool(walks) == bool(bend)


@pytest.mark.parametrize("within", [True, False])
def test_a_fit_is_left_if_what_it_promises_is_of_no_use(
    short: Problem, monkeypatch: pytest.MonkeyPatch, within: bool
) -> None:
    """Four times what the quadratic promises is the most that a good one gives."""
    run = away(short, monkeypatch, 10.0)
    run.step(run.normal(run.length, central=True), FIRM)
    before, reach = run.cost, CORRECTIONS * run.promised
    run.correct(goal=before - (0.5 if within else 2.0) * reach)
    assert (run.cost < before) is within


def test_what_jumps_promises_too_little_to_be_left(
    short: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = away(short, monkeypatch, 10.0)
    before, usual = run.cost, Descent.normal

    def uneven(self: Descent, relative: float, central: bool) -> Normal:
        found = usual(self, relative, central)
        self.uneven = True
        return found

    monkeypatch.setattr(Descent, "normal", uneven)
    run.correct(goal=0.0)
    assert run.cost < before


def test_a_point_that_was_met_is_forgotten_once_the_fit_is_lower(
    short: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = begun(
        short, monkeypatch, lambda m, p, shapes: m * shapes[0] + p * shapes[1], (4.0, 4.0), 0.1
    )
    higher, best = run.theta.copy(), run.problem.nominal
    higher[run.problem.index(MASS)] = 2.0
    seen = run.simulator.residuals(higher, run.purpose)
    run.meet(higher, seen, run.total(higher, seen))
    assert run.attempt(best)  # all are 1 there, as in the data
    cost = run.cost
    assert not run.lowered() and run.cost == cost
    assert run.theta.tolist() == best.tolist()
