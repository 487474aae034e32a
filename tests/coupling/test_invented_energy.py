"""A coupling that moves the system by itself is told; one that does not is not."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.data.recording import read_recording
from cosim.errors import StepError
from cosim.master.invented import NEGLIGIBLE, TOLERATED, invented
from cosim.master.master import Master
from cosim.system.system import System

FINE, COARSE, RUNAWAY = 1e-4, 2e-3, 5e-3
"""Steps that resolve the spring, let it swing itself up, and beyond all numbers [s]."""
STIFF = {"gearbox.k": 2000.0, "gearbox.d": 0.0, "gearbox.J_a": 1e-4}


def bench(provider, values=STIFF) -> System:
    system = System("bench", provider)
    system.add("motor", "dc_motor.lab_bench/electrical")
    system.add("gearbox", "gearbox.lab_bench/elastic")
    system.add("load", "inertia.lab_bench/disc")
    for wire in (
        "motor.tau gearbox.tau_a", "gearbox.w_a motor.w", "gearbox.tau_b load.tau",
        "load.w gearbox.w_b",
    ):  # fmt: skip
        system.connect(*wire.split())
    for name, value in values.items():
        system.set(name, value)
    return system


def run(system: System, step: float, duration: float = 0.5, **keys):
    return Master(system, keys.pop("algorithm", "jacobi"), step, **keys).run(
        duration, inputs={"motor.w_ref": 20.0}
    )


@pytest.mark.parametrize("executor", ["c", "python"])
def test_a_limit_cycle_of_the_exchange_is_told_with_the_way_out(provider, executor, tmp_path):
    coarse = run(bench(provider), COARSE, executor=executor)
    (note,) = coarse.notes
    for part in ("the coupling invented", "gearbox.flange_b -- load.flange", "take a smaller step"):
        assert part in note
    bond = "gearbox.flange_b -- load.flange"
    assert coarse.bond_energy[bond] > TOLERATED * coarse.bond_turnover[bond]
    again = read_recording(coarse.write_parquet(tmp_path / "run.parquet"))
    assert again.bond_turnover == coarse.bond_turnover and again.notes == coarse.notes


def test_the_same_system_with_a_fine_step_is_not(provider) -> None:
    fine = run(bench(provider), FINE)
    assert fine.notes == () and fine.energy_residual > 0.0


def test_executors_count_alike(provider) -> None:
    compiled, python = (run(bench(provider), FINE, executor=e) for e in ("c", "python"))
    assert compiled.bond_turnover == python.bond_turnover
    adaptive = run(bench(provider), FINE, algorithm="adaptive")
    for name, turned in adaptive.bond_turnover.items():
        assert turned == pytest.approx(compiled.bond_turnover[name], rel=0.1)


def test_isolated_runs_tell_it_too(provider) -> None:
    here, apart = (run(bench(provider), COARSE, isolate=i) for i in (None, 30.0))
    assert apart.notes == here.notes and apart.bond_turnover == here.bond_turnover


def test_a_run_that_it_stops_says_so(provider) -> None:
    with pytest.raises(StepError, match=r"the coupling invented .* take a smaller step") as caught:
        run(bench(provider), RUNAWAY, 20.0)
    assert np.isfinite(caught.value.recording.values).all()


def test_what_moves_nothing_is_left_out() -> None:
    small = 0.5 * NEGLIGIBLE
    assert invented({"a": 0.0, "b": small}, {"a": 1.0, "b": small}) == []
    assert invented({"a": 0.0, "b": -3 * small}, {"a": 1.0, "b": 3 * small}) != []
    assert invented({"a": 0.09}, {"a": 1.0}) == []
    assert len(invented({"a": 0.11}, {"a": 1.0})) == 1
    assert invented({}, {}) == []
