"""Values that logs do not tell apart from others are estimated, with a data sheet's tolerance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.calibrate import read_problem
from cosim.calibrate.fit import fit
from cosim.calibrate.simulator import Simulator
from cosim.files import read_toml
from cosim.installation.builder import default_provider
from cosim.intake.grouping import grouped
from cosim.intake.importing import Inspected, Wishes, import_logs

RATIO, ETA, INERTIA, FRICTION = 20.0, 0.8, 0.021, 0.05
SHEET = 0.02
"""Of the inertia [kg.m2]: five per cent off, as the efficiency is."""
GEARED = f"""
connections = ["gear.tau_b -> load.tau", "load.w -> gear.w_b", "gear.J_b -> load.J_added"]
[instances]
gear = "gearbox/ratio"
load = "inertia/disc"
[parameters]
gear.ratio = {RATIO}
gear.eta = 0.85
gear.J_a = 0.0
load.J = {SHEET}
load.b = 0.04
"""
BARE = f"""
[instances]
load = "inertia/disc"
[parameters]
load.J = {SHEET}
load.b = 0.04
"""


def import_(folder: Path, system: str, torque: float, target: str) -> dict[str, dict[str, float]]:
    """Logs of a load that a known torque drives, imported; returns its parameters by name.

    Args:
        folder: for all of it.
        system: text of the system.
        torque: at the load over the logged one.
        target: variable that the logged torque drives.
    """
    random, step = np.random.default_rng(3), 0.01
    for name in ("one", "two"):
        tau = np.repeat(random.uniform(-0.1, 0.1, 12), 50)
        w = np.zeros(tau.size)
        decay = np.exp(-FRICTION / INERTIA * step)
        for i, value in enumerate(tau[:-1]):  # exact between samples: the torque is held
            w[i + 1] = decay * w[i] + (1.0 - decay) * torque * value / FRICTION
        rows = np.column_stack(
            [step * np.arange(tau.size), tau, w + random.normal(0.0, 0.05, w.size)]
        )
        np.savetxt(folder / f"{name}.csv", rows, delimiter=",", fmt="%.6f", comments="",
                   header="t_s,torque,speed_rad_s")  # fmt: skip
    (folder / "rig.toml").write_text(system)
    wishes = Wishes(str(folder / "rig.toml"), (f"torque={target}:N.m", "speed_rad_s=load.w"))
    files = grouped(sorted(folder.glob("*.csv")), {}, Inspected(wishes).columns).runs
    purposes = dict.fromkeys(files, "identification")
    import_logs(files, purposes, wishes, folder / "set", default_provider())
    return {e["name"]: e for e in read_toml(folder / "set" / "dataset.toml")["parameter"]}


def test_an_efficiency_that_an_inertia_hides_widens_what_is_found(tmp_path: Path) -> None:
    """Held at the sheet's value, it would make a confident interval beside the truth."""
    found = import_(tmp_path, GEARED, RATIO * ETA, "gear.tau_a")
    assert set(found) == {"gear.eta", "load.b", "load.J"}
    # the load's speed is measured, so what is the gear's is what is taken as known
    assert {name: e["prior"] for name, e in found.items() if "prior" in e} == {
        "gear.eta": pytest.approx(0.1 * 0.85)  # a sheet's tolerance
    }
    estimate = fit(Simulator(read_problem(tmp_path / "set")))
    place = estimate.problem.index("load.b")
    assert estimate.low[place] < FRICTION < estimate.high[place]
    half = 0.5 * (estimate.high[place] - estimate.low[place])
    # two standard deviations of a tenth: friction is as uncertain as the efficiency
    assert half == pytest.approx(0.2 * estimate.theta[place], rel=0.2)


def test_what_the_logs_tell_needs_no_tolerance(tmp_path: Path) -> None:
    found = import_(tmp_path, BARE, 1.0, "load.tau")
    assert set(found) == {"load.J", "load.b"}
    assert not any("prior" in entry for entry in found.values())
    estimate = fit(Simulator(read_problem(tmp_path / "set")))
    for name, truth in (("load.J", INERTIA), ("load.b", FRICTION)):
        value = dict(zip(estimate.problem.names, estimate.theta, strict=True))[name]
        assert value == pytest.approx(truth, rel=0.02)  # noise of a twentieth of the speed
