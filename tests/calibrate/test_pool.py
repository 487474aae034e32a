"""Sessions that problems share give what sessions of their own would."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.calibrate import Problem
from cosim.calibrate.pool import Pool, Ran
from cosim.errors import StepError, UnknownNameError
from cosim.master.session import RUNAWAY, Session


def alone(problem: Problem) -> Problem:
    """The same problem with sessions of its own."""
    return problem._with(pool=None)


def same(problem: Problem, theta: np.ndarray) -> bool:
    """Whether it gives, bit for bit, what it gives with sessions of its own."""
    found, expected = problem.residuals(theta, None), alone(problem).residuals(theta, None)
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
    whole = alone(short)._with(workers=1)
    whole.residuals(truth, None)
    before = len(counted)
    name, other = whole.names[0], whole.names[1]
    place = whole.index(name)
    for value in (whole.lower[place], whole.upper[place]):
        held = whole.hold({name: float(value)})
        assert same(held, np.delete(truth, place))
    assert same(whole, 1.01 * truth)  # free again
    assert same(whole.hold({other: float(whole.upper[1])}), np.delete(truth, 1))
    own = 4 * len(whole.runs)  # of the problems that are compared with
    assert len(counted) == before + own


def test_other_steps_inputs_and_lengths_get_sessions_of_their_own(
    short: Problem, truth: np.ndarray
) -> None:
    whole = alone(short)
    whole.residuals(truth, None)
    assert same(whole._with(step=0.5 * whole.step), truth)
    cut = [replace(r, times=r.times[:501], data=r.data[:501]) for r in whole.runs]
    assert same(whole._with(runs=cut), truth)
    first, second, third = whole.runs
    exchanged = [replace(first, inputs=second.inputs), second, third]
    assert same(whole._with(runs=exchanged), truth)


def test_sessions_that_were_not_used_for_long_are_freed(
    short: Problem, truth: np.ndarray, counted: list[Session], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosim.calibrate.pool.MOST", len(short.runs))
    closed: list[Session] = []
    end = Session.close
    monkeypatch.setattr(Session, "close", lambda self: (closed.append(self), end(self)))
    whole = alone(short)._with(workers=1)
    whole.residuals(truth, None)
    finer = whole._with(step=0.5 * whole.step)
    finer.residuals(truth, None)
    assert closed == counted[: len(short.runs)]
    whole.close()
    assert len(closed) == len(short.runs)  # nothing of that kind was left
    finer.close()
    assert len(closed) == 2 * len(short.runs)


def test_a_closed_problem_can_still_be_used(short: Problem, truth: np.ndarray) -> None:
    whole = alone(short)
    first = alone(short).residuals(truth, None)
    whole.residuals(1.01 * truth, None)
    whole.close()
    assert all(
        np.array_equal(a, b)
        for (_, a), (_, b) in zip(first, whole.residuals(truth, None), strict=True)
    )


def test_a_constant_that_the_system_lacks_is_named(short: Problem, truth: np.ndarray) -> None:
    wrong = short._with(constants={**short.constants, "motor.nonsense": 1.0}, pool=Pool())
    with pytest.raises(UnknownNameError, match="nonsense"):
        wrong.residuals(truth)


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
    whole = alone(short)
    whole.residuals(truth, None)
    first, count = len(ran), len(whole.runs)
    assert (first, whole.evaluations) == (count, count)
    held = whole.hold({whole.names[0]: float(truth[0])})
    changed = whole.with_data({"sines": np.ones_like(whole.run("sines").data)})
    for problem, theta in ((whole, truth), (held, truth[1:]), (changed, truth)):
        problem.residuals(theta, None)
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
    whole = alone(short).only(["sines"])
    whole.simulate(truth, "sines")
    cost = whole.costs["sines"]
    assert cost > 0.0
    whole.limits = {"sines": 2.0 * cost}
    whole.simulate(truth, "sines")
    assert (len(ran), whole.costs["sines"]) == (1, cost)
    whole.limits = {"sines": 1e-9}
    with pytest.raises(StepError, match="processor time"):
        whole.simulate(truth, "sines")
    assert len(ran) == 2
    known = Ran(("x",), np.zeros(2), np.array([[0.0], [2.0 * RUNAWAY]]), 1.0, None)
    assert known.within(np.inf)
    assert not known.within(2.0)  # a run with a limit would have been stopped


def test_runs_that_were_not_asked_for_long_are_forgotten(
    short: Problem, truth: np.ndarray, ran: list[Session], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = alone(short)._with(workers=1)
    one = whole.session(whole.run("sines")).run(whole.values(truth, "sines"))[1].nbytes
    monkeypatch.setattr("cosim.calibrate.pool.KEPT", 2 * one)
    del ran[:]
    for factor, simulated in ((1.0, 1), (1.01, 2), (1.0, 2), (1.02, 3), (1.0, 3), (1.01, 4)):
        whole.simulate(factor * truth, "sines")
        assert len(ran) == simulated
    assert whole._pool._size == 2 * one
