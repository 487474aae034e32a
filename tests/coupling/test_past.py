"""What extrapolation takes for the past: none of other runs, none of trials that failed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.master.master import Master
from cosim.master.session import Session
from cosim.system.system import System
from tests.tiny_fmus import V, tiny

STEP = 0.1
NO_STATES = 'canHandleVariableCommunicationStepSize="true"'


@pytest.fixture
def squares(tmp_path: Path) -> System:
    """k t^2 into an integrator that takes an input as held."""
    source = tiny(
        tmp_path,
        [V("k", "Float64", "parameter", "1"), V("y", "Float64", "output")],
        "v->r[1][0] = v->r[0][0] * v->r[9][0] * v->r[9][0];",
        "v->r[9][0] = t + h;",
        begin="v->r[0][0] = 1;",
        name="source",
        interface=NO_STATES,
    )
    integral = tiny(
        tmp_path,
        [V("u", "Float64", "input", "0"), V("x", "Float64", "output")],
        "v->r[1][0] = v->r[9][0];",
        "v->r[9][0] += h * v->r[0][0];",
        name="integral",
        interface=NO_STATES,
    )
    system = System()
    system.add("s", str(source))
    system.add("i", str(integral))
    system.connect("s.y", "i.u")
    return system


def expected(ahead: bool, count: int) -> np.ndarray:
    """Means of the polynomials: a parabola is exact where there are four values."""
    y = (STEP * np.arange(count + 1)) ** 2
    steps = []
    for n in range(count):
        if n + ahead >= 3:
            steps.append(STEP * ((STEP * (n + 1)) ** 3 - (STEP * n) ** 3) / (3.0 * STEP))
        elif ahead:
            steps.append(STEP * 0.5 * (y[n] + y[n + 1]))
        else:
            steps.append(STEP * (1.5 * y[n] - 0.5 * y[n - 1] if n else y[0]))
    return np.concatenate([[0.0], np.cumsum(steps)])


@pytest.mark.parametrize("executor", ["python", "c"])
@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel"])
def test_values_of_earlier_runs_and_none_are_no_past(
    squares: System, algorithm: str, executor: str
) -> None:
    master = Master(squares, algorithm, STEP, options={"extrapolation": 2}, executor=executor)
    right = expected(algorithm == "gauss_seidel", 10)
    with Session(master, 1.0, record=["i.x"]) as session:
        first = session.run()[1]
        np.testing.assert_allclose(first[:, 0], right, atol=1e-14)  # rounding
        session.run({"s.k": 1e6})
        np.testing.assert_array_equal(session.run()[1], first)
    np.testing.assert_array_equal(master.run(1.0, record=["i.x"]).values, first)


@pytest.mark.parametrize("what", ["{ v->end = 1; v->last = t + h; }", "return 3;"])
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel"])
def test_a_trial_that_fails_because_inputs_were_held_is_none_of_the_run(
    tmp_path: Path, algorithm: str, order: int, what: str
) -> None:
    # 1 - 4 t, integrated, is 0.125 at most; with inputs held over the first steps it is 0.16
    source = tiny(tmp_path, [V("y", "Float64", "output")], "v->r[0][0] = 1 - 4 * v->t;", name="s")
    integral = tiny(
        tmp_path,
        [V("u", "Float64", "input", "0"), V("x", "Float64", "output")],
        "v->r[1][0] = v->r[9][0];",
        f"v->r[9][0] += h * v->r[0][0]; if (v->r[9][0] > 0.135) {what}",
        name="i",
    )
    system = System()
    system.add("s", str(source))
    system.add("i", str(integral))
    system.connect("s.y", "i.u")
    master = Master(system, algorithm, 0.1, options={"extrapolation": order})
    found = master.run(0.5, record=["i.x"])
    exact = found.time - 2.0 * found.time**2
    # the mean of a line over a step is exact
    np.testing.assert_allclose(found["i.x"], exact, atol=1e-12)
    assert not found.notes
