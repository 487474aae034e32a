"""The compiled executor gives the same bits and the same errors as the one in Python."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest

from cosim import Constant, Function, Master, System, Table
from cosim.data.recording import Recording
from cosim.errors import StepError, ValueRangeError
from cosim.master import algorithms, kernel
from cosim.master.kernel import instructions
from cosim.master.plan import operations
from cosim.spec import cache
from sources.packaging.kernel import build_kernel
from sources.packaging.platforms import host_platform
from tests.cosim_fmus import slave
from tests.fmus import fmu

ALGORITHMS = ("jacobi", "gauss_seidel")
"""Those that run compiled; algorithms that repeat steps run in Python."""
STEP = 1e-4
SINE = Function(lambda t: 20.0 * np.sin(30.0 * t))


@pytest.fixture(scope="module", autouse=True)
def library() -> Path:
    return build_kernel(
        kernel.SOURCES, kernel.cache_folder() / kernel.library_name(), host_platform()
    )


class Built:
    def __init__(self, fmi: int) -> None:
        self.fmi = fmi

    def path(self, variant: str) -> Path:
        return fmu(variant, "native", self.fmi)


def bench(motor: str = "electrical", gear: str = "ratio", fmi: int = 2) -> System:
    system = System("bench", Built(fmi))
    system.add("motor", f"dc_motor/{motor}")
    system.add("gearbox", f"gearbox/{gear}")
    system.add("load", "inertia/disc")
    system.connect("motor.tau", "gearbox.tau_a", factor=1.01, offset=1e-4)
    system.connect("gearbox.w_a", "motor.w")
    system.connect("gearbox.tau_b", "load.tau")
    system.connect("gearbox.J_b", "load.J_added")
    system.connect("load.w", "gearbox.w_b")
    return system


def chain() -> System:
    """Two benches, the second follows the first: more calls of each kind in a row."""
    system = System("chain", Built(2))
    for k in (1, 2):
        system.add(f"motor{k}", "dc_motor/ideal")
        system.add(f"gearbox{k}", "gearbox/ratio")
        system.add(f"load{k}", "inertia/disc")
        system.connect(f"motor{k}.tau", f"gearbox{k}.tau_a")
        system.connect(f"gearbox{k}.w_a", f"motor{k}.w")
        system.connect(f"gearbox{k}.tau_b", f"load{k}.tau")
        system.connect(f"gearbox{k}.J_b", f"load{k}.J_added")
        system.connect(f"load{k}.w", f"gearbox{k}.w_b")
    system.connect("load1.w", "motor2.w_ref", factor=-1.0)
    return system


def mixed(affine: Path, foreign3: Path) -> System:
    """FMI 2 and 3, C and Python, real numbers, integers and booleans, in one ring."""
    system = System("mixed", Built(3))
    system.add("a", str(affine), {"a": 0.5, "b": -0.25})
    system.add("disc", "inertia/disc")
    system.add("c", str(foreign3))
    system.add("d", str(affine), {"a": -1.0})
    system.connect("a.y", "disc.tau", convert=False)
    system.connect("disc.w", "c.u", convert=False)
    system.connect("c.y", "d.u")
    system.connect("d.y", "a.u", factor=0.5, offset=0.125)
    system.connect("a.next", "c.n")
    system.connect("c.next", "d.n", factor=2.0, offset=-3.0)
    system.connect("a.off", "c.on")
    system.connect("c.off", "d.on", factor=-1.0, offset=1.0)
    return system


def same(first: Recording, second: Recording) -> None:
    assert first.names == second.names
    assert first.time.tobytes() == second.time.tobytes()
    assert first.values.tobytes() == second.values.tobytes()  # signs of zeros, too
    assert first.bond_energy == second.bond_energy
    assert first.provenance == second.provenance
    assert first.error == second.error


def both(
    system: System, duration: float, algorithm: str = "jacobi", **settings: object
) -> Recording:
    """Run with both executors and compare every bit."""
    step = settings.pop("step", STEP)
    results = [
        Master(system, algorithm, step, executor=executor).run(duration, **settings)
        for executor in ("python", "c")
    ]
    same(*results)
    return results[1]


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(
    ("motor", "gear"),
    [("ideal", "ratio"), ("electrical", "lossy"), ("sampled", "elastic")],
)
def test_benches(algorithm: str, fmi: int, motor: str, gear: str) -> None:
    recording = both(bench(motor, gear, fmi), 0.02, algorithm, inputs={"motor.w_ref": SINE})
    assert len(recording.bond_energy) == 2 and all(recording.bond_energy.values())
    assert np.ptp(recording["load.w"]) > 0.0


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("every", [1, 3, 7, 100])
@pytest.mark.parametrize("count", [1, 99, 205])
def test_settings_of_the_recording(algorithm: str, every: int, count: int) -> None:
    names = ["load2.phi", "motor2.w_ref", "load1.w", "motor1.w_ref", "gearbox1.J_b"]
    recording = both(
        chain(), count * STEP, algorithm, inputs={"motor1.w_ref": SINE}, record=names,
        every=every, start=0.25,
    )  # fmt: skip
    assert len(recording) == count // every + 1
    assert recording.time[0] == 0.25


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_no_bonds_and_nothing_recorded(algorithm: str, affine: Path) -> None:
    system = System("pair")
    system.add("a", str(affine))
    system.add("b", str(affine))
    system.connect("a.y", "b.u")
    recording = both(system, 1.0, algorithm, step=0.1, record=[], inputs={"a.u": 2.0})
    assert recording.values.shape == (11, 0) and not recording.bond_energy


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_mixed_types_and_versions(algorithm: str, affine: Path, foreign3: Path) -> None:
    recording = both(
        mixed(affine, foreign3), 3.0, algorithm, step=0.01,
        inputs={
            "a.n": Table([0.0, 1.0], [5.0, -7.0], extend=True),
            "a.on": Table([0.0, 0.5, 2.0], [1.0, 0.0, 1.0], extend=True),
            "disc.J_added": Constant(0.2),
        },
    )  # fmt: skip
    assert set(recording["a.next"]) == {6.0, -6.0} and set(recording["d.off"]) == {0.0, 1.0}
    assert recording["d.next"][-1] == 2.0 * -5.0 - 3.0 + 1.0
    assert np.ptp(recording["disc.w"]) > 0.0


def test_numbers_that_are_whole_up_to_rounding_become_integers(affine: Path) -> None:
    system = System("rounded")
    system.add("a", str(affine))
    system.add("b", str(affine))
    system.connect("a.y", "b.n")
    values = Table(
        [0.0, 0.1, 0.2, 0.3], [2.9999999999999996, -2.0 - 1e-10, 0.0, 2147483646.0], extend=True
    )
    recording = both(system, 0.5, step=0.1, inputs={"a.u": values}, record=["b.next", "b.n"])
    assert recording["b.next"].tolist() == [4.0, 4.0, 4.0, -1.0, 1.0, 2147483647.0]


@pytest.mark.parametrize("value", [0.4, 2.9999, -0.5, 1e9 + 0.5])
def test_numbers_that_are_not_whole_do_not_become_integers(value: float, affine: Path) -> None:
    system = System("fraction")
    system.add("a", str(affine))
    system.add("b", str(affine))
    system.connect("a.y", "b.n")
    error = errors(
        system, 1.0, "jacobi", inputs={"a.u": Table([0.0, 0.3], [1.0, value], extend=True)}
    )
    assert f"setting n from a.y: {value!r} is no whole number, and type Int32" in str(error)


@pytest.mark.parametrize("value", [0.4, 2.0, -1.0])
def test_numbers_that_are_no_truth_value(value: float, affine: Path) -> None:
    system = System("truth")
    system.add("b", str(affine))
    signal = Table([0.0, 0.3], [1.0, value], extend=True)
    error = errors(system, 1.0, "jacobi", inputs={"b.on": signal})
    assert f"setting on from table: {value!r} is neither true (1) nor false (0)" in str(error)


def test_signed_zero(affine: Path) -> None:
    system = System("zero")
    system.add("a", str(affine), {"a": -1.0})
    system.add("b", str(affine))
    system.connect("a.y", "b.u")
    recording = both(system, 0.2, step=0.1, record=["a.y", "b.u", "b.y"], inputs={"a.u": 0.0})
    assert not recording.values.any()


def test_two_in_threads_are_as_one_alone() -> None:
    systems = [bench("electrical"), chain()]
    inputs = [{"motor.w_ref": SINE}, {"motor1.w_ref": SINE}]
    alone = [
        Master(s, step=STEP, executor="c").run(0.3, inputs=i)
        for s, i in zip(systems, inputs, strict=True)
    ]
    found: dict[int, Recording] = {}

    def work(k: int) -> None:
        found[k] = Master(systems[k % 2], step=STEP, executor="c").run(0.3, inputs=inputs[k % 2])

    threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for k in range(4):
        same(found[k], alone[k % 2])


def test_unlike_copies_and_calls_are_not_merged(affine: Path, foreign3: Path) -> None:
    """One instruction per run of like operations, in the order of the plan."""
    system = mixed(affine, foreign3)
    seen: list[list[tuple[int, int, int]]] = []
    original = instructions.instructions

    def spy(*arguments: object) -> list[tuple[int, int, int]]:
        seen.append(original(*arguments))
        return seen[-1]

    patch = pytest.MonkeyPatch()
    patch.setattr(instructions, "instructions", spy)
    try:
        Master(system, "jacobi", 0.1, executor="c").run(0.1)
    finally:
        patch.undo()
    names = [instructions.Code(code).name for code, _, _ in seen[0]]
    assert names[:2] == ["EXTERNAL", "RECORD"] and names[-1] == "ENERGY"
    assert "COPY" in names and "SCALE" in names and "CONVERT_SET" in names
    steps = [n for n in names if n.startswith(("STEP", "WATCHED"))]
    assert steps == [
        "WATCHED2",
        "STEP3",
        "WATCHED3",
        "WATCHED2",
    ]  # the disc is made by our packager


def test_outputs_fetched_after_the_energy_are_noted_again() -> None:
    """Outputs may be noted at the end of the step before only if nothing comes between."""
    plan = algorithms.compile_plan("jacobi", bench(), [], ["load.w"])
    assert instructions.carried(plan)
    rows = plan.step.tolist()
    energy = rows.pop()
    late = type(plan)(
        plan.algorithm, plan.layout, plan.initial,
        operations([*rows[:-1], energy, rows[-1]]), plan.final,
    )  # fmt: skip
    assert not instructions.carried(late)


def test_outputs_fetched_twice_in_a_step_are_fetched_once_where_nobody_reads_between() -> None:
    """The motor's torque goes to the gearbox at once, the rest waits for the inputs at the end."""
    system = bench()
    observed = ["motor.i", "motor.P_loss", "load.w"]
    plan = algorithms.compile_plan(
        "gauss_seidel", system, [], observed, options={"extrapolation": 2}
    )
    names, needed = plan.layout.names, instructions.needed(plan)
    first = min(row for row in needed if plan.layout.instances[plan.step[row, 1]] == "motor")
    assert [names[slot] for slot in needed[first]] == ["motor.tau"]
    # fetched once: plain Jacobi asks each FMU once a step, for everything
    assert instructions.needed(algorithms.compile_plan("jacobi", system, [], observed)) == {}
    runs = [
        Master(system, "gauss_seidel", 1e-3, executor=executor, options={"extrapolation": 2}).run(
            0.3, inputs={"motor.w_ref": SINE}, record=observed
        )
        for executor in ("python", "c")
    ]
    same(*runs)


