"""Runs: against an independent loop, against exact solutions, and when something fails."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from cosim.data.signals import Constant, Function, Table
from cosim.errors import (
    AlgebraicLoopError,
    GraphError,
    InputError,
    StepError,
    UnitError,
    UnknownNameError,
    ValueRangeError,
)
from cosim.master.master import Master
from cosim.system.system import System
from tests.cosim.bench import WIRES, bench
from tests.fmus import Slave, fmu


class Built3:
    def path(self, variant: str) -> Path:
        return fmu(variant, "native", 3)


def by_hand(steps: int, h: float, w_ref: float) -> list[float]:
    """The same Jacobi scheme through fmpy, written for this one system."""
    names = {"motor": "dc_motor.lab_bench/electrical", "gearbox": "gearbox.lab_bench/ratio",
             "load": "inertia.lab_bench/disc"}  # fmt: skip
    slaves = {key: Slave(fmu(name), initialize=False) for key, name in names.items()}
    values: dict[str, float] = {"motor.w_ref": w_ref}

    def get(name: str) -> None:
        instance, _, variable = name.partition(".")
        values[name] = float(slaves[instance].get([variable])[0])

    def put(name: str) -> None:
        instance, _, variable = name.partition(".")
        slaves[instance].set({variable: values[name]})

    for slave in slaves.values():
        slave.fmu.setupExperiment(startTime=0.0)
        slave.fmu.enterInitializationMode()
    put("motor.w_ref")
    for _ in range(5):  # more sweeps than instances: settled
        for source, target in WIRES:
            get(source)
            values[target] = values[source]
            put(target)
    for slave in slaves.values():
        slave.fmu.exitInitializationMode()
    recorded = []
    for k in range(steps):
        for source, target in WIRES:
            get(source)
            values[target] = values[source]
        for _, target in WIRES:
            put(target)
        for slave in slaves.values():
            slave.step(k * h, h)
        get("load.w")
        recorded.append(values["load.w"])
    for slave in slaves.values():
        slave.close()
    return recorded


def test_jacobi_is_bit_identical_to_a_hand_written_loop(provider) -> None:
    recording = Master(bench(provider), step=1e-3).run(0.2, inputs={"motor.w_ref": 40.0})
    np.testing.assert_array_equal(recording["load.w"][1:], by_hand(200, 1e-3, 40.0))


@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel"])
def test_fmi3_gives_the_same_bits_as_fmi2(provider, algorithm: str) -> None:
    runs = [
        Master(bench(source), algorithm, 1e-3).run(0.1, inputs={"motor.w_ref": 40.0})
        for source in (provider, Built3())
    ]
    np.testing.assert_array_equal(runs[0].values, runs[1].values)
    assert runs[0].bond_energy == runs[1].bond_energy


def test_jacobi_does_not_depend_on_the_order_of_instances(provider) -> None:
    first = bench(provider)
    second = System("bench", provider)
    for name in reversed(first.members):
        second.add(name, first.members[name].reference)
    for source, target in reversed(WIRES):
        second.connect(source, target)
    one, two = (
        Master(s, step=1e-3).run(0.1, inputs={"motor.w_ref": 40.0}) for s in (first, second)
    )
    np.testing.assert_array_equal(one["load.w"], two["load.w"])


def decay(affine: Path, provider, algorithm: str, h: float) -> float:
    """Error at 1 s of J w' = -k w, with the torque -k w computed in another FMU."""
    system = System(provider=provider)
    system.add("load", "inertia/disc", {"J": 1.0, "b": 0.0, "speed": 1.0})
    system.add("brake", str(affine), {"a": -2.0})
    system.connect("load.w", "brake.u")
    system.connect("brake.y", "load.tau")
    recording = Master(system, algorithm, h).run(1.0)
    return abs(recording["load.w"][-1] - math.exp(-2.0))


@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel"])
def test_measured_order_is_one(affine: Path, provider, algorithm: str) -> None:
    steps = np.array([0.05, 0.025, 0.0125, 0.00625])
    errors = [decay(affine, provider, algorithm, h) for h in steps]
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(1.0, abs=0.1)  # the next order still shows at these steps


def test_initial_values_go_through_chains_of_direct_feedthrough(provider) -> None:
    system = System(provider=provider)
    for name in ("c", "b", "a"):
        system.add(name, "gearbox/ratio", {"ratio": 2.0, "eta": 1.0})
    system.connect("a.tau_b", "b.tau_a")
    system.connect("b.tau_b", "c.tau_a")
    recording = Master(system, step=0.1).run(0.1, inputs={"a.tau_a": 1.0})
    assert recording["c.tau_b"][0] == pytest.approx(8.0, rel=1e-15)  # exact products


