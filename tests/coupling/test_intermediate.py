"""Inputs that FMUs of FMI 3 ask for within a step (intermediate update), anybody's and ours."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.errors import StepError, UnknownNameError, ValueRangeError
from cosim.fmu.description import Description
from cosim.master.master import Master
from cosim.master.twin import Twin
from cosim.system.system import System
from tests.coupling.conftest import Built
from tests.coupling.test_coupling_orders import INPUTS, SIGNALS, drive
from tests.tiny_fmus import CAN, V, tiny

STEP = 0.1
CLOCK = [V("y", "Float64", "output")]
"""An FMU whose output is the time: a straight line, which extrapolation knows exactly."""
ASKS = f'{CAN} providesIntermediateUpdate="true"'
MOVING = 'intermediateUpdate="true"'
TAKER = [V("u", "Float64", "input", "0", more=MOVING), V("y", "Float64", "output")]
SIMPSON = """
  const double a = v->r[0][0];
  ask(m, t + 0.5 * h, false);
  const double b = v->r[0][0];
  ask(m, t + h, true);
  const double c = v->r[0][0];
  v->r[1][0] += h / 6 * (a * a + 4 * b * b + c * c);
"""
"""y' = u^2, for which Simpson's rule is exact if u is a straight line."""
EXECUTORS = pytest.mark.parametrize("executor", ["python", "c"])


def taker(folder: Path, step: str = SIMPSON, variables: Sequence[V] = TAKER, **how: str) -> Path:
    line = " ".join(step.split())  # it becomes a macro
    return tiny(folder, variables, step=line, name="taker", **{"interface": ASKS, **how})


def pair(folder: Path, path: Path) -> System:
    """A clock, and what takes its time."""
    clock = tiny(folder, CLOCK, "v->r[0][0] = v->t;", name="clock")
    system = System("pair")
    system.add("clock", str(clock))
    system.add("taker", str(path))
    system.connect("clock.y", "taker.u")
    return system


def run(
    system: System, executor: str = "auto", record: Sequence[str] = ("taker.y",), **how: object
) -> Recording:
    how = {"algorithm": "jacobi", "options": {"extrapolation": 1}, **how}
    master = Master(system, step=STEP, executor=executor, **how)  # type: ignore[arg-type]
    return master.run(1.0, record=list(record))


# -- anybody's FMUs ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("algorithm", "options"),
    [
        ("jacobi", {"extrapolation": 1}),
        ("jacobi", {"extrapolation": 2}),
        ("gauss_seidel", {"extrapolation": 1}),
        ("iterated", {"interpolation": 1}),
    ],
)
def test_an_fmu_that_asks_sees_its_input_move(tmp_path: Path, algorithm: str, options) -> None:
    system = pair(tmp_path, taker(tmp_path))
    runs = [
        run(system, executor, algorithm=algorithm, options=options) for executor in ("python", "c")
    ]
    assert runs[0].values.tobytes() == runs[1].values.tobytes()
    # exact up to rounding of sums of ten terms
    np.testing.assert_allclose(runs[0]["taker.y"], runs[0].time ** 3 / 3.0, rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize("missing", ["interface", "variable"])
def test_an_fmu_that_does_not_say_so_gets_the_mean(tmp_path: Path, missing: str) -> None:
    silent = [V("u", "Float64", "input", "0"), TAKER[1]]
    path = (
        taker(tmp_path, interface=CAN)
        if missing == "interface"
        else taker(tmp_path, variables=silent)
    )
    found = run(pair(tmp_path, path))
    # each step takes the square of the mean in place of the mean square, h^2/12 too little
    lost = found.time * STEP**2 / 12.0
    np.testing.assert_allclose(found["taker.y"], found.time**3 / 3.0 - lost, rtol=1e-12, atol=1e-15)


def test_nothing_is_registered_where_no_input_moves(tmp_path: Path) -> None:
    """`y` is the number of variables that the master registered, 100 more with a callback."""
    told = "v->r[1][0] = m->required + (m->update ? 100 : 0);"
    path = taker(tmp_path, told)
    assert run(pair(tmp_path, path))["taker.y"][-1] == 101.0
    assert run(pair(tmp_path, path), options={})["taker.y"][-1] == 0.0


def test_step_by_step_is_the_run(tmp_path: Path) -> None:
    system = pair(tmp_path, taker(tmp_path))
    master = Master(system, "jacobi", STEP, options={"extrapolation": 1})
    with Twin(master, record=["taker.y"]) as twin:
        for _ in range(10):
            twin.step()
        assert twin.recording.values.tobytes() == run(system).values.tobytes()


@EXECUTORS
def test_arrays_and_single_precision_move_element_by_element(tmp_path: Path, executor: str) -> None:
    variables = [
        V("u", "Float64", "input", "0 7", size=(2,), more=MOVING),
        V("s", "Float32", "input", "0", more=MOVING),
        V("held", "Float64", "input", "0"),
        V("y", "Float64", "output", size=(4,)),
    ]
    step = """
      ask(m, t + 0.25 * h, false);
      v->r[3][0] = v->r[0][0], v->r[3][1] = v->r[0][1];
      v->r[3][2] = v->r[1][0], v->r[3][3] = v->r[2][0];
    """
    clock = tiny(tmp_path, CLOCK, "v->r[0][0] = v->t;", name="clock")
    system = System("arrays")
    system.add("clock", str(clock))
    path = taker(tmp_path, step, variables, begin="v->r[0][1] = 7;")
    system.add("taker", str(path))
    for target in ("u[1]", "s", "held"):
        system.connect("clock.y", f"taker.{target}")
    found = run(system, executor, record=[f"taker.y[{k}]" for k in range(1, 5)])
    begin = found.time[:-1]
    np.testing.assert_allclose(found["taker.y[1]"][1:], begin + 0.25 * STEP, rtol=1e-13)
    assert set(found["taker.y[2]"][1:]) == {7.0}  # nobody drives it: its start value
    np.testing.assert_allclose(found["taker.y[3]"][1:], begin + 0.25 * STEP, rtol=1e-7)  # 24 bits
    np.testing.assert_allclose(found["taker.y[4]"][1:], begin + 0.5 * STEP, rtol=1e-13)  # the mean


@EXECUTORS
@pytest.mark.parametrize(
    ("step", "text"),
    [
        ("ask(m, t + 1.5 * h, false);", r"asked for inputs of t = 0\.15 s, outside of its step "
         r"\(from 0 s to 0\.1 s\)"),
        ("ask(m, t - h, false);", r"asked for inputs of t = -0\.1 s, outside of its step"),
        ("ask(m, 0.0 / 0.0, false);", r"asked for inputs of t = -?nan s, outside of its step"),
        ("v->set_code = 3; say(m, 3, \"no\"); ask(m, t + h, false);",
         r"setting u within the step, to what they are at t = 0\.1 s, at t = 0 s failed with "
         r"status 'error': error: no"),
        ("v->soon = true; v->last = t + 0.5 * h;",
         r"a step of 0\.1 s ended early, at 0\.05 s, unasked"),
    ],
)  # fmt: skip
def test_updates_against_the_standard_end_the_run(
    tmp_path: Path, executor: str, step: str, text: str
) -> None:
    with pytest.raises(StepError, match=rf"taker \(m\): {text}"):
        run(pair(tmp_path, taker(tmp_path, step)), executor, options={"extrapolation": 1})


@EXECUTORS
def test_what_the_standard_allows_is_no_error(tmp_path: Path, executor: str) -> None:
    """A time twice, back within what is not finished, both ends, an end that is called early."""
    step = """
      ask(m, t + h, false), ask(m, t, false);
      ask(m, t + 0.5 * h, false), ask(m, t + 0.5 * h, false);
      v->r[1][0] = v->r[0][0];
      ask(m, t + h, true);
      v->soon = true, v->last = t + h;
    """
    found = run(pair(tmp_path, taker(tmp_path, step)), executor)
    np.testing.assert_allclose(found["taker.y"][1:], found.time[:-1] + 0.5 * STEP, rtol=1e-13)
    assert found.notes == ()


@EXECUTORS
def test_going_back_behind_a_finished_time_is_a_note(tmp_path: Path, executor: str) -> None:
    step = "ask(m, t + 0.5 * h, true), ask(m, t + 0.25 * h, false), v->r[1][0] = v->r[0][0];"
    found = run(pair(tmp_path, taker(tmp_path, step)), executor)
    np.testing.assert_allclose(found["taker.y"][1:], found.time[:-1] + 0.25 * STEP, rtol=1e-13)
    (note,) = found.notes
    assert "taker (m): asked for inputs of t = 0.925 s after it had said to have finished" in note


@EXECUTORS
def test_warnings_within_a_step_are_notes(tmp_path: Path, executor: str) -> None:
    step = "v->set_code = 1; ask(m, t + h, false); v->set_code = 0;"
    found = run(pair(tmp_path, taker(tmp_path, step)), executor)
    assert "taker (m): setting inputs within a step returned status 'warning'" in found.notes


@EXECUTORS
def test_who_wants_no_inputs_keeps_them(tmp_path: Path, executor: str) -> None:
    step = "tell(m, t + 0.5 * h, false, false), tell(m, t + 9 * h, false, true);"
    found = run(pair(tmp_path, taker(tmp_path, step + "v->r[1][0] = v->r[0][0];")), executor)
    np.testing.assert_allclose(found["taker.y"][1:], found.time[:-1], rtol=1e-13, atol=1e-15)
    assert found.notes == ()


@EXECUTORS
def test_an_environment_that_is_lost_is_nobodys(tmp_path: Path, executor: str) -> None:
    """Asked without the pointer, the master cannot know who asks: the input stays where it was."""
    step = "void *mine = m->environment; m->environment = 0; ask(m, t + h, false);"
    step += "m->environment = mine; v->r[1][0] = v->r[0][0];"
    found = run(pair(tmp_path, taker(tmp_path, step)), executor)
    np.testing.assert_allclose(found["taker.y"][1:], found.time[:-1], rtol=1e-13, atol=1e-15)


@EXECUTORS
def test_instances_that_ask_do_not_disturb_each_other(tmp_path: Path, executor: str) -> None:
    system = pair(tmp_path, taker(tmp_path))
    system.add("other", system.members["taker"].reference)
    system.connect("clock.y", "other.u", factor=2.0)
    found = run(system, executor, record=["taker.y", "other.y"])
    # (2 t)^2: four times as much, up to rounding
    np.testing.assert_allclose(found["other.y"], 4.0 * found["taker.y"], rtol=1e-13)


@EXECUTORS
def test_an_fmu_may_ask_from_a_thread_of_its_own(tmp_path: Path, executor: str) -> None:
    step = "ask_in_thread(m, t + 0.5 * h); v->r[1][0] = v->r[0][0];"
    found = run(pair(tmp_path, taker(tmp_path, step)), executor)
    np.testing.assert_allclose(found["taker.y"][1:], found.time[:-1] + 0.5 * STEP, rtol=1e-13)


# -- inner steps, for FMUs whose inputs cannot move ------------------------------------------------

MIDPOINT = "v->r[1][0] += h * v->r[0][0] * v->r[0][0];"
"""y' = u^2 with u held over the step, as an FMU does that cannot move its inputs."""


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel"])
@pytest.mark.parametrize("parts", [1, 4])
def test_inner_steps_take_the_mean_of_each(
    tmp_path: Path, fmi: int, algorithm: str, parts: int
) -> None:
    plain = [V("u", "Float64", "input", "0"), TAKER[1]]
    path = tiny(tmp_path, plain, step=MIDPOINT, fmi=fmi, name="plain")
    options = {"extrapolation": 2, "inner_steps": {"taker": parts}}
    runs = [
        run(pair(tmp_path, path), executor, algorithm=algorithm, options=options)
        for executor in ("python", "c")
    ]
    assert runs[0].values.tobytes() == runs[1].values.tobytes()
    found = runs[0]
    # each part takes the square of its mean in place of the mean square: (h/n)^2/12 too little
    lost = found.time * (STEP / parts) ** 2 / 12.0
    np.testing.assert_allclose(found["taker.y"], found.time**3 / 3.0 - lost, rtol=1e-12, atol=1e-15)


