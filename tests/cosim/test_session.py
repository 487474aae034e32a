"""A repeated run is a new run, bit for bit, and leaves no memory behind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.data.signals import Constant, Function
from cosim.errors import FmuCallError, GraphError, StepError, UnknownNameError, ValueRangeError
from cosim.fmu.exchange import Part
from cosim.fmu.instance import Instance
from cosim.installation.builder import default_provider
from cosim.master.master import Master
from cosim.master.session import Session
from cosim.scenario.scenario import find
from cosim.system.system import System

RECORD = ["encoder.w_meas", "motor.i_measured", "load.w"]
DURATION = 0.3


@pytest.fixture(scope="module")
def parts():
    scenario = find("motor_bench")[0].scenario("ST1")
    system = scenario.system.build(default_provider())
    return Master(system, "gauss_seidel", 1e-4), {"motor.w_ref": 20.0}


@pytest.mark.slow
@pytest.mark.parametrize("executor", ["c", "python"])
def test_repetition_is_a_new_run(parts, executor) -> None:
    master, inputs = parts
    master = Master(master.system, master.algorithm, master.step, executor=executor)
    fresh = master.run(DURATION, inputs=inputs, record=RECORD, every=10)
    with Session(master, DURATION, inputs=inputs, record=RECORD, every=10) as session:
        times, rows = session.run()
        _, other = session.run({"load.J": 0.07, "load.speed": 0.5})
        _, again = session.run()
    assert np.array_equal(times, fresh.time)
    assert np.array_equal(rows, fresh.values)
    assert np.array_equal(again, fresh.values)
    assert not np.array_equal(other, fresh.values)


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel"])
@pytest.mark.parametrize("extrapolation", [0, 1, 2])
def test_what_is_only_recorded_is_that_of_its_point(algorithm: str, extrapolation: int) -> None:
    """Outputs that follow inputs at once may be fetched before RECORD, or behind it."""
    system = System("drive", default_provider())
    variants = {
        "motor": "dc_motor/ideal", "gearbox": "gearbox/ratio", "load": "inertia/disc",
        "relay": "adapter/signal", "spare": "gearbox/ratio",
    }  # fmt: skip
    for name, variant in variants.items():
        system.add(name, variant)
    for source, target in (
        ("motor.tau", "gearbox.tau_a"), ("gearbox.w_a", "motor.w"), ("gearbox.tau_b", "load.tau"),
        ("load.w", "gearbox.w_b"), ("gearbox.J_b", "load.J_added"), ("load.w", "relay.u"),
    ):  # fmt: skip
        system.connect(source, target)
    master = Master(system, algorithm, 1e-3, options={"extrapolation": extrapolation})
    inputs = {
        "motor.w_ref": Function(lambda t: 20.0 * np.sin(30.0 * t)),
        "spare.tau_a": Function(lambda t: np.sin(30.0 * t)),
    }
    record = ["relay.y", "spare.tau_b", "load.w", "gearbox.w_a"]
    whole = master.run(0.1, inputs=inputs, record=record)
    with Session(master, 0.1, inputs=inputs, record=record, every=10) as session:
        _, rows = session.run()
        _, again = session.run()
    assert np.array_equal(rows, whole.values[::10])
    assert np.array_equal(again, rows)


def test_values_by_array_and_by_name(parts) -> None:
    master, inputs = parts
    targets = ["load.J", "motor.R_a"]
    with Session(master, DURATION, inputs=inputs, record=RECORD, targets=targets) as session:
        _, named = session.run({"load.J": 0.09, "motor.R_a": 0.36})
        _, listed = session.run(np.array([0.09, 0.36]))
        assert np.array_equal(named, listed)
        with pytest.raises(ValueRangeError):
            session.run(np.array([0.09]))
        with pytest.raises(UnknownNameError):
            session.run({"load.nothing": 1.0})
        with pytest.raises(ValueRangeError):
            session.run({"load.J": -1.0})
        assert np.array_equal(session.run({"load.J": 0.09, "motor.R_a": 0.36})[1], named)


def test_numbers_are_given_in_one_call_and_one_by_one_where_that_is_refused(
    parts, monkeypatch: pytest.MonkeyPatch
) -> None:
    master, inputs = parts
    values = {
        "load.J": 0.09,
        "motor.R_a": 0.36,
        "load.b": 0.02,
        "motor.K_t": 0.09,
        "load.speed": 0.5,
    }
    given: list[tuple[str, int]] = []
    refused: set[str] = set()
    set_part = Instance.set_part

    def watched(self: Instance, part: Part) -> None:
        given.append((self.name, part.references.size))
        if self.name in refused and part.references.size == 3:
            raise FmuCallError("all at once")
        set_part(self, part)

    with Session(master, DURATION, inputs=inputs, record=RECORD) as session:
        session.run()
        monkeypatch.setattr(Instance, "set_part", watched)
        _, together = session.run(values)
        assert given[:2] == [("motor", 2), ("load", 3)]
        refused.add("load")
        _, apart = session.run(values)
        assert np.array_equal(apart, together)
        refused.clear()
        _, mixed = session.run({**values, "load.J": np.float64(0.09), "load.b": 0})
        _, whole = session.run({**values, "load.b": 0.0})
        assert np.array_equal(mixed, whole)
        with pytest.raises(ValueRangeError, match=r"load\.b: b = -1 .*outside its bounds"):
            session.run({**values, "load.b": -1.0})
        with pytest.raises(ValueRangeError, match=r"load\.J: J = nan is not finite"):
            session.run({**values, "load.J": float("nan")})
        with pytest.raises(ValueRangeError, match=r"motor\.R_a: R_a = inf is not finite"):
            session.run({**values, "motor.R_a": float("inf")})


@pytest.mark.parametrize("executor", ["c", "python"])
def test_a_run_that_takes_too_long_is_stopped(parts, executor) -> None:
    master, inputs = parts
    master = Master(master.system, master.algorithm, master.step, executor=executor)
    with Session(master, DURATION, inputs=inputs, record=RECORD) as session:
        free = session.run()
        work = session.work
        with pytest.raises(StepError, match=r"stopped at t = 0\.005 s: it took more than 0 steps"):
            session.run(limit=0.0)
        counted = session.run(limit=work)
        assert session.work == work  # no more and no less than the first time
        with pytest.raises(StepError, match=f"it took more than {work - 1} steps of solvers"):
            session.run(limit=work - 1)
    assert work > session.count * 2  # solvers of the two parts make steps of their own
    assert np.array_equal(free[1], counted[1])  # counting changes nothing


@pytest.mark.parametrize("executor", ["c", "python"])
def test_a_limited_run_that_runs_away_is_stopped(parts, executor, monkeypatch) -> None:
    master, inputs = parts
    master = Master(master.system, master.algorithm, master.step, executor=executor)
    with Session(master, DURATION, inputs=inputs, record=RECORD) as session:
        free = session.run(limit=1e9)
        monkeypatch.setattr("cosim.master.session.RUNAWAY", 0.5 * np.abs(free[1]).max())
        with pytest.raises(StepError, match=r"\.[\w]+ passed .*: .* the system is unstable"):
            session.run(limit=1e9)
        assert np.array_equal(free[1], session.run()[1])  # a run without a limit is not watched


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads Linux's statm")
def test_thousand_runs_leave_no_memory(parts) -> None:
    master, inputs = parts

    def pages() -> int:
        return int(Path("/proc/self/statm").read_text().split()[1])

    with Session(master, 0.02, inputs=inputs, record=RECORD) as session:
        for _ in range(50):
            session.run({"load.J": 0.08})
        before = pages()
        for _ in range(1000):
            session.run({"load.J": 0.08})
        # one page per ten runs would be 100; the interpreter's own pools may move by a few
        assert pages() - before < 50


def test_sessions_of_one_run_share_their_inputs(parts) -> None:
    """Bit for bit the same results; one that is driven otherwise, or begins later, has its own."""
    master, inputs = parts
    given = {name: Constant(value) for name, value in inputs.items()}

    def session(**changed) -> Session:
        return Session(master, DURATION, **{"inputs": given, "record": RECORD, **changed})

    with session() as first:
        expected = first.run()
        with session(like=first.outline) as second:
            assert second.outline.external is first.outline.external
            assert second.outline.times is first.outline.times
            for found, wanted in zip(second.run(), expected, strict=True):
                assert np.array_equal(found, wanted)
            with pytest.raises(GraphError, match="shares its inputs with others"):
                second.drive(given)
        others = {name: Constant(2.0 * value) for name, value in inputs.items()}
        for changed in ({"inputs": others}, {"start": 0.1}):
            with session(like=first.outline, **changed) as third:
                assert third.outline.external is not first.outline.external
                third.drive(others)
