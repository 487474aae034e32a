"""Logs of real machines: the error of a model before and after each effect is added.

    python -m benchmarks.real_logs scenarios/emps FOLDER
    python -m benchmarks.real_logs scenarios/emps FOLDER --models open_loop.models.toml

The first argument is the folder of a mapping, the second that of the logs, which are not part of
the project. `models.toml` beside the mapping lists the models, each with the variants that it
changes; their parameters are fitted to the identification runs alone, or set (`fit = false`).
Printed per run and channel: root mean square, mean absolute and relative error (norm of the error
over norm of the channel), and what was fitted, with 95 % intervals. The errors are those of the
whole simulated run.

With `[end]` only the error at the last measured sample of each run counts: the dead reckoning of a
vehicle over windows that begin at its measured pose. Printed per log and purpose: root mean square
and median of the distance, root mean square of the yaw. `[[part]]` lists choices of runs (`only`,
as in the mapping) that are modelled one after the other; a model with `parts` is for these only,
and what it lists in `keep` stays as it was found before, in another part or model.

With `[inverse]` the model is turned round, too: the force that it needs for the measured motion
against the force that was commanded, both behind the same low-pass filter without phase. The
command is held between samples, so it acts half a sample later than it was logged on average;
`held` takes that into account, `as logged` does not.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, filtfilt

from cosim.calibrate.estimate import Estimate
from cosim.calibrate.fit import Effort, fit
from cosim.calibrate.mapping import read_problem
from cosim.calibrate.parts import MeasuredRun
from cosim.calibrate.problem import Problem
from cosim.calibrate.simulator import Simulator
from cosim.files import flatten, read_toml
from sources.function import Oracle
from sources.variant import build_model

Vector = NDArray[np.float64]


def model_of(problem: Problem, entry: Mapping[str, Any], known: Mapping[str, float]) -> Problem:
    """The problem with a model's variants; what is not free is held at its start value."""
    given = flatten(entry.get("start", {}))
    start = {**known, **given}
    for instance, effects in entry.get("add", {}).items():
        for effect in [effects] if isinstance(effects, str) else effects:
            problem = problem.with_effects({instance: f"+{effect}"})
    fixed = {name: value for name, value in given.items() if name not in problem.names}
    problem = problem.changed(constants={**problem.constants, **fixed})
    free = set(entry.get("free", ()))
    held = {
        p.name: start.get(p.name, p.nominal)
        for p in problem.parameters
        if p.role == "effect" and not p.strength and p.name not in free
    }
    kept = {name: known[name] for name in entry.get("keep", ())}
    problem = problem.hold({**held, **kept, **entry.get("hold", {})})
    changed = []
    for p in problem.parameters:
        value = min(max(start.get(p.name, p.nominal), p.minimum), p.maximum)
        span = abs(value) or p.span if p.role == "effect" else p.span
        changed.append(replace(p, nominal=value, span=span))
    return problem.with_parameters(changed)


def errors(simulator: Simulator, theta: Vector, skip: float) -> list[tuple[str, str, list[float]]]:
    """(run, channel, [RMS, mean absolute, relative in %]) over all runs."""
    table, problem = [], simulator.problem
    for name, residual in simulator.residuals(theta, None):
        run = problem.run(name)
        late = run.times - run.times[0] >= skip
        for column, channel in enumerate(problem.channels):
            error = residual[late, column] * channel.sigma
            values = run.data[late, column]
            good = np.isfinite(error)
            error, values = error[good], values[good]
            table.append((name, channel.name, [
                float(np.sqrt(np.mean(error**2))), float(np.mean(np.abs(error))),
                100.0 * float(np.linalg.norm(error) / np.linalg.norm(values)),
            ]))  # fmt: skip
    return table


def ends(simulator: Simulator, theta: Vector, entry: Mapping[str, Any]) -> dict[str, Vector]:
    """Error of the position [m] and of the yaw at the end of each run, by log and purpose.

    Each row is one run: what the model lacks along x and y, and its yaw error.
    """
    problem = simulator.problem
    names = [c.name for c in problem.channels]
    place = [names.index(name) for name in (*entry["position"], entry["yaw"])]
    rows: dict[str, list[Vector]] = {}
    for name, residual in simulator.residuals(theta, None):
        run = problem.run(name)
        error = residual[:, place] * problem.sigma[place]
        last = error[np.flatnonzero(np.isfinite(error).all(axis=1))[-1]]
        log = str(run.values.get("name", name))
        for key in (f"{log} ({run.purpose})", f"all ({run.purpose})"):
            rows.setdefault(key, []).append(last)
    return {key: np.array(found) for key, found in rows.items()}


def print_ends(simulator: Simulator, theta: Vector, entry: Mapping[str, Any]) -> None:
    """Table of the errors at the ends of the runs."""
    found = ends(simulator, theta, entry)
    for key in sorted(found, key=lambda k: (k.startswith("all"), k)):
        distance = np.hypot(found[key][:, 0], found[key][:, 1])
        yaw = found[key][:, 2]
        print(f"  {key:40} {distance.size:4} runs  {np.sqrt(np.mean(distance**2)):.4f} m (median "
              f"{np.median(distance):.4f}), {np.sqrt(np.mean(yaw**2)):.4f} rad")  # fmt: skip


def smooth(values: Vector, interval: float, frequency: float) -> Vector:
    """Butterworth low-pass of fourth order, forward and back."""
    b, a = butter(4, frequency * 2.0 * interval)
    return np.asarray(filtfilt(b, a, values), dtype=np.float64)


