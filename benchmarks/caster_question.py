"""The mobile manipulator paper's open question: do its casters explain what is left in y?

    python -m benchmarks.caster_question --out out/caster_question

Its authors found a small discrepancy in y and put it down to the friction of the casters, without
a measurement of it. Here a machine that has such friction drives the paper's kinds of runs: dry
friction in all swivels and scrub under all casters, other parameters, noise as on the rig sheet.
The declared model has neither. `cosim diagnose` gets the logs alone; its report has the errors in
x and y before and after. With `--friction 0 --scrub 0` it must find nothing.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from benchmarks.own_plant import individual
from cosim.calibrate.mapping import read_problem
from cosim.calibrate.simulator import Simulator
from cosim.diagnose.candidates import candidates

Vector = NDArray[np.float64]
SCENARIOS = Path(__file__).parents[1] / "scenarios"
SHEET = SCENARIOS / "mobile_manipulator_bench/data/mobile_manipulator.toml"
PERIOD = 0.01
SWIVEL, FLOOR = "base.caster.swivel.coulomb.tau_c", "base.caster.floor.pivot_torque.M_pa"
EFFECTS = (("coulomb", "base.caster.swivel"), ("pivot_torque", "base.caster.floor"))
RUNS: dict[str, tuple[str, Sequence[tuple[float, float, float]]]] = {
    # purpose, then time [s] -> forward speed [m/s], yaw rate [rad/s]; straight lines in between
    "IN1": ("identification", [(1, 0, 0), (2, 0.5, 0), (4, 0.5, 0.04), (6, 0.5, -0.04),
                               (8, 0.5, 0), (9, 0, 0), (11, 0, 0)]),
    "IN2": ("identification", [(1, 0, 0), (3, 0.9, 0), (5, 0.9, -0.05), (6, 0.9, 0.05),
                               (8, 0, 0), (10, 0, 0)]),
    "CN1": ("identification", [(1, 0, 0), (2, 0.5, 0), (3, 0.5, 0.35), (7, 0.5, 0.35),
                               (8, 0.5, -0.3), (12, 0.5, -0.3), (13, 0, 0), (15, 0, 0)]),
    "S1": ("identification", [(1, 0, 0), (2, 0.2, 0), (4, 0.2, 0.2), (5, 0, 0), (6.5, 0, 0),
                              (7.5, 0.3, -0.2), (9, 0.3, 0.3), (10, 0, 0), (12, 0, 0)]),
    "CN2": ("validation", [(1, 0, 0), (2, 0.6, 0), (3.5, 0.6, -0.4), (7, 0.6, -0.4),
                           (9, 0.6, 0.2), (11, 0.4, 0), (12, 0, 0), (14, 0, 0)]),
    "IN3": ("validation", [(1, 0, 0), (2.5, 0.7, 0), (4, 0.7, 0.06), (6, 0.7, -0.03),
                           (7.5, 0, 0), (9.5, 0, 0)]),
}  # fmt: skip


def table(corners: Sequence[tuple[float, float, float]]) -> dict[str, Vector]:
    """Time and commands of a run."""
    at, v, w = np.array([(0.0, 0.0, 0.0), *corners], dtype=float).T
    time = PERIOD * np.arange(round(at[-1] / PERIOD) + 1)
    return {"time": time, "v_set": np.interp(time, at, v), "w_set": np.interp(time, at, w)}


def write(folder: Path, friction: float, scrub: float, seed: int) -> dict[str, float]:
    """Write the data set; return the true parameters."""
    random = np.random.default_rng(seed)
    names = ["base_x", "base_y", "base_phi", "wheel_speed_l", "wheel_speed_r", "motor_current_l",
             "motor_current_r"]  # fmt: skip
    columns = ", ".join(f'"{n}"' for n in ("time", "v_set", "w_set", *names))
    text = (
        f'rig = "mobile_manipulator"\nset = "casters"\nsheet = "{SHEET.as_posix()}"\n'
        f"sample_rate_hz = 100\ncolumns = [{columns}]\n"
    )
    tables = {name: table(corners) for name, (_, corners) in RUNS.items()}
    (folder / "runs").mkdir(parents=True, exist_ok=True)
    for name, (purpose, _) in RUNS.items():
        text += (
            f'\n[[run]]\nname = "{name}"\nfile = "runs/{name}.parquet"\npurpose = "{purpose}"\n'
            f"duration_s = {tables[name]['time'][-1]}\narm_moves = false\n"
            "initial_pose_robot = [0.0, 0.0, 0.0]\n"
        )
        empty = {n: np.zeros(tables[name]["time"].size) for n in names}
        pd.DataFrame(tables[name] | empty).to_parquet(folder / "runs" / f"{name}.parquet")
    (folder / "set.toml").write_text(text, encoding="utf-8")

    problem = declared = read_problem(folder)
    for effect, place in EFFECTS:
        known = [c for c in candidates(problem) if (c.effect, c.place) == (effect, place)]
        problem = known[0].added_to(problem)
    theta = problem.nominal
    theta[: len(declared.parameters)] = individual(declared, random)
    theta[problem.index(SWIVEL)], theta[problem.index(FLOOR)] = friction, scrub
    simulator = Simulator(problem)
    for run in problem.runs:
        values = simulator.simulate(theta, run)
        values += problem.sigma * random.standard_normal(values.shape)
        measured = dict(zip(names, values.T, strict=True))
        pd.DataFrame(tables[run.name] | measured).to_parquet(
            folder / "runs" / f"{run.name}.parquet"
        )
    simulator.close()
    truth = {n: float(v) for n, v in zip(problem.names, theta, strict=True) if "@" not in n}
    return {n: v for n, v in truth.items() if n in (SWIVEL, FLOOR) or "base." not in n}


def main() -> None:
    """Make the data, diagnose them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--friction", type=float, default=0.3, help="of each swivel [N.m]")
    parser.add_argument("--scrub", type=float, default=0.2, help="of each caster [N.m]")
    parser.add_argument("--seed", type=int, default=1, help="of parameters and noise")
    parser.add_argument("--out", type=Path, default=Path("out/caster_question"))
    arguments = parser.parse_args()
    folder = arguments.out / "data"
    truth = write(folder, arguments.friction, arguments.scrub, arguments.seed)
    print("\n".join(f"{name:40} {value:.5g}" for name, value in truth.items()), flush=True)
    command = ["-m", "cosim", "diagnose", str(folder), "--out", str(arguments.out / "diagnosis")]
    sys.exit(subprocess.run([sys.executable, *command], check=False).returncode)


if __name__ == "__main__":
    main()
