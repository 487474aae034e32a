"""Our SSP archives run unchanged in other tools and give what our Jacobi gives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim import Master, read_system, ssp
from tests.cosim.test_ssp_write import Versioned, bench
from tests.fmus import Slave
from tests.outside import require
from tests.ssp_clients import PACKAGES, run

SYSTEMS = Path(__file__).parents[2] / "scenarios" / "systems"
STEP, COUNT = 1e-4, 1000
# Ecos reports outputs after it has set the next inputs, so that outputs with direct feedthrough
# are those of the next step; states and what follows from them alone can be compared
STATES = ["load.w", "load.phi", "motor.i"]
FEEDTHROUGH = ["motor.tau", "motor.u", "gearbox.w_a", "gearbox.tau_b", "gearbox.J_b", "load.P_in"]


def difference(path: Path, client: str, names: list[str], count: int = COUNT) -> float:
    """Largest difference to our Jacobi, relative to the largest value of each signal."""
    recording = Master(ssp.read(path), "jacobi", STEP).run(STEP * count, record=names)
    theirs = run(client, path, STEP, count, names)
    ours = recording.values[1:]
    moving = [not name.endswith("J_b") for name in names]  # all but the one constant
    assert theirs.shape == ours.shape and np.all(np.ptp(ours[:, moving], axis=0) > 0.0)
    return float(np.max(np.abs(theirs - ours) / np.max(np.abs(ours), axis=0)))


@pytest.mark.parametrize(
    ("client", "fmi", "names"),
    [
        ("libcosim", 2, STATES + FEEDTHROUGH), ("ecos", 2, STATES), ("ecos", 3, STATES),
    ],
)  # fmt: skip
def test_motor_bench(tmp_path: Path, client: str, fmi: int, names: list[str]) -> None:
    require(PACKAGES[client])
    system = bench(fmi)
    if client == "ecos":  # it exchanges nothing before the first step
        for connection in system.connections:
            system.set(connection.target, 0.0)
    path = ssp.write(system, tmp_path / "bench.ssp", experiment=ssp.Experiment(0.0, 1.0, STEP))
    # libcosim adds up whole nanoseconds and divides, so its times differ in the last bits;
    # nothing else is different, and the system is stable
    assert difference(path, client, names) < 1e-9


def passed_on(fmi: int, count: int) -> np.ndarray:
    """States of the bench where outputs with direct feedthrough are fetched again after inputs."""
    system = bench(fmi)
    slaves = {m.name: Slave(m.fmu.path, m.parameters) for m in system.members.values()}
    rows = []

    def exchange() -> None:
        for _ in slaves:  # a value passes one instance at a time
            for wire in system.connections:
                (source, output), (target, variable) = (
                    name.split(".", 1) for name in (wire.source, wire.target)
                )
                value = float(slaves[source].get([output])[0])
                slaves[target].set({variable: wire.gain * value + wire.offset})

    exchange()
    for k in range(count):
        for slave in slaves.values():
            slave.step(k * STEP, STEP)
        rows.append([float(slaves[n.split(".")[0]].get([n.split(".")[1]])[0]) for n in STATES])
        exchange()
    for slave in slaves.values():
        slave.close()
    return np.array(rows)


@pytest.mark.slow
@pytest.mark.parametrize("fmi", [2, 3])
def test_motor_bench_in_omsimulator(tmp_path: Path, fmi: int) -> None:
    """It passes values on through direct feedthrough at once, our Jacobi does a step later."""
    require(PACKAGES["omsimulator"])
    path = ssp.write(bench(fmi), tmp_path / "bench.ssp", experiment=ssp.Experiment(0.0, 1.0, STEP))
    theirs, ours = run("omsimulator", path, STEP, COUNT, STATES), passed_on(fmi, COUNT)
    assert np.max(np.abs(theirs - ours) / np.max(np.abs(ours), axis=0)) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("client", "fmi"),
    [("libcosim", 2), ("ecos", 2), ("ecos", 3)],
)
def test_mobile_manipulator(tmp_path: Path, client: str, fmi: int) -> None:
    """Sixteen FMUs: base and arm that feel each other, drives, sensors."""
    require(PACKAGES[client])
    system = read_system(SYSTEMS / "mobile_manipulator.toml").build(Versioned(fmi))
    path = ssp.write(
        system, tmp_path / "mobile.ssp", experiment=ssp.Experiment(0.0, 1.0, STEP),
        inputs={"path.v_set": 0.4, "path.w_set": 0.3},
    )  # fmt: skip
    names = [
        "base.x", "base.y", "base.phi", "base.z", "base.v", "base.w_z", "base.w_l", "base.w_r",
        "motor_left.i", "motor_right.i", "arm.q[1]", "arm.q[4]", "arm.qd[2]", "arm.qd[6]",
        "drive.i[3]",
    ]  # fmt: skip
    assert difference(path, client, names, 400) < 1e-9  # as above


def test_a_missing_parameter_set_would_be_seen(tmp_path: Path) -> None:
    pytest.importorskip("libcosimpy")
    other = bench()
    other.set("load.J", 0.31)
    path = ssp.write(bench(), tmp_path / "bench.ssp")
    theirs = run("libcosim", path, STEP, COUNT, STATES)
    ours = Master(other, "jacobi", STEP).run(STEP * COUNT, record=STATES).values[1:]
    assert np.max(np.abs(theirs - ours)) > 1e-3


def test_libcosim_sets_no_local_variables(tmp_path: Path) -> None:
    """Docs say so, and what is exported names them."""
    pytest.importorskip("libcosimpy")
    other = bench()
    other.set("load.speed", 2.0)
    other.set("load.angle", 0.0)  # as the FMU says
    assert ssp.local_starts(bench()) == [] and ssp.local_starts(other) == ["load.speed"]
    ends = [run("libcosim", ssp.write(system, tmp_path / f"{k}.ssp"), STEP, 10, STATES)
            for k, system in enumerate((bench(), other))]  # fmt: skip
    assert np.array_equal(*ends)


def test_fmi_3_variant_is_the_same_system() -> None:
    runs = [
        Master(bench(fmi), "jacobi", STEP).run(STEP * COUNT, record=STATES).values for fmi in (2, 3)
    ]
    assert np.array_equal(*runs)
