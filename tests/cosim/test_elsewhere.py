"""Sessions in other processes: the same bits, errors that come back, processes that end."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from cosim.errors import FmuCallError, ValueRangeError
from cosim.master.elsewhere import Elsewhere, Workers, locked
from cosim.master.master import Master
from cosim.master.session import Session
from cosim.system.system import System
from tests.cosim_fmus import slave
from tests.tiny_fmus import V, tiny

GROWING = """
import os
from pythonfmu import Fmi2Causality as C, Fmi2Slave, Real


class {name}(Fmi2Slave):
    def __init__(self, **arguments):
        super().__init__(**arguments)
        self.a, self.y, self.fail_at, self.exit_at = 0.5, 1.0, 1e9, 1e9
        for item in ("a", "fail_at", "exit_at"):
            self.register_variable(Real(item, causality=C.parameter, variability="tunable"))
        self.register_variable(Real("y", causality=C.output))

    def do_step(self, time, size):
        if time + size > self.fail_at:
            raise ValueError("belt came off")
        if time + size > self.exit_at:
            print("and now it leaves")
            os._exit(7)
        self.y += size * self.a * self.y
        return True
"""


@pytest.fixture(scope="module")
def master(tmp_path_factory: pytest.TempPathFactory) -> Master:
    system = System("growth")
    path = slave(tmp_path_factory.mktemp("growing"), "Growing", GROWING, "pythonfmu")
    system.add("plant", str(path))
    return Master(system, "jacobi", 0.01)


@pytest.fixture(scope="module")
def workers() -> Iterator[Workers]:
    found = Workers(1)
    yield found
    found.close()


def test_other_processes_give_the_same_bits(master: Master, workers: Workers) -> None:
    here = Session(master, 1.0, record=["plant.y"])
    there = Elsewhere(master.outline(1.0, record=["plant.y"]), workers)
    for a in (0.5, -2.0, 0.5):
        times, rows = here.run({"plant.a": a})
        other_times, other_rows = there.run({"plant.a": a})
        np.testing.assert_array_equal(rows, other_rows)
        np.testing.assert_array_equal(times, other_times)
        assert there.work == here.work > 0 and there.names == here.names
    assert rows[-1, 0] == pytest.approx(1.005**100)  # explicit Euler, rounding of 100 steps
    here.close()


def test_errors_come_back_and_the_next_run_is_right(master: Master, workers: Workers) -> None:
    there = Elsewhere(master.outline(1.0, record=["plant.y"]), workers)
    right = there.run({})[1]
    with pytest.raises(FmuCallError, match=r"run stopped at t = 0.29 s: plant .*belt came off"):
        there.run({"plant.fail_at": 0.295})
    with pytest.raises(ValueRangeError, match=r"plant\.a"):
        there.run({"plant.a": float("nan")})
    with pytest.raises(FmuCallError, match="it took more than 10 steps"):
        there.run({}, limit=10)
    np.testing.assert_array_equal(there.run({})[1], right)


def test_a_process_that_an_fmu_ends_is_named_and_replaced(master: Master, workers: Workers) -> None:
    there = Elsewhere(master.outline(1.0, record=["plant.y"]), workers)
    right = there.run({})[1]
    with pytest.raises(FmuCallError, match="an FMU ended the process with exit code 7"):
        there.run({"plant.exit_at": 0.5})
    np.testing.assert_array_equal(there.run({})[1], right)


def test_only_fmus_in_python_are_run_elsewhere(master: Master, tmp_path: Path) -> None:
    assert locked(master.system)
    system = System("plain")
    system.add("m", str(tiny(tmp_path, [V("y", "Float64", "output")])))
    assert not locked(system)
