"""What `cosim new system` writes runs and is fitted at once, and says what is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import cosim
from cosim.calibrate.mapping import read_problem
from cosim.calibrate.simulator import Simulator
from cosim.errors import CosimError, InputError, UnknownNameError, VariantError
from cosim.installation.builder import default_provider
from cosim.robots import composed, create, templates
from cosim.system.toml import read_system

KINDS = [name for name in templates.names() if name != "arm"]
STARTS = ("x_start", "y_start", "yaw_start")


def made(kind: str, folder: Path, **given: float | list[float]) -> Path:
    create.from_template("robot", folder, templates.read(kind, given), default_provider())
    return folder


def misfit(folder: Path, values: dict[str, float]) -> float:
    """Root mean square of what a model with these values leaves, over the noise."""
    problem = read_problem(folder, default_provider())
    theta = problem.nominal.copy()
    for name, value in values.items():
        theta[problem.index(name)] = value
    for k, name in enumerate(problem.names):
        if name.startswith(STARTS):
            theta[k] = 0.0  # where the runs begin; the mapping begins at the first measured pose
    simulator = Simulator(problem)
    run = problem.run("identification")
    left = (np.asarray(run.data) - simulator.simulate(theta, run)) / problem.sigma
    simulator.close()
    return float(np.sqrt(np.nanmean(left**2)))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_example_logs_fit_with_their_values_and_not_with_the_nominal_ones(
    kind: str, tmp_path: Path
) -> None:
    folder = made(kind, tmp_path / "robot")
    chosen = templates.read(kind, {})
    true = {
        name: chosen.values[name] * entry["example"]
        for name, entry in chosen.parameters.items()
        if "example" in entry
    }
    # 600 values and more: the mean square has a deviation of 6 % at most
    assert misfit(folder, true) == pytest.approx(1.0, abs=0.1)
    assert misfit(folder, {}) > 2.0


@pytest.mark.slow
def test_dimensions_go_into_all_files(tmp_path: Path) -> None:
    folder = made("diff_drive", tmp_path / "robot", track=0.8, r=0.25)
    assert read_system(folder / "system.toml").parameters == {"base.r": 0.25, "base.track": 0.8}
    problem = read_problem(folder, default_provider())
    assert problem.nominal[problem.index("track")] == 0.8
    result = cosim.run(str(folder / "scenario.toml"))
    # at 0.4 m/s ahead for 2.5 s, then a quarter less on a curve with the radius 3 w/2
    at = result.runs["identification"].recording
    index = int(np.searchsorted(at.time, 2.5 - 1e-9))
    assert at["camera.x_meas"][index] == pytest.approx(1.0, abs=1e-9)
    index = int(np.searchsorted(at.time, 5.0 - 1e-9))
    assert at["camera.phi_meas"][index] == pytest.approx(0.2 / 0.8 * 2.5, abs=1e-9)


@pytest.mark.slow
def test_a_car_turns_about_the_rear_axle(tmp_path: Path) -> None:
    folder = made("ackermann", tmp_path / "robot", l=2.0, r=0.3)
    recording = cosim.run(str(folder / "scenario.toml")).runs["identification"].recording
    index = [int(np.searchsorted(recording.time, t - 1e-9)) for t in (2.5, 5.0)]
    yaw = recording["camera.phi_meas"]
    # v = 0.32 m/s with the wheels at 0.3 rad, bicycle model
    assert yaw[index[1]] - yaw[index[0]] == pytest.approx(0.32 * np.tan(0.3) / 2.0 * 2.5, rel=1e-6)


@pytest.mark.parametrize(
    ("act", "error", "message"),
    [
        (lambda _: templates.read("omnii", {}), UnknownNameError, "did you mean 'omni'"),
        (lambda _: templates.read("omni", {"rr": 1.0}), UnknownNameError, "no parameter 'rr'"),
        (lambda _: templates.read("omni", {"alpha": 1.0}), InputError, "a list of 3 numbers"),
        (lambda _: templates.read("omni", {"r": "big"}), InputError, "r=big: must be a number"),
        (
            lambda p: create.new_folder("crawler", p / "crawler"),
            InputError,
            "'crawler' is the name of a scenario",
        ),
        (
            lambda p: composed.write("x", p / "x", ["gearbocks"], {}, default_provider()),
            VariantError,
            "did you mean 'gearbox'",
        ),
        (
            lambda p: composed.write(
                "x", p / "x", ["inertia"], {"inertia.M": 1}, default_provider()
            ),
            UnknownNameError,
            "M",
        ),
    ],
)
def test_wrong_wishes_are_named_and_write_nothing(
    act: object, error: type[CosimError], message: str, tmp_path: Path
) -> None:
    assert callable(act)
    with pytest.raises(error, match=message):
        act(tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_nothing_is_overwritten(tmp_path: Path) -> None:
    folder = made("diff_drive", tmp_path / "robot")
    before = (folder / "system.toml").read_text()
    with pytest.raises(InputError, match=r"has system\.toml, scenario\.toml, dataset"):
        made("omni", folder)
    assert (folder / "system.toml").read_text() == before


@pytest.mark.slow
def test_components_are_connected_at_their_power_ports_and_run(tmp_path: Path) -> None:
    files = composed.write(
        "drive", tmp_path, ["dc_motor/sampled", "gearbox", "inertia", "encoder"],
        {"inertia.J": 0.2}, default_provider(),
    )  # fmt: skip
    file = read_system(files[0])
    wires = {(wire.source, wire.target) for wire in file.connections}
    assert wires >= {
        ("dc_motor.tau", "gearbox.tau_a"), ("gearbox.w_a", "dc_motor.w"),
        ("gearbox.tau_b", "inertia.tau"), ("inertia.w", "gearbox.w_b"),
        ("gearbox.J_b", "inertia.J_added"),
    }  # fmt: skip
    system = file.build(default_provider())
    assert len(system.bonds()) == 2
    assert system.open_inputs() == ["dc_motor.w_ref"]
    result = cosim.run(str(files[1]), duration=0.05)
    assert '# "dc_motor.w_ref" = 0.0   # [rad/s] set speed' in files[1].read_text()
    assert len(result.recording) == 51