def test_stretches_of_slots() -> None:
    assert instructions.stretches([2, 3, 4, 7, 9, 10]) == [(2, 5), (7, 8), (9, 11)]
    assert instructions.stretches([]) == []


# -- errors ----------------------------------------------------------------------------------------


def errors(system: System, duration: float, algorithm: str, **settings: object) -> StepError:
    """The error of both executors, compared in everything."""
    step = settings.pop("step", 0.1)
    found: list[StepError] = []
    for executor in ("python", "c"):
        with pytest.raises(StepError) as caught:
            Master(system, algorithm, step, executor=executor).run(duration, **settings)
        found.append(caught.value)
    first, second = found
    assert str(first) == str(second)
    assert first.messages == second.messages
    assert (first.time, first.exit_code) == (second.time, second.exit_code)
    assert first.recording is not None and second.recording is not None
    same(first.recording, second.recording)
    return second


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_an_fmu_that_fails_in_a_step(algorithm: str, affine: Path) -> None:
    system = System("belt")
    system.add("a", str(affine))
    system.add("b", str(affine), {"fail_at": 0.45})
    system.connect("a.y", "b.u")
    error = errors(system, 1.0, algorithm, every=2)
    assert "belt came off" in str(error) and error.time == pytest.approx(0.4)
    assert error.recording is not None and len(error.recording) == 3


