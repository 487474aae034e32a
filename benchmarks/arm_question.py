"""A tool in the hand of a mobile manipulator, in logs of which the base alone was diagnosed.

    python -m benchmarks.arm_question --out out/arm_question

The folded arm holds a tool that nobody has declared while the base drives the runs of
`caster_question`; in one unused run the arm is stretched out and swings. To the base the tool is a
payload that stands aside; the currents that hold the joints tell it from one. With `--tool 0` it
must find nothing, and look at the base alone. `--payload` puts a mass on the base instead.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from benchmarks.caster_question import RUNS, SCENARIOS, SHEET, table
from benchmarks.own_plant import individual
from cosim.calibrate.mapping import read_problem
from cosim.calibrate.simulator import Simulator
from cosim.diagnose.candidates import candidates

Vector = NDArray[np.float64]
WHOLE = SCENARIOS / "mobile_manipulator_bench/arm.toml"
FOLDED = (3.14, -1.95, 2.25, -1.87, -1.57, 0.0)
STRETCHED = (-1.2, -0.2, 0.35, -1.72, -1.57, 0.0)
SWING = {"IN3": 0.4}
"""Of joint 1 in an unused run [rad]."""
TOOL, PAYLOAD = "payload at arm.tool", "payload at base.body"
PLACE = {"position[1]": 0.2, "position[2]": -0.1}
"""Of the payload on the base, from the middle of its axle [m]."""


def angles(name: str, time: Vector) -> dict[str, Vector]:
    """Set angles of the joints in a run."""
    pose = np.tile(STRETCHED if name in SWING else FOLDED, (time.size, 1))
    rest = np.clip(time - 1.0, 0.0, None)  # the servos stand when the log begins
    pose[:, 0] += SWING.get(name, 0.0) * (1.0 - np.cos(2.0 * rest))
    return {f"q_set_{i}": column for i, column in enumerate(pose.T, 1)}


def write(folder: Path, masses: dict[str, float], seed: int) -> dict[str, float]:
    """Write the data set; return the true parameters.

    Args:
        folder: where.
        masses: label of a payload -> its mass [kg].
        seed: of parameters and noise.
    """
    random = np.random.default_rng(seed)
    tables = {name: table(corners) for name, (_, corners) in RUNS.items()}
    tables = {name: t | angles(name, t["time"]) for name, t in tables.items()}
    measured = ["base_x", "base_y", "base_phi", "ee_x", "ee_y", "ee_z"]
    measured += [f"{kind}_{side}" for kind in ("wheel_speed", "motor_current") for side in "lr"]
    measured += [f"{kind}_{i}" for kind in ("q", "qd", "joint_current") for i in range(1, 7)]
    text = (
        f'rig = "mobile_manipulator"\nset = "arm"\nsheet = "{SHEET.as_posix()}"\n'
        f"sample_rate_hz = 100\ncolumns = {[*tables['IN1'], *measured]}\n"
    )
    (folder / "runs").mkdir(parents=True, exist_ok=True)
    for name, (purpose, _) in RUNS.items():
        text += (
            f'\n[[run]]\nname = "{name}"\nfile = "runs/{name}.parquet"\npurpose = "{purpose}"\n'
            f"duration_s = {tables[name]['time'][-1]}\narm_moves = {str(name in SWING).lower()}\n"
            "initial_pose_robot = [0.0, 0.0, 0.0]\n"
        )
        empty = {n: np.zeros(tables[name]["time"].size) for n in measured}
        pd.DataFrame(tables[name] | empty).to_parquet(folder / "runs" / f"{name}.parquet")
    (folder / "set.toml").write_text(text, encoding="utf-8")

    problem = declared = read_problem(folder, mapping=WHOLE)
    values = {}
    for label, mass in masses.items():
        known = next(c for c in candidates(problem) if c.label == label)
        problem = known.added_to(problem)
        values[f"{known.prefix}mass"] = mass
        if label == PAYLOAD:
            values |= {f"{known.prefix}{name}": at for name, at in PLACE.items()}
    theta = problem.nominal
    theta[: len(declared.parameters)] = individual(declared, random)
    for name, value in values.items():
        theta[problem.index(name)] = value
    simulator = Simulator(problem)
    names = [channel.name for channel in problem.channels]
    for run in problem.runs:
        y = simulator.simulate(theta, run) + problem.sigma * random.standard_normal(run.data.shape)
        log = pd.DataFrame(tables[run.name] | dict(zip(names, y.T, strict=True)))
        log.to_parquet(folder / "runs" / f"{run.name}.parquet")
    simulator.close()
    truth = {n: float(v) for n, v in zip(problem.names, theta, strict=True) if "@" not in n}
    return {n: v for n, v in truth.items() if n in values or "." not in n}


def main() -> None:
    """Make the data, diagnose them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--tool", type=float, default=2.0, help="in the hand [kg]")
    parser.add_argument("--payload", type=float, default=0.0, help="on the base [kg]")
    parser.add_argument("--seed", type=int, default=1, help="of parameters and noise")
    parser.add_argument("--out", type=Path, default=Path("out/arm_question"))
    arguments = parser.parse_args()
    folder = arguments.out / "data"
    masses = {TOOL: arguments.tool, PAYLOAD: arguments.payload}
    truth = write(folder, {n: m for n, m in masses.items() if m}, arguments.seed)
    print("\n".join(f"{name:40} {value:.5g}" for name, value in truth.items()), flush=True)
    command = ["-m", "cosim", "diagnose", str(folder), "--out", str(arguments.out / "diagnosis")]
    sys.exit(subprocess.run([sys.executable, *command], check=False).returncode)


if __name__ == "__main__":
    main()