def test_inner_steps_keep_the_mean_of_the_step(tmp_path: Path) -> None:
    """The integral of a parabola's parts is that of the parabola: y' = u with u = t^2."""
    plain = [V("u", "Float64", "input", "0"), TAKER[1]]
    path = tiny(tmp_path, plain, step="v->r[1][0] += h * v->r[0][0];", name="plain")
    square = tiny(tmp_path, CLOCK, "v->r[0][0] = v->t * v->t;", name="square")
    system = System("pair")
    system.add("square", str(square))
    system.add("taker", str(path))
    system.connect("square.y", "taker.u")
    for parts in (1, 3):
        options = {"extrapolation": 2, "inner_steps": {"taker": parts}}
        found = run(system, options=options)
        np.testing.assert_allclose(found["taker.y"], found.time**3 / 3.0, rtol=1e-12, atol=1e-15)


def test_inner_steps_that_make_no_sense_are_refused(tmp_path: Path) -> None:
    system = pair(tmp_path, taker(tmp_path))
    silent = pair(tmp_path, taker(tmp_path, interface=CAN))
    four = {"inner_steps": {"taker": 4}}
    for case, options, error, text in [
        (system, {"extrapolation": 1, **four}, ValueRangeError,
         r"inner_steps of taker: its FMU lets inputs move within a step \(u\); leave it out"),
        (silent, four, ValueRangeError, "inner_steps without extrapolation"),
        (silent, {"extrapolation": 1, "substeps": {"taker": 2}, **four}, ValueRangeError,
         "taker has substeps and inner_steps; take one of them"),
        (silent, {"extrapolation": 1, "inner_steps": {"takr": 4}}, UnknownNameError,
         "inner_steps: there is no instance 'takr'; did you mean 'taker'"),
        (silent, {"extrapolation": 1, "inner_steps": {"taker": 0.5}}, ValueRangeError,
         "inner_steps of taker: 0.5 is not a number from 1 to 999"),
    ]:  # fmt: skip
        with pytest.raises(error, match=text):
            run(case, options=options)


