"""Friction that falls from run to run is named, though no run alone shows it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from cosim.calibrate.mapping import read_problem
from cosim.calibrate.problem import Problem
from cosim.diagnose.candidates import Candidate, candidates
from cosim.diagnose.search import Search
from cosim.diagnose.signature import worthy
from tests.problems import simulator

pytestmark = pytest.mark.slow

SHEET = Path(__file__).parents[2] / "scenarios/ur5_bench/data/ur5_bench.toml"
RIGHT = "warm_up at drive.friction_2"
LABELS = (
    RIGHT, "temperature_drift at arm.joint_2", "viscous at arm.joint_2",
    "quadratic_drag at arm.joint_2",
)  # fmt: skip
BEGUN = {"A": 20.0, "B": 90.0, "C": 220.0, "D": 150.0, "E": 300.0}  # [s] after power on
SECONDS, RATE, WARM, TIME = 1.5, 125.0, 8.0, 100.0


def arm(folder: Path, cold: float, seed: int) -> Problem:
    """Logs of an arm whose second joint has another friction in each run."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, SECONDS, 1 / RATE)
    text = f'rig = "ur5_bench"\nset = "arm"\nsheet = "{SHEET.as_posix()}"\nsample_rate_hz = 125\n'
    for name, begun in BEGUN.items():
        columns = {"time": time}
        ramp = np.minimum(time, 1.0)
        for joint in range(1, 7):
            sines = np.sin(2 * np.pi * time[:, None] * [0.4, 0.9, 1.7] + random.uniform(0, 6, 3))
            columns[f"q_set_{joint}"] = 0.2 * joint - 1.3 + 0.15 * ramp * sines.sum(axis=1)
            columns |= {f"{kind}_{joint}": np.zeros(time.size) for kind in ("q", "qd", "current")}
        pd.DataFrame(columns).to_parquet(folder / f"{name}.parquet")
        purpose = "validation" if name in "DE" else "identification"
        text += (
            f'\n[[run]]\nname = "{name}"\nfile = "{name}.parquet"\npurpose = "{purpose}"\n'
            f"duration_s = {time[-1]}\nstarted_s_after_power_on = {begun}\n"
        )
    (folder / "set.toml").write_text(text, encoding="utf-8")
    problem = read_problem(folder)
    data = {}
    for run in problem.runs:
        theta = problem.nominal
        fading = np.exp(-(BEGUN[run.name] + SECONDS / 2) / TIME)
        theta[problem.index("b_2")] = WARM * (1.0 + cold * fading)
        model = simulator(problem).simulate(theta, run)
        data[run.name] = model + problem.sigma * random.standard_normal(model.shape)
    return problem.with_data(data)


@pytest.mark.parametrize("cold", [0.5, 0.0])
def test_friction_that_fades_from_run_to_run(cold: float, tmp_path: Path) -> None:
    """And nothing is named where it does not."""
    problem = arm(tmp_path, cold, 3)
    search = Search(simulator(problem), only=[c for c in candidates(problem) if c.label in LABELS])
    found = search.round(search.calibrated()).winner
    search.close()
    if cold == 0.0:
        assert found is None
        return
    assert found is not None
    assert [e.label for e in found.effects] == [RIGHT]
    # three short runs that begin within two time constants: 15 % of the friction that the first run
    # has beyond the warm one
    values = found.estimate.values
    middle = BEGUN["A"] + SECONDS / 2
    t_w = values.get("drive.friction_2.warm_up.t_w", 120.0)
    late = values["b_2"] * (1.0 + values["drive.friction_2.warm_up.k"] * np.exp(-middle / t_w))
    assert late == pytest.approx(WARM * (1.0 + cold * np.exp(-middle / TIME)), rel=0.02)
    assert not any(name.endswith("t_on") for name in values)  # the runs state it


def test_one_run_does_not_rule_it_out() -> None:
    """What differs from run to run goes on whatever one run says of it."""

    def scored(place: str, gain: float, size: float = 1.0) -> Any:
        candidate = Candidate("drive", "ur5_drive", "warm_up", place)
        return SimpleNamespace(
            candidate=candidate, score=SimpleNamespace(gain=gain, size=size), absorbed=0.97
        )

    many = [scored(f"other_{i}", 1000.0) for i in range(50)]
    mine, unseen = scored("friction_2", 1.0), scored("friction_3", 0.0, size=0.0)
    assert mine not in worthy([*many, mine])
    kept = worthy([*many, mine, unseen], {mine.candidate.prefix, unseen.candidate.prefix})
    assert mine in kept and unseen not in kept
