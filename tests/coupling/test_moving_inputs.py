"""Extrapolation through inputs that move within a step, the start of a run, ringing couplings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.coupling import of_scenario
from cosim.errors import StepError
from cosim.master.extrapolation import bend
from cosim.master.master import Master
from cosim.master.plan import Op
from cosim.master.session import Session
from cosim.system.system import System
from tests.coupling.faulty import build_faulty
from tests.coupling.test_coupling_orders import INPUTS, SIGNALS, drive
from tests.fmus import fmu

ALGORITHMS = [("jacobi", 1), ("jacobi", 2), ("gauss_seidel", 1), ("gauss_seidel", 2)]


def filtered(provider) -> System:
    """A speed that rises like t, through a first-order sensor of 2 kHz."""
    system = System("filtered", provider)
    system.add("disc", "inertia/disc", {"J": 1.0, "b": 0.0})
    system.add("sensor", "current_sensor/first_order")
    system.connect("disc.w", "sensor.i", convert=False)
    return system


@pytest.mark.parametrize(("algorithm", "order"), ALGORITHMS)
def test_a_ramp_is_passed_on_as_a_ramp(provider, algorithm: str, order: int) -> None:
    """i' = (t - i)/T at steps of 12 T: held inputs miss it by half a step."""
    system, lag = filtered(provider), 1.0 / (2.0 * np.pi * 2000.0)
    errors = {}
    for extrapolation in (0, order):
        master = Master(system, algorithm, 1e-3, options={"extrapolation": extrapolation})
        found = master.run(0.02, inputs={"disc.tau": 1.0}, record=["sensor.i_meas"])
        exact = found.time - lag * (1.0 - np.exp(-found.time / lag))
        errors[extrapolation] = np.max(np.abs(found["sensor.i_meas"] - exact)[3:])
    # what is left is the solver's own error over the first steps, where e^(-12) counts
    assert errors[order] < 1e-3 * 1e-3
    if algorithm == "jacobi":
        assert errors[0] > 0.5e-3


@pytest.mark.parametrize(("algorithm", "order"), ALGORITHMS)
def test_executors_agree_where_only_some_inputs_can_move(
    provider, algorithm: str, order: int
) -> None:
    """FMI 2 moves, FMI 3 and interpreted FMUs take means: one plan with all three."""
    system = drive(provider, "electrical")
    third = System("third", provider)
    for name, member in system.members.items():
        path = {
            "motor": fmu("dc_motor.lab_bench/electrical", "native", 3),
            "gearbox": fmu("gearbox.lab_bench/ratio", "python"),
        }.get(name, Path(member.fmu.path))
        third.add(name, str(path))
    for wire in system.connections:
        third.connect(wire.source, wire.target)
    runs = [
        Master(third, algorithm, 1e-3, options={"extrapolation": order}, executor=executor).run(
            0.02, inputs=INPUTS, record=SIGNALS
        )
        for executor in ("python", "c")
    ]
    assert runs[0].values.tobytes() == runs[1].values.tobytes()
    assert runs[0].bond_energy == runs[1].bond_energy
    plan = Master(third, algorithm, 1e-3, options={"extrapolation": order}).compile([], SIGNALS)
    movers = {plan.means[a].instance for op, a, _ in plan.step.tolist() if op == Op.SET_DERIVATIVES}
    assert {plan.layout.instances[index] for index in movers} == {"load"}


def test_trial_steps_make_the_first_step_as_good_as_the_others(provider, monkeypatch) -> None:
    fine = Master(drive(provider), "iterated", 5e-5).run(0.01, inputs=INPUTS, record=SIGNALS)
    errors = []
    for _ in range(2):
        master = Master(drive(provider), "gauss_seidel", 5e-4, options={"extrapolation": 2})
        found = master.run(0.01, inputs=INPUTS, record=SIGNALS)
        errors.append(np.max(np.abs(found.values - fine.values[::10]), axis=0))
        monkeypatch.setattr("cosim.master.execution.find_past", lambda run: None)
    # the first step is one of twenty, and the only one with held inputs
    assert errors[0][0] < 0.5 * errors[1][0] and errors[0][1] < errors[1][1]


