"""Sessions that simulators share give what sessions of their own would."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.calibrate import Problem
from cosim.calibrate.pool import Ran
from cosim.calibrate.simulator import Simulator
from cosim.errors import StepError, UnknownNameError
from cosim.master.session import RUNAWAY, Session


def same(simulator: Simulator, theta: np.ndarray) -> bool:
    """Whether it gives, bit for bit, what it gives with sessions of its own."""
    alone = Simulator(simulator.problem)
    found, expected = simulator.residuals(theta, None), alone.residuals(theta, None)
    return all(np.array_equal(a, b) for (_, a), (_, b) in zip(found, expected, strict=True))


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[Session]:
    """Sessions that are prepared."""
    made: list[Session] = []
    begun = Session.__init__

    def init(self: Session, *args, **kwargs) -> None:
        made.append(self)
        begun(self, *args, **kwargs)

    monkeypatch.setattr(Session, "__init__", init)
    return made


def test_what_is_held_does_not_stay_in_a_shared_session(
    short: Problem, truth: np.ndarray, counted: list[Session]
) -> None:
    whole = Simulator(short, workers=1)
    whole.residuals(truth, None)
    before = len(counted)
    name, other = short.names[0], short.names[1]
    place = short.index(name)
    for value in (short.lower[place], short.upper[place]):
        held = whole.of(short.hold({name: float(value)}))
        assert same(held, np.delete(truth, place))
    assert same(whole, 1.01 * truth)  # free again
    assert same(whole.of(short.hold({other: float(short.upper[1])})), np.delete(truth, 1))
    own = 4 * len(short.runs)  # of those that are compared with
    assert len(counted) == before + own


def test_other_steps_inputs_and_lengths_get_sessions_of_their_own(
    short: Problem, truth: np.ndarray
) -> None:
    whole = Simulator(short, workers=2)
    whole.residuals(truth, None)
    assert same(whole.of(short.changed(step=0.5 * short.step)), truth)
    cut = [replace(r, times=r.times[:501], data=r.data[:501]) for r in short.runs]
    assert same(whole.of(short.changed(runs=cut)), truth)
    first, second, third = short.runs
    exchanged = [replace(first, inputs=second.inputs), second, third]
    assert same(whole.of(short.changed(runs=exchanged)), truth)


def test_sessions_that_were_not_used_for_long_are_freed(
    short: Problem, truth: np.ndarray, counted: list[Session], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosim.calibrate.pool.MOST", len(short.runs))
    closed: list[Session] = []
    end = Session.close
    monkeypatch.setattr(Session, "close", lambda self: (closed.append(self), end(self)))
    whole = Simulator(short, workers=1)
    whole.residuals(truth, None)
    finer = whole.of(short.changed(step=0.5 * short.step))
    finer.residuals(truth, None)
    assert closed == counted[: len(short.runs)]
    whole.close()
    assert len(closed) == len(short.runs)  # nothing of that kind was left
    finer.close()
    assert len(closed) == 2 * len(short.runs)


def test_a_closed_simulator_can_still_be_used(short: Problem, truth: np.ndarray) -> None:
    whole = Simulator(short, workers=2)
    first = Simulator(short, workers=2).residuals(truth, None)
    whole.residuals(1.01 * truth, None)
    whole.close()
    assert all(
        np.array_equal(a, b)
        for (_, a), (_, b) in zip(first, whole.residuals(truth, None), strict=True)
    )


def test_a_constant_that_the_system_lacks_is_named(short: Problem, truth: np.ndarray) -> None:
    wrong = short.changed(constants={**short.constants, "motor.nonsense": 1.0})
    with pytest.raises(UnknownNameError, match="nonsense"):
        Simulator(wrong).residuals(truth)


@pytest.fixture
def ran(monkeypatch: pytest.MonkeyPatch) -> list[Session]:
    """Sessions that were run."""
    made: list[Session] = []
    run = Session.run

    def listed(self: Session, *args, **kwargs):
        made.append(self)
        return run(self, *args, **kwargs)

    monkeypatch.setattr(Session, "run", listed)
    return made


def test_what_was_simulated_before_is_not_simulated_again(
    short: Problem, truth: np.ndarray, ran: list[Session]
) -> None:
    whole = Simulator(short, workers=2)
    whole.residuals(truth, None)
    first, count = len(ran), len(short.runs)
    assert (first, whole.evaluations) == (count, count)
    held = whole.of(short.hold({short.names[0]: float(truth[0])}))
    changed = whole.of(short.with_data({"sines": np.ones_like(short.run("sines").data)}))
    for simulator, theta in ((whole, truth), (held, truth[1:]), (changed, truth)):
        simulator.residuals(theta, None)
    assert len(ran) == first
    assert held.evaluations == 0
    assert changed.simulate(truth, "sines") is not whole.simulate(truth, "sines")
    assert same(held, truth[1:]) and same(changed, truth)
    before = len(ran)
    whole.residuals(np.nextafter(truth, np.inf), None)
    assert len(ran) == before + count


def test_a_known_run_counts_within_its_limit_only(
    short: Problem, truth: np.ndarray, ran: list[Session]
) -> None:
    whole = Simulator(short.only(["sines"]))
    whole.simulate(truth, "sines")
    cost = whole.costs["sines"]
    assert cost > 0.0
    generous = whole.limited({"sines": 2.0 * cost})
    generous.simulate(truth, "sines")
    assert (len(ran), generous.costs["sines"]) == (1, cost)
    # of any problem that is made from it
    held = generous.limited({"sines": cost - 1}).of(short.only(["sines"]).changed(late=()))
    with pytest.raises(StepError, match="steps of solvers"):
        held.simulate(truth, "sines")
    assert len(ran) == 2
    known = Ran(("x",), np.zeros(2), np.array([[0.0], [2.0 * RUNAWAY]]), 1.0, None)
    assert known.within(np.inf)
    assert not known.within(2.0)  # a run with a limit would have been stopped


def test_runs_that_were_not_asked_for_long_are_forgotten(
    short: Problem, truth: np.ndarray, ran: list[Session], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = Simulator(short, workers=1)
    one = whole.session(short.run("sines")).run(short.values(truth, "sines"))[1].nbytes
    monkeypatch.setattr("cosim.calibrate.pool.KEPT", 2 * one)
    del ran[:]
    for factor, simulated in ((1.0, 1), (1.01, 2), (1.0, 2), (1.02, 3), (1.0, 3), (1.01, 4)):
        whole.simulate(factor * truth, "sines")
        assert len(ran) == simulated
    assert whole._pool._size == 2 * one