# -- ours ----------------------------------------------------------------------------------------


def benches(method: int | None, algorithm: str, options: dict[str, int]) -> list[Recording]:
    """The motor bench of FMI 2 and 3, all solvers of this method."""
    found = []
    for fmi in (2, 3):
        system = drive(Built(fmi))
        for name in ("motor", "load"):
            if method is not None:
                system.set(f"{name}.solver.method", method)
        master = Master(system, algorithm, 1e-3, options=options)
        found.append(master.run(0.03, inputs=INPUTS, record=SIGNALS))
    return found


@pytest.mark.parametrize("method", [1, 3, 5])
@pytest.mark.parametrize(
    ("algorithm", "options"),
    [
        ("jacobi", {"extrapolation": 1}),
        ("gauss_seidel", {"extrapolation": 2}),
        ("iterated", {"interpolation": 1}),
    ],
)
def test_version_3_is_version_2_bit_for_bit(method: int, algorithm: str, options) -> None:
    two, three = benches(method, algorithm, options)
    assert two.values.tobytes() == three.values.tobytes()
    assert two.bond_energy == three.bond_energy


@pytest.mark.parametrize("method", [2, 4])
def test_rodas3_takes_the_slope_of_inputs_from_their_values(method: int) -> None:
    two, three = benches(method, "gauss_seidel", {"extrapolation": 2})
    # differences of inputs over half a step cancel to 1e-16 of the input over h; 1e-12 of 40 rad/s
    np.testing.assert_allclose(three.values, two.values, rtol=1e-10, atol=1e-11)


