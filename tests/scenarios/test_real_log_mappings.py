"""The mappings of logs that are not in the project: do they still fit their systems?"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.real_logs import errors, inverse, model_of
from cosim.calibrate import read_problem
from cosim.calibrate.differences import jacobian
from cosim.files import read_toml
from cosim.installation import places
from tests.problems import simulator

MAPPINGS = ("emps/dataset.toml", "emps/open_loop.toml", "bam_servo/dataset.toml",
            "kmutt_dcmotor/dataset.toml", "ur10e/dataset.toml", "ur10e/friction.toml")  # fmt: skip


def write_logs(folder: Path, mapping: Path) -> None:
    """Logs of slow sines with the columns and runs that a mapping names."""
    table = read_toml(mapping)
    interval = 1e-2 if "period" in table and float(table["step"]) > 1e-3 else 1e-3
    for run in table["run"]:
        size = int(run["samples"][1]) + 10 if "samples" in run else 900
        times = np.arange(size) * interval
        columns: dict[str, np.ndarray] = {}
        for name, entry in table["columns"].items():
            source = str(entry.get("source", name))
            wave = 0.01 * np.sin(3.0 * times + len(source))
            if "{}" in source:
                columns[source.removesuffix("_{}")] = np.tile(wave[:, None], 6)
            else:
                columns[source] = np.ones(size) if entry.get("unit") == "1" else wave
            if "time" in entry:
                columns[str(entry["time"])] = times
        for entry in table["inputs"].values():
            name = entry if isinstance(entry, str) else str(entry.get("column", ""))
            if name and name not in table["columns"]:
                columns[name] = 0.01 * np.cos(2.0 * times)
        columns[str(table["time"])] = times
        np.savez(folder / str(run["file"]), **columns)


@pytest.mark.parametrize("name", MAPPINGS)
def test_mapping_fits_its_system(name: str, tmp_path: Path) -> None:
    mapping = places.scenarios() / name
    write_logs(tmp_path, mapping)
    problem = read_problem(tmp_path, mapping=mapping)
    assert {run.purpose for run in problem.runs} == {"identification", "validation"}
    for _, residual in simulator(problem).residuals(problem.nominal, [problem.runs[0].name]):
        assert np.isfinite(residual).all()
    # every parameter moves the model: it names variables that exist and matter
    silent = {"tau_c"}  # friction of an arm that is hardly moved
    columns = problem.columns(problem.runs[0].name)
    item = jacobian(simulator(problem), problem.nominal, [problem.runs[0].name], central=False)[0]
    moved = np.any(item.values != 0.0, axis=(0, 1))
    names = {problem.names[i] for i, seen in zip(columns, moved, strict=True) if not seen}
    assert names <= silent | {n for n in names if n.startswith(("h_", "J_"))}
    simulator(problem).close()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["emps", "bam_servo", "kmutt_dcmotor", "ur10e"])
def test_models_of_the_benchmark_can_be_simulated(name: str, tmp_path: Path) -> None:
    folder = places.scenarios() / name
    write_logs(tmp_path, folder / "dataset.toml")
    problem = read_problem(tmp_path, mapping=folder / "dataset.toml")
    table = read_toml(folder / "models.toml")
    last = model_of(problem, table["model"][-1], {})
    assert len(last.parameters) != len(problem.parameters)
    rows = errors(simulator(last), last.nominal, 0.0)
    assert len(rows) == len(problem.runs) * len(problem.channels)
    assert np.isfinite([value for _, _, values in rows for value in values]).all()
    simulator(last).close()


def test_inverse_model_of_its_own_motion_needs_the_commanded_force(tmp_path: Path) -> None:
    folder = places.scenarios() / "emps"
    write_logs(tmp_path, folder / "dataset.toml")
    problem = read_problem(tmp_path, mapping=folder / "dataset.toml")
    theta, name = problem.nominal, problem.runs[0].name
    ((_, residual),) = simulator(problem).residuals(theta, [name])
    model = problem.run(name).data - residual * problem.sigma
    problem = problem.with_data({name: model})
    entry = read_toml(folder / "models.toml")["inverse"]
    logged, held = inverse(problem, theta, problem.run(name), entry) or (np.inf, np.inf)
    # in percent: difference quotients of a motion of 3 rad/s at 1 kHz err by (w h)^2 / 6 = 2e-6,
    # twice; half a sample of delay is worth w h / 2 = 1.5e-3 of what changes with it
    assert held < 1e-3
    assert logged > held
    heavier = theta * np.where([n == "M" for n in problem.names], 1.1, 1.0)
    wrong = inverse(problem, heavier, problem.run(name), entry) or (0.0, 0.0)
    assert wrong[1] > 0.5  # a tenth of the mass is worth some 0.8 % of the force here
    simulator(problem).close()