def test_algebraic_loop_settles_or_is_refused(affine: Path) -> None:
    def ring(gain: float) -> System:
        system = System("ring")
        system.add("a", str(affine), {"a": 0.5, "b": 1.0})
        system.add("b", str(affine), {"a": gain, "b": 1.0})
        system.connect("a.y", "b.u")
        system.connect("b.y", "a.u")
        return system

    recording = Master(ring(-0.8), step=0.1).run(0.1)
    # y = 0.5 u + 1, u = -0.8 y + 1; settled to 1e-12 by definition of the initialization
    assert recording["a.y"][0] == pytest.approx(1.5 / 1.4, rel=1e-11)
    with pytest.raises(AlgebraicLoopError) as caught:
        Master(ring(2.0), step=0.1).run(0.1)
    assert "a.u is direct feedthrough to a.y" in str(caught.value)


def test_integers_and_booleans_of_both_versions(affine: Path, foreign3: Path) -> None:
    system = System()
    system.add("a", str(affine))
    system.add("b", str(foreign3))
    for name in ("y -> u", "next -> n", "off -> on"):
        source, target = name.split(" -> ")
        system.connect(f"a.{source}", f"b.{target}")
    recording = Master(system, step=0.5).run(1.0, inputs={"a.n": 6.0, "a.on": 1.0, "a.u": 3.0})
    assert [recording[f"b.{name}"][-1] for name in ("y", "next", "off")] == [6.0, 8.0, 1.0]


def test_recording_every_nth_point_without_drift(provider) -> None:
    recording = Master(bench(provider), step=1e-3).run(0.1, inputs={"motor.w_ref": 5.0}, every=10)
    np.testing.assert_array_equal(recording.time, 1e-3 * np.arange(0, 101, 10))
    full = Master(bench(provider), step=1e-3).run(0.1, inputs={"motor.w_ref": 5.0})
    np.testing.assert_array_equal(recording.values, full.values[::10])


def test_inputs_can_be_recorded_as_they_are_connected(provider) -> None:
    names = ["load.tau", "gearbox.tau_b", "motor.w_ref", "motor.w", "load.J"]
    recording = Master(bench(provider), step=1e-3).run(
        0.05, inputs={"motor.w_ref": lambda t: 10.0 * t}, record=names
    )
    np.testing.assert_array_equal(recording["load.tau"], recording["gearbox.tau_b"])
    np.testing.assert_allclose(recording["motor.w_ref"], 10.0 * recording.time, rtol=1e-15)
    assert recording.units["motor.w_ref"] == "rad/s"
    assert set(recording["load.J"]) == {0.08}


def test_energy_of_the_coupling_shrinks_with_the_step(provider) -> None:
    def invented(h: float) -> float:
        run = Master(bench(provider), step=h).run(0.5, inputs={"motor.w_ref": 40.0})
        assert set(run.bond_energy) == {
            "motor.shaft -- gearbox.flange_a", "gearbox.flange_b -- load.flange",
        }  # fmt: skip
        return abs(run.energy_residual)

    coarse, fine = invented(1e-3), invented(1e-4)
    assert coarse > 1e-4  # there is something to see
    assert fine == pytest.approx(0.1 * coarse, rel=0.3)  # first order, with higher orders at 1 ms


def test_energy_balance_of_the_whole_system(provider) -> None:
    """What is stored is what came in and was not lost, up to the first-order coupling."""

    def defect(h: float) -> float:
        run = Master(bench(provider), step=h).run(0.5, inputs={"motor.w_ref": 40.0})
        names = ("motor", "gearbox", "load")
        stored = sum(run[f"{n}.E_stored"][-1] - run[f"{n}.E_stored"][0] for n in names)
        net = sum(run[f"{n}.P_in"] - run[f"{n}.P_loss"] for n in names)
        return abs(stored - float(np.sum(0.5 * (net[1:] + net[:-1])) * h)) / stored

    coarse, fine = defect(4e-4), defect(1e-4)
    assert fine < 0.02  # 1 % of the stored energy at 0.1 ms
    assert fine == pytest.approx(0.25 * coarse, rel=0.2)  # first order


# -- failing ---------------------------------------------------------------------------------------


def test_a_failing_fmu_leaves_the_recording_up_to_then(affine: Path, provider) -> None:
    system = System(provider=provider)
    system.add("load", "inertia/disc", {"speed": 1.0})
    system.add("brake", str(affine), {"a": -1.0, "fail_at": 0.55})
    system.connect("load.w", "brake.u")
    system.connect("brake.y", "load.tau")
    with pytest.raises(
        StepError, match=r"run stopped at t = 0.5 s: brake \(affine\).*belt came off"
    ) as e:
        Master(system, step=0.1).run(1.0)
    assert e.value.exit_code == 1 and e.value.time == pytest.approx(0.5)
    recording = e.value.recording
    assert recording is not None and "belt came off" in recording.error
    np.testing.assert_allclose(recording.time, 0.1 * np.arange(6), rtol=1e-15)


