"""A twin in steps does what a run does, bit for bit, and returns to where it was."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import cosim
from cosim.data.signals import Table
from cosim.errors import (
    FmuCallError,
    GraphError,
    StepError,
    UnitError,
    UnknownNameError,
    ValueRangeError,
)
from cosim.master import twin as twins
from cosim.master.master import Master
from cosim.master.twin import Twin
from cosim.system.system import System
from tests.cosim.bench import bench
from tests.cosim.test_fmi_runs import CLOCK, EARLY, END, TIME
from tests.tiny_fmus import V, tiny

STEP, COUNT = 1e-3, 60
RECORD = ["load.w", "motor.i", "motor.w_ref", "gearbox.tau_b"]
SPEEDS = 20.0 + 5.0 * np.sin(np.arange(COUNT + 1) / 7.0)
ALGORITHMS = [
    ("jacobi", {}, "c"),
    ("jacobi", {}, "python"),
    ("gauss_seidel", {}, "c"),
    ("iterated", {}, "auto"),
    ("iterated", {"interpolation": 1}, "auto"),
]


def speeds() -> Table:
    return Table(STEP * np.arange(COUNT + 1), SPEEDS, unit="rad/s")


@pytest.fixture
def master(provider) -> Master:
    return Master(bench(provider), "gauss_seidel", STEP)


def go(twin: Twin, count: int) -> None:
    """Steps of 1, 2, 3 ... communication steps, with the speeds set before each of them."""
    for _ in range(count):
        twin.set("motor.w_ref", SPEEDS[round(twin.time / STEP)])
        twin.step()


@pytest.mark.parametrize(("algorithm", "options", "executor"), ALGORITHMS)
def test_steps_are_a_run_bit_for_bit(provider, algorithm, options, executor) -> None:
    master = Master(bench(provider), algorithm, STEP, options=options, executor=executor)
    run = master.run(STEP * COUNT, inputs={"motor.w_ref": speeds()}, record=RECORD, every=3)
    # a table that is overruled, so that the executor is the same; at the end every value is its own
    with Twin(master, STEP * COUNT, inputs={"motor.w_ref": 1.0}, record=RECORD, every=3) as twin:
        go(twin, COUNT // 2)
        so_far = twin.recording.values  # its last row has the input that holds, the run's the next
        assert np.array_equal(so_far[:-1], run.values[: COUNT // 6])
        go(twin, COUNT - COUNT // 2)
        twin.set("motor.w_ref", SPEEDS[-1])
    assert np.array_equal(twin.recording.values, run.values)
    assert np.array_equal(twin.recording.time, run.time)
    assert twin.recording.bond_energy == run.bond_energy
    assert twin.recording.provenance["inputs"] == {"motor.w_ref": "set in steps"}


def test_an_input_that_no_signal_drives_and_a_parameter_can_be_set(master) -> None:
    damping = np.where(np.arange(COUNT + 1) < COUNT // 2, 0.01, 0.5)
    given = {"motor.w_ref": 20.0, "load.b": Table(STEP * np.arange(COUNT + 1), damping)}
    run = master.run(STEP * COUNT, inputs=given, record=RECORD)
    with Twin(master, record=RECORD) as twin:
        twin.set("motor.w_ref", 20.0)
        for value in (0.01, 0.5):
            twin.set("load.b", value)
            twin.step(STEP * COUNT / 2)
        assert twin.get("load.b") == 0.5
        assert twin.get("motor.w_ref") == 20.0
        assert twin.get("load.w") == run["load.w"][-1]
        assert np.array_equal(twin.recording["load.w"], run["load.w"])


def test_it_returns_to_saved_states_with_its_recording(master) -> None:
    with Twin(master, record=RECORD) as plain:
        go(plain, COUNT)
    with Twin(master, record=RECORD) as twin:
        go(twin, 20)
        early = twin.save()
        go(twin, 10)
        late = twin.save()
        twin.restore(early)
        assert twin.time == early.time
        twin.set("motor.w_ref", -30.0)
        twin.step(STEP * 30)
        assert twin.recording["motor.w_ref"][25] == -30.0
        twin.restore(late)
        go(twin, COUNT - 30)
    assert np.array_equal(twin.recording.values, plain.recording.values)
    assert twin.recording.bond_energy == plain.recording.bond_energy


def test_a_dropped_state_and_one_of_another_twin_are_refused(master) -> None:
    with Twin(master) as twin, Twin(master) as other:
        saved = twin.save()
        with pytest.raises(ValueRangeError, match="not one of this twin"):
            other.restore(saved)
        twin.drop(saved)
        with pytest.raises(ValueRangeError, match="was dropped"):
            twin.restore(saved)


def test_a_fork_goes_on_by_itself(master) -> None:
    with Twin(master, record=RECORD) as twin:
        go(twin, 20)
        with twin.fork() as fork:
            fork.set("motor.w_ref", -30.0)
            fork.step(STEP * 20)
            assert fork.get("load.w") < twin.get("load.w")
        with twin.fork() as same:
            go(same, 20)
        go(twin, 20)
        assert np.array_equal(twin.recording.values, same.recording.values)
        assert np.array_equal(twin.recording.values[:20], fork.recording.values[:20])


def test_an_endless_twin_has_no_seams(master, monkeypatch) -> None:
    longer = STEP * (COUNT + 1)  # the last step of a run is cut to its end, by rounding
    with Twin(master, longer, inputs={"motor.w_ref": speeds()}, record=RECORD) as whole:
        whole.step(STEP * COUNT)
    monkeypatch.setattr(twins, "WINDOW", 7)
    with Twin(master, inputs={"motor.w_ref": speeds()}, record=RECORD, every=2) as twin:
        twin.step(STEP * 30)
        saved = twin.save()
        twin.step(STEP * 20)
        later = twin.save()
        twin.restore(saved)
        with twin.fork() as fork:
            fork.step(STEP * 20)
        twin.restore(later)
        twin.step(STEP * (COUNT - 50))
        assert twin.end == math.inf
        assert np.array_equal(twin.recording.values, whole.recording.values[::2])
        assert np.array_equal(twin.recording.time, whole.recording.time[::2])
        assert np.array_equal(fork.recording.values, whole.recording.values[:51:2])
        twin.step(STEP * 100)  # the table holds its last value
        assert twin.get("motor.w_ref") == SPEEDS[-1]


def test_it_begins_again_as_it_began(master) -> None:
    with Twin(master, inputs={"motor.w_ref": speeds()}, record=RECORD) as twin:
        twin.step(STEP * 20)
        first = twin.recording
        twin.set("motor.w_ref", 3.0)
        twin.step()
        twin.restart()
        assert twin.time == 0.0
        twin.step(STEP * 20)
    assert np.array_equal(twin.recording.values, first.values)


def test_values_come_in_other_units(master) -> None:
    with Twin(master) as twin:
        twin.set("motor.w_ref", 60.0, "rpm")
        assert twin.get("motor.w_ref") == pytest.approx(2.0 * math.pi, rel=1e-14)  # rounding
        assert twin.get("motor.w_ref", "rpm") == pytest.approx(60.0, rel=1e-14)
        assert twin.unit("motor.w_ref") == "rad/s" == twin.inputs()["motor.w_ref"]
        with pytest.raises(UnitError, match=r"motor.w_ref in 'kg'"):
            twin.set("motor.w_ref", 1.0, "kg")


def test_wrong_names_and_values_are_refused_with_the_way_out(master) -> None:
    with Twin(master, STEP * COUNT) as twin:
        with pytest.raises(UnknownNameError, match="did you mean 'w_ref'"):
            twin.set("motor.w_reff", 1.0)
        with pytest.raises(UnknownNameError, match="did you mean 'motor'"):
            twin.get("moto.i")
        with pytest.raises(UnknownNameError, match=r"causality 'output'.*motor.w_ref"):
            twin.set("load.w", 1.0)
        with pytest.raises(GraphError, match=r"driven by load.w.*motor.w_ref"):
            twin.set("gearbox.w_b", 1.0)
        with pytest.raises(ValueRangeError, match="nan"):
            twin.set("motor.w_ref", math.nan)
        with pytest.raises(ValueRangeError, match=r"0.0105 s is not a whole.*0.001 s; take 0.01 s"):
            twin.step(0.0105)
        with pytest.raises(ValueRangeError, match=r"step of 0.07 s from t = 0 s.*end at 0.06 s"):
            twin.step(0.07)
    with pytest.raises(FmuCallError, match="is closed"):
        twin.step()


def test_an_algorithm_that_looks_ahead_is_refused(provider) -> None:
    with pytest.raises(ValueRangeError, match=r"'adaptive' looks ahead.*gauss_seidel"):
        Twin(Master(bench(provider), "adaptive", STEP))


def test_a_name_of_several_runs_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="motor_bench/ST1"):
        cosim.open("motor_bench")


def test_a_scenario_opens_by_name() -> None:
    run = cosim.run("motor_bench/ST1", duration=0.02).recording
    with cosim.open("motor_bench/ST1", duration=0.02) as twin:
        while twin.time < twin.end:
            twin.step(1e-3)
    assert np.array_equal(twin.recording.values, run.values)


@pytest.mark.slow
def test_a_fault_keeps_what_was_recorded(affine: Path) -> None:
    system = System("belt")
    system.add("a", str(affine))
    with Twin(Master(system, step=0.1), inputs={"a.u": 1.0}, record=["a.y"]) as twin:
        twin.set("a.fail_at", 0.35)
        with pytest.raises(StepError, match="belt came off") as caught:
            twin.step(1.0)
        assert len(caught.value.recording) == 4  # t = 0, 0.1, 0.2, 0.3
        assert twin.recording.error
        with pytest.raises(FmuCallError, match="has stopped"):
            twin.step()
        twin.restart()
        assert twin.step(1.0) == pytest.approx(1.0)


@pytest.mark.slow
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(("law", "status"), [(END, 0), (EARLY, 2)])
def test_it_ends_where_an_fmu_asks_as_a_run_does(fmi, law, status, tmp_path: Path) -> None:
    text = law.replace("END_STATUS", str(status if fmi == 2 else 0))
    system = System("alone")
    for name in "ab":
        system.add(name, str(tiny(tmp_path, CLOCK, TIME, text, fmi=fmi)))
    for every in (1, 3):
        master = Master(system, step=0.1)
        run = master.run(1.0, every=every)
        with Twin(master, 1.0, every=every) as twin:
            twin.step(1.0)
            assert "asked to end" in twin.ended
            with pytest.raises(FmuCallError, match=r"has ended: .*asked to end"):
                twin.step()
        assert np.array_equal(twin.recording.time, run.time)
        assert np.array_equal(twin.recording.values, run.values)
        assert twin.recording.notes == run.notes


@pytest.mark.slow
def test_fmus_of_version_3_are_saved_and_forked(provider) -> None:
    provider.fmi = 3
    master = Master(bench(provider), "gauss_seidel", STEP)
    with Twin(master, record=RECORD) as twin:
        go(twin, 20)
        saved = twin.save()
        go(twin, 20)
        first = twin.recording.values
        twin.restore(saved)
        with twin.fork() as fork:
            go(fork, 20)
        go(twin, 20)
    assert np.array_equal(twin.recording.values, first)
    assert np.array_equal(fork.recording.values, first)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("executor", ["c", "python"])
def test_steps_after_a_saved_state_are_not_said_to_be_final(
    tmp_path: Path, executor: str, fmi: int
) -> None:
    # the FMU refuses to return to before a step that was said to be final
    variables = [V("u", "Float64", "input", "0"), V("y", "Float64", "output")]
    law = "v->r[9][0] += h * v->r[0][0];"
    system = System()
    system.add("m", str(tiny(tmp_path, variables, "v->r[1][0] = v->r[9][0];", law, fmi=fmi)))
    with Twin(Master(system, step=0.125, executor=executor)) as twin:
        twin.set("m.u", 1.0)
        twin.step(0.25)
        saved = twin.save()
        for _ in range(2):
            twin.step(0.5)
            assert twin.get("m.y") == 0.75
            twin.restore(saved)
            assert twin.get("m.y") == 0.25