def test_repeated_runs_begin_alike(provider) -> None:
    master = Master(drive(provider), "gauss_seidel", 1e-3, options={"extrapolation": 2})
    fresh = master.run(0.02, inputs=INPUTS, record=SIGNALS).values
    with Session(master, 0.02, inputs=INPUTS, record=SIGNALS) as session:
        for _ in range(2):
            np.testing.assert_array_equal(session.run()[1], fresh)


def test_fmus_without_states_start_with_held_inputs(affine: Path, provider) -> None:
    system = System("mixed", provider)
    system.add("a", str(affine), {"a": 1.0})
    system.add("load", "inertia/disc")
    system.connect("a.y", "load.tau", convert=False)
    master = Master(system, "gauss_seidel", 1e-3, options={"extrapolation": 1})
    assert np.isfinite(master.run(0.01, record=["load.w"]).values).all()


def test_claimed_states_that_fail_are_told(tmp_path: Path, provider) -> None:
    system = System("pair", provider)
    path = build_faulty(tmp_path)
    system.add("first", str(path))
    system.add("second", str(path))
    system.connect("first.y", "second.u")
    master = Master(system, "jacobi", 0.1, options={"extrapolation": 1})
    with pytest.raises(StepError, match=r"first \(faulty\): saving the state .* failed"):
        master.run(1.0)


@pytest.mark.parametrize("executor", ["python", "c"])
@pytest.mark.parametrize(
    ("algorithm", "options"),
    [("jacobi", {"extrapolation": 1}), ("iterated", {"interpolation": 1})],
)
def test_refused_derivatives_are_told(
    tmp_path: Path, provider, executor: str, algorithm: str, options: dict[str, int]
) -> None:
    path = build_faulty(tmp_path, keeps=True, canInterpolateInputs="true")
    system = System("pair", provider)
    system.add("first", str(path))
    system.add("second", str(path))
    system.connect("first.y", "second.u")
    master = Master(system, algorithm, 0.1, options=options, executor=executor)
    text = r"second \(faulty\): setting derivatives of u .*failed with status 'error'"
    with pytest.raises(StepError, match=text):
        master.run(1.0)


def test_parabolas_give_way_to_lines_where_values_ring() -> None:
    assert bend(9.0, 4.0, 1.0, 0.0) == 2.0  # t^2
    assert bend(1.0, -1.0, 1.0, -1.0) == 0.0  # rings
    assert bend(5.0, 2.0, 1.0, 0.0) == 0.0  # straight before
    assert bend(-8.0, -3.0, 0.0, 1.0) == -2.0  # the one nearer to zero
    assert bend(7.0, 3.0, 1.0, 0.5) == pytest.approx(1.5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "duration"), [("mir250/CN1", 3.0), ("mobile_manipulator/IY", 2.5)]
)
def test_papers_runs_are_as_exact_as_their_sensors_ask_for(name: str, duration: float) -> None:
    """At its own algorithm and step each run is within one tenth of the sensors' noise."""
    case = of_scenario(name)
    assert case.usual is not None
    algorithm, options, step = case.usual
    signals = [signal for column in case.columns for signal in column.signals]

    def found(h: float) -> np.ndarray:
        master = Master(case.system, algorithm, h, options=options)
        run = master.run(duration, inputs=case.inputs, record=signals, every=round(1e-3 / h))
        return run.values

    apart = np.max(np.abs(found(step) - found(1e-4)), axis=0)
    for column in case.columns:
        error = column.scale * max(apart[signals.index(signal)] for signal in column.signals)
        assert error < column.allowed, f"{column.title}: {error:.2e}"