@pytest.mark.parametrize(
    ("signal", "error", "message"),
    [
        (Constant(1.0, "N.m"), UnitError, r"input motor.w_ref from 1 N.m: unit 'N.m'"),
        (Function(lambda t: np.where(t > 0.05, np.nan, 1.0)), ValueRangeError,
         r"motor.w_ref from function of time is nan at t = 0.051 s"),
        (Table([0.0, 0.01], [1.0, 2.0], text="log:speed"), ValueRangeError,
         r"log:speed: covers 0 s to 0.01 s, but the run needs 0 s to 0.1 s"),
    ],
)  # fmt: skip
def test_bad_signals(provider, signal, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        Master(bench(provider), step=1e-3).run(0.1, inputs={"motor.w_ref": signal})


def test_bad_tables() -> None:
    with pytest.raises(
        ValueRangeError, match=r"log: 1 of 3 values are not finite, the first \(nan\) at t = 1 s"
    ):
        Table([0.0, 1.0, 2.0], [1.0, math.nan, 2.0], text="log")
    with pytest.raises(ValueRangeError, match=r"times do not increase at 1 s"):
        Table([0.0, 1.0, 1.0], [1.0, 2.0, 3.0])
    with pytest.raises(ValueRangeError, match=r"constant input inf is not finite"):
        Constant(math.inf)


def test_tables_hold_and_interpolate() -> None:
    times = np.array([0.0, 0.5, 1.0, 1.5])
    np.testing.assert_array_equal(
        Table([0.0, 1.0], [2.0, 4.0], extend=True).at(times), [2.0, 2.0, 4.0, 4.0]
    )
    np.testing.assert_array_equal(
        Table([0.0, 1.0], [2.0, 4.0], interpolation="linear", extend=True).at(times),
        [2.0, 3.0, 4.0, 4.0],
    )
    # sample times that were stored in 32 bits belong to the communication points k * h
    clock = (0.001 * np.arange(5000)).astype(np.float32)
    held = Table(clock, np.arange(5000.0)).at(0.001 * np.arange(5000))
    np.testing.assert_array_equal(held, np.arange(5000.0))


def test_a_written_table_does_not_jump_early_however_long_it_holds() -> None:
    times = 1e-4 * np.arange(24_990, 25_010)
    held = Table([0.0, 2.5, 5.0], [1.0, 2.0, 3.0], extend=True).at(times)
    np.testing.assert_array_equal(held, np.where(np.arange(24_990, 25_010) < 25_000, 1.0, 2.0))


@pytest.mark.parametrize(
    ("step", "duration", "message"),
    [
        (
            3e-4,
            1e-3,
            "duration 0.001 s is not a whole number of steps of 0.0003 s; take a duration",
        ),
        (0.0, 1.0, "communication step 0.0 s is not positive"),
        (1e-3, -1.0, "duration -1.0 s is not positive"),
    ],
)
def test_bad_steps(provider, step: float, duration: float, message: str) -> None:
    with pytest.raises(ValueRangeError, match=message):
        Master(bench(provider), step=step).run(duration)


def test_bad_names_of_a_run(provider) -> None:
    master = Master(bench(provider))
    with pytest.raises(UnknownNameError, match=r"motor.tau is not an input but"):
        master.run(0.1, inputs={"motor.tau": 1.0})
    with pytest.raises(GraphError, match=r"input motor.w is already driven by gearbox.w_a"):
        master.run(0.1, inputs={"motor.w": 1.0})
    with pytest.raises(UnknownNameError, match=r"no variable 'speeed'; did you mean 'speed'"):
        master.run(0.1, record=["load.speeed"])
    with pytest.raises(UnknownNameError, match=r"no algorithm 'jacoby'; did you mean 'jacobi'"):
        Master(bench(provider), "jacoby").run(0.1)
    assert issubclass(UnknownNameError, InputError)


@pytest.mark.slow
def test_a_run_may_begin_at_the_time_of_a_stamp(provider) -> None:
    """Seconds since 1970, which doubles hold to 0.24 us: 3e-4 of a step."""
    record = ["load.w", "motor.i"]

    def run(start: float) -> np.ndarray:
        master = Master(bench(provider), "gauss_seidel", 1e-3)
        inputs = {"motor.w_ref": 20.0}
        return master.run(0.1, inputs=inputs, record=record, start=start).values

    at_zero = run(0.0)
    assert run(1.7e9) == pytest.approx(at_zero, abs=3e-3 * float(np.ptp(at_zero)))
