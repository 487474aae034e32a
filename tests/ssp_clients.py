"""Other tools as clients of our SSP archives, each in a process of its own.

`run(client, path, step, count, names)` returns the values of outputs after each step. Run as a
script, this file is that process: `clients.py libcosim FILE STEP COUNT NAME...` prints JSON.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

PARAMETER_SET = "parameters"


def environment() -> dict[str, str]:
    """Of the process."""
    from tests.outside import environment  # not found where this file is the process

    return environment()


def run(client: str, path: Path, step: float, count: int, names: list[str]) -> np.ndarray:
    """One row per step, one column per name."""
    # ecos leaves there what it unpacks, and OMSimulator writes results to where it runs
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [
                sys.executable, str(Path(__file__).resolve()), client, str(path.resolve()),
                repr(step), str(count), *names,
            ],
            capture_output=True, text=True, timeout=120, cwd=folder,
            env={**environment(), "TMPDIR": folder},
        )  # fmt: skip
    if done.returncode:
        raise RuntimeError(f"{client}: exit code {done.returncode}\n{done.stdout}\n{done.stderr}")
    return np.array(json.loads(done.stdout.splitlines()[-1]))


def libcosim(path: str, step: float, count: int, names: list[str]) -> list[list[float]]:
    from libcosimpy.CosimEnums import CosimExecutionState
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.WARNING)
    # steps are whole nanoseconds
    execution = CosimExecution.from_ssp_file(path, step_size=round(step * 1e9))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    places = []
    for name in names:
        instance, _, variable = name.partition(".")
        slave = execution.slave_index_from_instance_name(instance)
        found = [v.reference for v in execution.slave_variables(slave)
                 if v.name.decode() == variable]  # fmt: skip
        places.append((slave, found))
    rows = []
    for _ in range(count):
        if not execution.step():
            raise RuntimeError("a step failed")
        rows.append([observer.last_real_values(slave, found)[0] for slave, found in places])
    assert execution.status().state != CosimExecutionState.ERROR.value
    return rows


def ecos(path: str, step: float, count: int, names: list[str]) -> list[list[float]]:
    from ecospy import EcosLib, EcosSimulation

    EcosLib.set_log_level("warn")
    rows = []
    with EcosSimulation(step, ssp_path=path) as simulation:
        simulation.init(parameter_set=PARAMETER_SET)
        for _ in range(count):
            simulation.step()
            rows.append([simulation.get_real(name.replace(".", "::")) for name in names])
        simulation.terminate()
    return rows


def omsimulator(path: str, step: float, count: int, names: list[str]) -> list[list[float]]:
    """The archive says the step; one that is not `step` would be seen in the values."""
    from OMSimulator import SSP, CRef, Settings

    Settings.suppressPath = True
    package = SSP(path)
    model = package.instantiate()
    model.setResultFile("")
    model.initialize()
    system = package.activeVariant.system.name
    places = [CRef(system, *name.split(".", 1)) for name in names]
    rows = []
    for k in range(1, count + 1):
        model.stepUntil((k - 0.5) * step)  # to the end of the step within which it lies
        rows.append([model.getValue(place) for place in places])
    model.terminate()
    return rows


CLIENTS = {"libcosim": libcosim, "ecos": ecos, "omsimulator": omsimulator}
PACKAGES = {"libcosim": "libcosimpy", "ecos": "ecospy", "omsimulator": "OMSimulator"}

if __name__ == "__main__":
    client, path, step, count, *names = sys.argv[1:]
    rows = CLIENTS[client](path, float(step), int(count), names)
    print("\n" + json.dumps(rows), flush=True)
    # all is done and said: the exit handlers of TBB, which ecos uses, race with its worker
    # threads (they unload libraries that the main thread is leaving), 1 run of 250 crashes there
    os._exit(0)