NAN2 = """
import math
from pythonfmu import Fmi2Causality as C, Fmi2Slave, Real


class {name}(Fmi2Slave):
    def __init__(self, **arguments):
        super().__init__(**arguments)
        self.time, self.at = 0.0, 0.25
        self.register_variable(Real("at", causality=C.parameter, variability="tunable"))
        self.register_variable(Real("y", causality=C.output,
                                    getter=lambda: math.nan if self.time > self.at else self.time))

    def do_step(self, time, size):
        self.time = time + size
        return True
"""


@pytest.fixture(scope="module")
def drifter(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Foreign FMU whose output is the time, and not a number after `at`."""
    return slave(tmp_path_factory.mktemp("nan"), "drifter", NAN2, "pythonfmu")


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("fmi", [2, 3])
def test_an_input_that_is_not_a_number(algorithm: str, fmi: int, drifter: Path) -> None:
    system = System("nan", Built(fmi))
    system.add("source", str(drifter))
    system.add("load", "inertia/disc")
    system.connect("source.y", "load.tau")
    error = errors(system, 1.0, algorithm, record=["load.w"])
    assert "setting tau" in str(error) and "cannot be set to nan" in str(error)
    assert "load (inertia/disc)" in str(error)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_recorded_value_that_is_not_finite(algorithm: str, drifter: Path) -> None:
    system = System("nan")
    system.add("source", str(drifter))
    error = errors(system, 1.0, algorithm)
    assert "source.y became nan without an error of its FMU" in str(error)
    assert error.recording is not None and len(error.recording) == 3


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("fmi", [2, 3])
def test_an_output_that_is_not_finite(algorithm: str, fmi: int) -> None:
    """Our FMUs refuse to hand out what is not finite: here the square of a speed of 1e200."""
    system = System("overflow", Built(fmi))
    system.add("load", "inertia/disc")
    error = errors(
        system, 1.0, algorithm, inputs={"load.tau": 1e200}, record=["load.w", "load.E_stored"]
    )
    assert "getting w, E_stored at t = 0.1 s" in str(error)
    assert "variable E_stored is not finite (inf)" in str(error)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("fmi", [2, 3])
def test_a_state_that_is_not_finite(algorithm: str, fmi: int) -> None:
    system = System("overflow", Built(fmi))
    system.add("load", "inertia/disc", {"J": 1e-9})
    blow = Table([0.0, 0.2], [0.0, 1e305], extend=True)
    error = errors(system, 1.0, algorithm, inputs={"load.tau": blow}, record=["load.phi"])
    assert "a step of 0.1 s at t = 0.2 s" in str(error) and "is not finite" in str(error)


@pytest.mark.parametrize(
    ("value", "shown"),
    [(3e9, "3000000000.0"), (-2147483649.0, "-2147483649.0"), (2147483648.0, "2147483648.0")],
)
def test_numbers_that_do_not_fit_an_integer(value: float, shown: str, affine: Path) -> None:
    system = System("unfit")
    system.add("a", str(affine))
    system.add("b", str(affine))
    system.connect("a.y", "b.n")
    error = errors(
        system, 1.0, "jacobi", inputs={"a.u": Table([0.0, 0.3], [1.0, value], extend=True)},
    )  # fmt: skip
    assert f"b (affine): setting n from a.y: {shown} does not fit type Int32 at t = 0.4 s" in str(
        error
    )


def test_not_a_number_does_not_fit_an_integer(affine: Path, drifter: Path) -> None:
    system = System("unfit")
    system.add("source", str(drifter))
    system.add("b", str(affine))
    system.connect("source.y", "b.n", factor=10.0)  # time, so a whole number of tenths
    error = errors(system, 1.0, "jacobi", record=["b.next"])
    assert "setting n from source.y: nan is no whole number" in str(error)


STOP3 = """
from pythonfmu3 import Fmi3Causality as C, Fmi3Slave, Float64


class {name}(Fmi3Slave):
    def __init__(self, **arguments):
        super().__init__(**arguments)
        self.time, self.y = 0.0, 0.0
        self.register_variable(Float64("time", causality=C.independent))
        self.register_variable(Float64("y", causality=C.output))

    def do_step(self, time, size):
        self.y = time
        return time < 0.35
"""


def test_an_fmi_3_fmu_that_fails_in_a_step(tmp_path: Path) -> None:
    system = System("stop")
    system.add("s", str(slave(tmp_path, "stopper", STOP3, "pythonfmu3")))
    error = errors(system, 1.0, "jacobi")
    assert error.time == pytest.approx(0.4) and "a step of 0.1 s" in str(error)


def test_executors_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueRangeError, match="executor 'fortran': must be auto, c or python"):
        Master(bench(), step=STEP, executor="fortran").run(STEP)
    monkeypatch.setattr(kernel, "find", lambda: None)
    with pytest.raises(ValueRangeError, match=r"this machine has no kernel-.* compiles it"):
        Master(bench(), step=STEP, executor="c").run(STEP)
    assert len(Master(bench(), step=STEP).run(STEP)) == 2  # auto: the one in Python


@pytest.mark.parametrize("length", [0, 5, 63, 2000])
def test_a_library_that_was_cut_short_is_made_again(
    library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, length: int
) -> None:
    monkeypatch.setenv("COSIM_CACHE", str(tmp_path))
    path = kernel.cache_folder() / kernel.library_name()
    path.parent.mkdir(parents=True)
    path.write_bytes(library.read_bytes())
    cache.seal(path).write_bytes(cache.seal(library).read_bytes())
    assert kernel.find() == path
    path.write_bytes(library.read_bytes()[:length])
    assert kernel.find() is None  # so the builder compiles it again