def inverse(
    problem: Problem, theta: Vector, run: MeasuredRun, entry: Mapping[str, Any]
) -> list[float] | None:
    """Relative error [%] of the force that the model needs for the motion: as logged, held.

    None where the model has states that nobody measures.
    """
    instance, interval = str(entry["instance"]), float(np.median(np.diff(run.times)))
    oracle = Oracle(build_model(problem.instances[instance]))
    if set(oracle.state_names) != {entry["angle"], entry["speed"]}:
        return None
    values = {**problem.constants, **problem.values(theta, run)}
    prefix = f"{instance}."
    own = {n.removeprefix(prefix): v for n, v in values.items() if n.startswith(prefix)}
    known = {v.name for role in ("parameter", "state") for v in oracle.model.of_role(role)}
    point = oracle.arguments({n: v for n, v in own.items() if n in known})
    columns = [c.name for c in problem.channels]
    place = run.data[:, columns.index(str(entry["position"]))] * float(entry["per_position"])
    place = smooth(place, interval, float(entry["cutoff"]))
    speed = np.gradient(place, interval)
    states = np.tile(point[1], (place.size, 1)).T
    states[oracle.state_names.index(str(entry["angle"]))] = place
    states[oracle.state_names.index(str(entry["speed"]))] = speed
    row = oracle.state_names.index(str(entry["speed"]))
    inputs = [v.name for v in oracle.model.of_role("input")]
    accelerations = []
    for force in (0.0, 1.0):
        held = np.zeros((len(inputs), place.size))
        held[inputs.index(str(entry["input"]))] = force
        # one column per sample: casadi evaluates the function for each of them
        args = [np.zeros((1, place.size)), states,
                np.tile(point[2].reshape(-1, 1), place.size), held,
                np.tile(point[4].reshape(-1, 1), place.size)]  # fmt: skip
        accelerations.append(np.asarray(oracle.functions.derivatives(*args))[row])
    needed = (np.gradient(speed, interval) - accelerations[0]) / np.diff(accelerations, axis=0)[0]
    command = run.data[:, columns.index(str(entry["command"]))] * float(entry["per_command"])
    found = []
    edge = slice(200, -200)  # the filter's start and end
    for late in (0.0, 0.5):
        index = np.arange(place.size)
        force = smooth(np.interp(index - late, index, command), interval, float(entry["cutoff"]))
        error = force - smooth(needed, interval, float(entry["cutoff"]))
        found.append(100.0 * float(np.linalg.norm(error[edge]) / np.linalg.norm(force[edge])))
    return found


def shown(estimate: Estimate) -> str:
    """Parameters with intervals."""
    return ", ".join(
        f"{p.name} {value:.4g} [{low:.4g}, {high:.4g}] {p.unit}"
        for p, value, low, high in zip(
            estimate.problem.parameters, estimate.theta, estimate.low, estimate.high, strict=True
        )
        if p.role != "nuisance"
    )


def print_errors(simulator: Simulator, theta: Vector, skip: float) -> None:
    """Table of the errors over whole runs."""
    problem = simulator.problem
    rows = errors(simulator, theta, skip)
    for run, channel, (rms, mean, relative) in rows:
        purpose = problem.run(run).purpose
        print(
            f"  {run:22} {purpose:14} {channel:6} rms {rms:.4g}  mean {mean:.4g}  {relative:.4g} %"
        )
    for channel in dict.fromkeys(row[1] for row in rows):
        mine = [row for row in rows if row[1] == channel]
        for purpose in dict.fromkeys(problem.run(row[0]).purpose for row in mine):
            part = [r[2][1] for r in mine if problem.run(r[0]).purpose == purpose]
            print(f"  mean over runs         {purpose:14} {channel:6} {np.mean(part):.4g}")
        print(f"  mean over runs         all            {channel:6} "
              f"{np.mean([r[2][1] for r in mine]):.4g}")  # fmt: skip


def compared(mapping: Path, folder: Path, models: Path) -> None:
    """Print the tables of all models, for each part of the runs."""
    table = read_toml(models)
    path = mapping / str(table.get("mapping", "dataset.toml"))
    known: Mapping[str, float] = {}
    for part in table.get("part", [{}]):
        if "name" in part:
            print(f"\n=== {part['name']}")
        base = read_problem(folder, mapping=path, only=part.get("only"))
        here = [m for m in table["model"] if part.get("name") in m.get("parts", [part.get("name")])]
        known = compared_part(base, {**table, "model": here}, known)


def compared_part(
    base: Problem, table: Mapping[str, Any], known: Mapping[str, float]
) -> Mapping[str, float]:
    """Print the table of all models of a problem; what is known after it."""
    for entry in table["model"]:
        problem = model_of(base, entry, known)
        simulator, theta = Simulator(problem), problem.nominal
        print(f"\n{entry['name']}")
        if entry.get("fit", True):
            estimate = fit(simulator, theta, effort=Effort("near"))
            theta = estimate.theta
            known = {**known, **estimate.values}
            print(f"  {shown(estimate)}")
        if "end" in table:
            print_ends(simulator, theta, table["end"])
        else:
            print_errors(simulator, theta, float(table.get("skip", 0.0)))
        if "inverse" in table:
            for run in problem.runs:
                found = inverse(problem, theta, run, table["inverse"])
                if found is not None:
                    print(f"  inverse force {run.name}: {found[0]:.3f} % as logged, "
                          f"{found[1]:.3f} % held")  # fmt: skip
        simulator.close()
    return known


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("mapping", type=Path, help="folder of dataset.toml and models.toml")
    parser.add_argument("folder", type=Path, help="folder of the logs")
    parser.add_argument("--models", default="models.toml", help="file beside the mapping")
    args = parser.parse_args()
    compared(args.mapping, args.folder, args.mapping / args.models)


if __name__ == "__main__":
    main()
