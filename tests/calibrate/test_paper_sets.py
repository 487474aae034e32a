"""The papers' machines on logs of plants that share nothing with the models: mappings and fits."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.image import imread

import cosim
from cosim.calibrate import read_problem
from cosim.calibrate.estimate import channel_rms
from cosim.errors import UnknownNameError
from cosim.intake.plants.writing import TRUE_BASE, TRUE_MACHINE
from cosim.report.pictures import first_guess, run_pictures
from cosim.system.toml import read_system
from tests.problems import simulator
from tests.scenarios.running import PROVIDER

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


def test_logs_may_stand_for_instances_of_a_system() -> None:
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


def test_the_omnidirectional_base_with_the_plants_values_drives_its_logs_to_the_noise(
    tmp_path: Path,
) -> None:
    mapping = (SCENARIOS / "omni_base" / "dataset.toml").read_text()
    assert "step = 2.5e-3" in mapping
    fine = tmp_path / "dataset.toml"  # what is left of the exchange is an eighth of the noise
    fine.write_text(mapping.replace("step = 2.5e-3", "step = 5e-4"))
    problem = read_problem("OMNI-1", mapping=fine)
    true = np.array([getattr(TRUE_BASE, name) for name in problem.names])
    after = dict(simulator(problem).residuals(true, None))
    sizes = channel_rms(problem, list(after.items())).values()
    assert list(sizes) == pytest.approx([1.0] * 6, abs=0.08)  # 1404 samples: 1.9 %, four of these
    estimate = SimpleNamespace(problem=problem, simulator=simulator(problem), theta=true)
    before = first_guess(estimate)  # type: ignore[arg-type]
    assert min(channel_rms(problem, list(before.items())).values()) > 20.0  # another machine
    estimate.problem = problem.only(["arc"])
    (path,) = run_pictures(estimate, before, after, tmp_path / "new")  # type: ignore[arg-type]
    assert path.name == "arc.png" and imread(path).std() > 0.01  # not one colour


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
