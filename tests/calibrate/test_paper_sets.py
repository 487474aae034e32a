"""The papers' machines on logs of plants that share nothing with the models: mappings and fits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import cosim
from cosim.calibrate import read_problem
from cosim.calibrate.calibration import calibrated
from cosim.calibrate.estimate import channel_rms
from cosim.errors import UnknownNameError
from cosim.intake.plants.writing import TRUE_BASE, TRUE_MACHINE
from cosim.report.pictures import first_guess, run_pictures
from cosim.system.toml import read_system
from tests.problems import simulator
from tests.scenarios.running import PROVIDER

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


def test_logs_may_stand_for_instances_of_a_system(tmp_path: Path) -> None:
    problem = read_problem("OMNI-1")
    assert set(problem.instances) == {"base"}
    assert problem.instances["base"].endswith("omni_base/dynamic+pivot_torque")
    assert {"base.tau_beta", "base.tau_phi"} <= {
        name.partition("[")[0] for name in problem.runs[0].inputs
    }


def test_an_instance_to_leave_out_that_is_not_there_is_named() -> None:
    system = read_system(SCENARIOS / "systems" / "mir250.toml")
    left = system.without(["path"])
    assert "path" not in left.instances and len(left.connections) == len(system.connections) - 5
    assert system.without([]) == system
    with pytest.raises(UnknownNameError, match=r"no instance 'pth' to leave out; .*'path'"):
        system.without(["pth"])


def test_the_omnidirectional_base_is_estimated_from_poses_alone(tmp_path: Path) -> None:
    problem = read_problem("OMNI-1")
    estimate, _ = calibrated(simulator(problem))
    for name, low, high in zip(problem.names, estimate.low, estimate.high, strict=True):
        # six intervals of 95 %: half as wide again misses one in 300
        margin = 0.25 * (high - low)
        assert low - margin < getattr(TRUE_BASE, name) < high + margin
    assert max(channel_rms(problem, estimate.residuals).values()) < 1.1  # 1050 samples: 2.2 %
    before = first_guess(estimate)
    assert max(channel_rms(problem, before.items()).values()) > 20.0  # another machine
    after = dict(estimate.residuals)
    fitted = problem.changed(runs=[run for run in problem.runs if run.name in after])
    assert fitted.runs
    names = [run.name for run in problem.runs if run.purpose == "validation"]
    after |= dict(estimate.simulator.residuals(estimate.theta, names))
    pictures = run_pictures(estimate, before, after, tmp_path)
    assert [path.stem for path in pictures] == [run.name for run in problem.runs]


def test_the_base_with_the_plants_values_drives_its_logs_to_the_noise() -> None:
    true = {
        "base.drive_wheel.mu_s": TRUE_MACHINE.grip, "base.caster.mu_s": TRUE_MACHINE.grip,
        "base.drive_wheel.mu_d": TRUE_MACHINE.sliding, "base.caster.mu_d": TRUE_MACHINE.sliding,
        **{f"motor_{side}.Ki_v": TRUE_MACHINE.ki_speed for side in ("left", "right")},
        **{f"motor_{side}.Kp_v": TRUE_MACHINE.kp_speed for side in ("left", "right")},
        **{f"gearbox_{side}.J_a": TRUE_MACHINE.rotor for side in ("left", "right")},
    }  # fmt: skip
    sizes = {}
    for name, parameters in (("true", true), ("first", {})):
        result = cosim.run("mir250/IN2", parameters=parameters, provider=PROVIDER)
        found = result.runs[""].comparisons
        sizes[name] = np.array([found[k].rms for k in ("x", "y", "phi")]) / [5e-4, 5e-4, 1e-3]
    # 501 samples: 1 within 3.2 %, three of these
    assert sizes["true"] == pytest.approx(1.0, abs=0.1)
    assert sizes["first"][0] > 1.5  # softer loops lag by millimetres while it accelerates
