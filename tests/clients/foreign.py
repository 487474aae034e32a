"""Runs a chain of FMUs under a foreign master; a process of its own, since that may crash.

Reads JSON from standard input, `{"paths", "connections", "values", "outputs", "step", "count"}`,
and writes `{output: [value after each step]}`. Uses nothing but the client named as argument.
"""

from __future__ import annotations

import json
import os
import sys
from typing import Any


def libcosimpy(task: dict[str, Any]) -> dict[str, list[float]]:
    from fmpy import read_model_description
    from libcosimpy.CosimEnums import CosimExecutionState
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.WARNING)
    nanoseconds = round(task["step"] * 1e9)
    execution = CosimExecution.from_step_size(nanoseconds)
    index, references, slaves = {}, {}, []
    for name, path in task["paths"].items():
        slave = CosimLocalSlave(path, name)
        if not slave.ptr():  # the next call would crash
            raise RuntimeError(f"libcosim cannot load {path}")
        slaves.append(slave)
        index[name] = execution.add_local_slave(slave)
        description = read_model_description(path)
        references[name] = {v.name: v.valueReference for v in description.modelVariables}

    def locate(full: str) -> tuple[int, int]:
        name, _, variable = full.partition(".")
        return index[name], references[name][variable]

    for full, value in task["values"].items():
        assert execution.real_initial_value(*locate(full), value), full
    for source, target in task["connections"]:
        # returns 0 for success
        assert not execution.connect_real_variables(*locate(source), *locate(target)), source
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    result: dict[str, list[float]] = {full: [] for full in task["outputs"]}
    for _ in range(task["count"]):
        if not execution.step():
            raise RuntimeError("libcosim: a step failed")
        for full in result:
            instance, reference = locate(full)
            result[full] += observer.last_real_values(instance, [reference])
    assert execution.status().state != CosimExecutionState.ERROR.value
    return result


def ecospy(task: dict[str, Any]) -> dict[str, list[float]]:
    from ecospy import EcosSimulation, EcosSimulationStructure
    from ecospy.lib import EcosLib

    EcosLib.set_log_level("warn")

    def spelled(full: str) -> str:
        return full.replace(".", "::", 1)

    result: dict[str, list[float]] = {full: [] for full in task["outputs"]}
    with EcosSimulationStructure() as structure:
        for name, path in task["paths"].items():
            structure.add_model(name, path)
        for source, target in task["connections"]:
            structure.make_real_connection(spelled(source), spelled(target))
        values = {spelled(full): float(value) for full, value in task["values"].items()}
        structure.add_parameter_set("start", values)
        with EcosSimulation(structure=structure, step_size=task["step"]) as simulation:
            if not simulation.init(parameter_set="start"):
                raise RuntimeError(EcosLib.get_last_error())
            for _ in range(task["count"]):
                simulation.step()
                for full in result:
                    result[full].append(simulation.get_real(spelled(full)))
            simulation.terminate()
    return result


if __name__ == "__main__":
    client = {"libcosimpy": libcosimpy, "ecospy": ecospy}[sys.argv[1]]
    answer = client(json.load(sys.stdin))
    sys.stdout.write("\n@" + json.dumps(answer) + "\n")  # behind what the client prints
    sys.stdout.flush()
    # A pythonfmu slave that libcosim's threads have called can crash the interpreter's own end.
    os._exit(0)
