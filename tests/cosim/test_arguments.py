"""Arguments of another kind are named, with the way out, before anything runs."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import cosim
from cosim.errors import InputError
from cosim.installation.builder import default_provider
from cosim.master.master import Master
from cosim.master.session import Session
from cosim.system.system import System


@pytest.fixture(scope="module")
def system():
    made = System("disc", default_provider())
    made.add("load", "inertia/disc")
    return made


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ((0.01,), r"algorithm of a Master must be a text, not 0.01 .*write Master\(system, step="),
        (("jacobi", "1e-3"), "communication step of a Master must be a number, not '1e-3'"),
        (("jacobi", True), "communication step of a Master must be a number, not True"),
        ((None,), "algorithm of a Master must be a text, not None .*gauss_seidel"),
        (("jacobi", 1e-3, "tight"), "tolerance of a Master must be a number"),
        (("jacobi", 1e-3, None, "", "auto", 1), "options of a Master must be a table, not 1"),
        (("jacobi", 1e-3, None, "", 3), "executor of a Master must be a text"),
        (("jacobi", 1e-3, None, "", "auto", {}, "1"), "isolate of a Master must be a number"),
    ],
)
def test_master(system, arguments, text) -> None:
    with pytest.raises(InputError, match=text):
        Master(system, *arguments)


def test_system_of_a_master() -> None:
    with pytest.raises(InputError, match=r"must be a System, not 'motor_bench'.*cosim\.run"):
        Master("motor_bench")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"duration": "1"}, "duration of a run must be a number, not '1'"),
        ({"record": "load.w"}, r"record of a run must be a list of names.*record=\[\"load.w\"\]"),
        ({"record": [1]}, "each name of record of a run must be a text, not 1"),
        ({"every": 1.5}, "every of a run must be a whole number, not 1.5"),
        ({"start": None}, "start of a run must be a number, not None"),
        ({"start": float("nan")}, "start nan s is not finite"),
        ({"start": 1e17}, "numbers are 16 s apart there, too far for steps of 0.001 s; let"),
        ({"inputs": ["load.tau"]}, "inputs of a run must be a table"),
        ({"inputs": {3: 1.0}}, "a name in inputs of a run must be a text, not 3"),
        ({"inputs": {"load.tau": None}}, "what drives an input must be a signal, .* not None"),
        ({"progress": 1}, "progress of a run must be a function"),
    ],
)
def test_run_of_a_master(system, arguments, text) -> None:
    with pytest.raises(InputError, match=text):
        Master(system).run(**{"duration": 0.01, **arguments})


def test_options_of_an_algorithm(system) -> None:
    with pytest.raises(InputError, match="substeps must be a table, not 4"):
        Master(system, options={"substeps": 4}).run(0.01)


def test_session(system) -> None:
    with pytest.raises(InputError, match="the master of a Session must be a Master"):
        Session(system, 0.01, record=["load.w"])  # type: ignore[arg-type]
    with pytest.raises(InputError, match="targets of a Session must be a list of names"):
        Session(Master(system), 0.01, record=["load.w"], targets="load.J")
    with Session(Master(system), 0.01, record=["load.w"]) as session:
        for values in (1.0, "load.J"):
            with pytest.raises(InputError, match="values of a run must be a table or a list"):
                session.run(values)  # type: ignore[arg-type]
        with pytest.raises(InputError, match="limit of a run must be a number"):
            session.run(limit="1")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"variants": "gearbox=lossy"}, "variants of a run must be a table"),
        ({"variants": {"gearbox": 1}}, "the variant of gearbox must be a text, not 1"),
        ({"parameters": ["load.J"]}, "parameters of a run must be a table"),
        ({"options": 1}, "options of a run must be a table"),
        ({"step": "1e-3"}, "step of a run must be a number"),
        ({"duration": "1"}, "duration of a run must be a number"),
        ({"algorithm": 1e-3}, "algorithm of a run must be a text"),
    ],
)
def test_run(arguments, text) -> None:
    with pytest.raises(InputError, match=text):
        cosim.run("motor_bench", **arguments)


def test_right_kinds_pass(system) -> None:
    master = Master(system, "jacobi", np.float64(1e-3))
    inputs = {"load.tau": lambda t: 0.0 * t}
    assert master.run(1, inputs=inputs, record=("load.w",), every=np.int64(10)).time.size == 101


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ((3,), r'scenario to open must be a text, not 3 .*cosim\.open\("motor_bench/ST1"\)'),
        (("motor_bench/ST1", {"variants": "lossy"}), "variants of a twin must be a table"),
        (("motor_bench/ST1", {"parameters": [1]}), "parameters of a twin must be a table"),
        (("motor_bench/ST1", {"duration": "1"}), "duration of a twin must be a number, not '1'"),
        (("motor_bench/ST1", {"step": True}), "step of a twin must be a number, not True"),
    ],
)
def test_open(arguments, text) -> None:
    name, how = (*arguments, {})[:2]
    with pytest.raises(InputError, match=text):
        cosim.open(name, **how)


def test_twin(system) -> None:
    text = r"master of a Twin must be a Master, not 'x'.*cosim\.open"
    with pytest.raises(InputError, match=text):
        cosim.Twin("x")  # type: ignore[arg-type]
    text = "duration of a step must be a number, not '1'"
    with cosim.Twin(Master(system)) as twin, pytest.raises(InputError, match=text):
        twin.step("1")  # type: ignore[arg-type]


def test_a_step_may_be_a_fraction(system) -> None:
    found = Master(system, "jacobi", Fraction(1, 1000)).run(0.01, record=["load.w"])
    assert found.time[-1] == 0.01


@pytest.mark.parametrize(
    ("algorithm", "options", "text"),
    [
        (
            "jacobi",
            {"extrapolation": 1.0},
            "order of extrapolation must be a whole number, not 1.0",
        ),
        ("iterated", {"interpolation": True}, "order of interpolation must be a whole number"),
    ],
)
def test_orders_are_whole_numbers(system, algorithm, options, text) -> None:
    with pytest.raises(InputError, match=text):
        Master(system, algorithm, options=options).run(0.01)


@pytest.mark.parametrize(
    ("signals", "later", "text"),
    [
        ({"load.tua": 1.0}, None, "does not drive 'load.tua'.*did you mean 'load.tau'"),
        ({"load.J_added": 1.0}, None, "does not drive 'load.J_added'.*did you mean 'load.tau'"),
        ({"load.tau": [1.0]}, None, "what drives an input must be a signal"),
        ({}, {"load.tau": float("nan")}, "load.tau cannot come nan s later"),
        ({}, {"load.tau": "1"}, "how late load.tau comes must be a number"),
    ],
)
def test_what_drives_a_session(system, signals, later, text) -> None:
    master = Master(system, "jacobi", 1e-3)
    with Session(master, 0.1, inputs={"load.tau": 0.0}, record=["load.w"]) as session:
        with pytest.raises(InputError, match=text):
            session.drive(signals, later)
        session.drive({"load.tau": 0.16})  # a number is a signal, as for a run
        assert session.run({"load.b": np.array(0.0)})[1][-1, 0] > 0.0


def test_an_instance_is_no_variable(system) -> None:
    with pytest.raises(InputError, match=r"'load' is an instance, not one of its var.*'load\.w'"):
        Master(system).run(0.01, record=["load"])


def test_what_is_set_and_driven_is_told() -> None:
    """The twin: an open input that is set is driven by nothing."""
    one = System("disc", default_provider())
    one.add("load", "inertia/disc")
    one.set("load.tau", 3.0)
    (note,) = Master(one).run(0.01, inputs={"load.tau": 1.0}).notes
    assert "load.tau is set, but driven by an input of the run" in note
    assert not Master(one).run(0.01).notes
