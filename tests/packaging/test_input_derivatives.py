"""Inputs that move within a step: FMI 2's derivatives of inputs, through the FMUs."""

from __future__ import annotations

import numpy as np
import pytest

from sources.packaging.layout import METHODS
from tests.fmus import Slave, fmu
from tests.support import oracle_of

NAME = "dc_motor/electrical"
VALUES = {"w_ref": 1.0, "w": 0.5}
SLOPES = {"w_ref": (30.0, 0.0), "w": (-20.0, 4e3)}
END = 0.004


def move(slave: Slave) -> None:
    for name, derivatives in SLOPES.items():
        reference = slave.vr[name]
        slave.fmu.setRealInputDerivatives([reference] * 2, [1, 2], list(derivatives))


def moving(t: float) -> dict[str, float]:
    return {
        name: VALUES[name] + slope * t + curve * t**2 / 2 for name, (slope, curve) in SLOPES.items()
    }


@pytest.fixture(scope="module")
def exact() -> tuple[list[str], np.ndarray, np.ndarray]:
    oracle = oracle_of(NAME)
    found = oracle.simulate(np.linspace(0.0, END, 5), VALUES, moving, rtol=1e-12, atol=1e-13)
    states = np.array([found[state] for state in oracle.state_names])
    return oracle.state_names, states[:, -1], np.abs(states).max(axis=1)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "order"), [("rk4", 4), ("rodas3", 3), ("rosw3_adaptive", 3)])
def test_solvers_keep_their_order(exact, method: str, order: int) -> None:
    names, expected, scale = exact
    errors = []
    for n in (64, 128, 256):
        # a tolerance of 1 accepts every step: the error-controlled solver takes its longest
        settings = {
            "solver.method": METHODS[method][0], "solver.step": END / n, "solver.tolerance": 1.0,
        }  # fmt: skip
        with Slave(fmu(NAME), {**VALUES, **settings}) as slave:
            move(slave)
            slave.step(0.0, END)
            errors.append(np.max(np.abs(slave.get(names) - expected)[scale > 0] / scale[scale > 0]))
    slope = -np.polyfit(np.log([64, 128, 256]), np.log(errors), 1)[0]
    # terms of the next order; the Jacobian that is kept for 20 steps adds to them
    assert slope == pytest.approx(order, abs=0.25)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["dopri5", "rodas3_adaptive", "rosw3_adaptive"])
def test_error_controlled_solvers_follow(exact, method: str) -> None:
    names, expected, scale = exact
    settings = {"solver.method": METHODS[method][0], "solver.tolerance": 1e-9}
    with Slave(fmu(NAME), {**VALUES, **settings}) as slave:
        move(slave)
        slave.step(0.0, END)
        # local errors of 1e-9, some hundred of which add up
        np.testing.assert_allclose(slave.get(names), expected, atol=1e-7 * scale.max())


def test_inputs_go_on_until_they_are_set_again() -> None:
    with Slave(fmu(NAME), VALUES) as slave:
        move(slave)
        slave.step(0.0, 1e-3)
        # rounding of a polynomial
        np.testing.assert_allclose(slave.get(["w_ref", "w"]), list(moving(1e-3).values()))
        slave.step(1e-3, 1e-3)
        np.testing.assert_allclose(slave.get(["w_ref", "w"]), list(moving(2e-3).values()))
        slave.set({"w": 0.25})
        slave.step(2e-3, 1e-3)
        np.testing.assert_allclose(slave.get(["w_ref"]), [moving(3e-3)["w_ref"]])
        assert slave.get(["w"])[0] == 0.25


def test_two_steps_are_one() -> None:
    """The derivatives in the middle are those of the same polynomial."""
    ends = []
    for count in (1, 2):
        settings = {**VALUES, "solver.method": METHODS["rk4"][0], "solver.step": 1e-5}
        with Slave(fmu(NAME), settings) as slave:
            move(slave)
            for k in range(count):
                slave.step(k * 2e-3 / count, 2e-3 / count)
            ends.append(slave.get(["i", "w"]))
    # internal steps of 1e-5 at the same instants, up to rounding of time
    np.testing.assert_allclose(ends[0], ends[1], rtol=1e-10)


def test_states_remember_the_derivatives() -> None:
    with Slave(fmu(NAME), VALUES) as slave:
        move(slave)
        slave.step(0.0, 1e-3)
        state = slave.fmu.getFMUState()
        slave.step(1e-3, 1e-3)
        expected = slave.get(["i", "tau", "w"])
        slave.fmu.setFMUState(state)
        slave.step(1e-3, 1e-3)
        np.testing.assert_array_equal(slave.get(["i", "tau", "w"]), expected)


def test_sample_clocks_see_the_input_of_their_instant() -> None:
    """A tick in the middle of a step reads the input there."""
    with Slave(fmu("dc_motor/sampled"), {"w_ref": 0.0}) as slave:
        reference = slave.vr["w_ref"]
        slave.fmu.setRealInputDerivatives([reference], [1], [1e3])
        slave.step(0.0, 0.02)
        moved = slave.get(["i"])[0]
    with Slave(fmu("dc_motor/sampled"), {"w_ref": 0.0}) as slave:
        slave.step(0.0, 0.02)
        assert moved > 1.0 > abs(slave.get(["i"])[0])


@pytest.mark.parametrize(
    ("name", "order", "value", "text"),
    [
        ("w", 3, 1.0, "derivative of order 3 of input w; must be 1 or 2"),
        ("w", 1, float("nan"), "a derivative of input w cannot be set to nan at time 0 s"),
        ("i", 1, 1.0, "is no input with derivatives"),
    ],
)
def test_wrong_derivatives_are_refused(name: str, order: int, value: float, text: str) -> None:
    with Slave(fmu(NAME), VALUES) as slave:
        with pytest.raises(Exception, match="fmi2SetRealInputDerivatives"):
            slave.fmu.setRealInputDerivatives([slave.vr[name]], [order], [value])
        assert any(text in message for message in slave.messages)


def test_derivatives_come_after_initialization_began() -> None:
    with Slave(fmu(NAME), initialize=False) as slave:
        slave.fmu.setupExperiment(startTime=0.0)
        with pytest.raises(Exception, match="fmi2SetRealInputDerivatives"):
            move(slave)
        assert "setting derivatives of inputs is not allowed" in slave.messages[0]


def test_native_fmus_say_so_and_interpreted_ones_do_not() -> None:
    for kind, says in (("native", True), ("python", False)):
        with Slave(fmu("inertia/disc", kind)) as slave:
            assert bool(slave.description.coSimulation.canInterpolateInputs) is says