@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel"])
def test_inner_steps_are_nearer_to_inputs_that_move(monkeypatch, algorithm: str) -> None:
    """The bench of FMI 3 as if its FMUs did not declare what they can."""
    moving, _ = benches(None, algorithm, {"extrapolation": 1})
    monkeypatch.setattr(Description, "moves", lambda *_: False)
    apart = []
    for parts in (1, 4):
        options = {"extrapolation": 1, "inner_steps": dict.fromkeys(("motor", "load"), parts)}
        runs = [
            Master(drive(Built(3)), algorithm, 1e-3, executor=executor, options=options).run(
                0.03, inputs=INPUTS, record=SIGNALS
            )
            for executor in ("python", "c")
        ]
        assert runs[0].values.tobytes() == runs[1].values.tobytes()
        assert runs[0].bond_energy == runs[1].bond_energy and runs[0].bond_energy
        apart.append(float(np.max(np.abs(runs[0]["load.w"] - moving["load.w"]))))
    # a staircase of four steps; what feeds through is late by an eighth of a step, was by a half
    assert 0.0 < apart[1] < 0.5 * apart[0]


def test_twins_of_version_3_return_and_fork() -> None:
    master = Master(drive(Built(3)), "gauss_seidel", 1e-3, options={"extrapolation": 2})
    with Twin(master, 0.02, inputs=INPUTS, record=SIGNALS) as twin:
        for _ in range(10):
            twin.step()
        saved = twin.save()
        with twin.fork() as fork:
            for either in (fork, twin):
                for _ in range(10):
                    either.step()
            first = twin.recording.values
            assert fork.recording.values.tobytes() == first.tobytes()
        twin.restore(saved)
        for _ in range(10):
            twin.step()
        assert twin.recording.values.tobytes() == first.tobytes()
    assert first.tobytes() == master.run(0.02, inputs=INPUTS, record=SIGNALS).values.tobytes()
