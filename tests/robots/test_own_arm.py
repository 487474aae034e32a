"""An arm of one's own from file to identified masses; devices are found and kept up to date."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest

from cosim.calibrate.fit import fit
from cosim.calibrate.mapping import read_problem
from cosim.calibrate.simulator import Simulator
from cosim.cli import main
from cosim.errors import InputError, UnknownNameError, VariantError
from cosim.installation.builder import Builder, Installed, default_provider
from cosim.robots import arms, device, reader
from cosim.system.provider import FolderProvider
from sources.laws import base_parameters as base
from sources.packaging.catalog import names, own_names
from sources.variant import UnknownVariantError, build_model, device_values, devices

URDF = """<robot name="two link">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.3 0.02 0"/><mass value="4"/>
    <inertia ixx="0.02" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="fore"><inertial><origin xyz="0.2 0 0.01"/><mass value="2"/>
    <inertia ixx="0.01" iyy="0.04" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="tool"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <origin rpy="1.5707963267948966 0 0" xyz="0 0 0.4"/><axis xyz="0 0 1"/>
    <limit lower="-1.5" upper="1.5" effort="120" velocity="3"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/>
    <origin xyz="0.6 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="40" velocity="4"/></joint>
  <joint name="flange" type="fixed"><parent link="fore"/><child link="tool"/>
    <origin xyz="0.5 0 0"/></joint>
</robot>"""
PAYLOAD = 0.5
WIDE = 1.5
"""Intervals of 95 %, made intervals of three sigma: six values are tested at once."""


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of a user's, with the URDF and a device file."""
    folder = tmp_path_factory.mktemp("user")
    (folder / "robot.urdf").write_text(URDF, encoding="utf-8")
    (folder / "devices").mkdir()
    arm = reader.read_arm(folder / "robot.urdf")
    (folder / "devices" / "two.toml").write_text(device.text(arm, "robot.urdf"), encoding="utf-8")
    return folder


@pytest.fixture
def here(home: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(home)
    monkeypatch.delenv("COSIM_DEVICES", raising=False)
    return home


def base_values() -> dict[str, float]:
    given = {key: item.value for key, item in device_values("serial_arm", "two").items()}
    standard = base.standard_parameters(given["mass"], given["centre"], given["inertia"])
    found = base.find(given["rotation"], given["offset"], given["prismatic"])
    return {item.name: item.value(standard) for item in found}


def fitted(folder: Path, payload: float) -> dict[str, tuple[float, float]]:
    """Intervals of the base parameters from logs of the arm with a load on its flange."""
    shutil.rmtree(folder, ignore_errors=True)
    arms.write("arm", folder, "two", {"payload": payload}, default_provider(), logs=True)
    simulator = Simulator(read_problem(folder, default_provider()))
    estimate = fit(simulator)
    simulator.close()
    names = estimate.problem.names
    assert all(estimate.identifiable)
    intervals = zip(estimate.low.tolist(), estimate.high.tolist(), strict=True)
    return dict(zip(names, intervals, strict=True))


@pytest.mark.slow
def test_masses_are_identified_and_a_load_is_where_it_is(here: Path) -> None:
    nominal = base_values()
    # planar arm: two first moments and an inertia of each link, Khalil and Dombre 2002, ch. 9
    assert set(nominal) == {f"base_{e}_{k}" for e in ("h_x", "h_y", "J_zz") for k in (1, 2)}
    found = fitted(here / "loaded", PAYLOAD)
    change = {  # of a point mass 0.5 m beyond the elbow, 0.6 m beyond the shoulder
        "base_h_x_1": 0.6 * PAYLOAD, "base_J_zz_1": 0.36 * PAYLOAD,
        "base_h_x_2": 0.5 * PAYLOAD, "base_J_zz_2": 0.25 * PAYLOAD,
    }  # fmt: skip
    for name, (low, high) in found.items():
        middle, half = (low + high) / 2, (high - low) / 2
        true = nominal[name] + change.get(name, 0.0)
        assert abs(middle - true) < WIDE * half, name
    low, _ = found["base_h_x_2"]
    assert low > nominal["base_h_x_2"] + 0.2


@pytest.mark.slow
def test_without_a_load_nothing_is_found(here: Path) -> None:
    nominal = base_values()
    for name, (low, high) in fitted(here / "bare", 0.0).items():
        assert abs((low + high) / 2 - nominal[name]) < WIDE * (high - low) / 2, name


@pytest.mark.slow
def test_a_changed_device_file_is_built_anew_beside_it(here: Path) -> None:
    path = here / "devices" / "two.toml"
    before = path.read_text(encoding="utf-8")
    built = Builder().path("joint_trajectory.two/quintic")
    assert built.parent == Path("devices") / "fmi2"
    first = built.read_bytes()
    changed = re.sub(r"(\[q_hold\]\n# .*|\[q_end\]\nvalue = )\[[^]]*\]", r"\1[0.25, 0.5]", before)
    assert changed != before
    try:
        path.write_text(changed, encoding="utf-8")
        assert Builder().path("joint_trajectory.two/quintic").read_bytes() != first
    finally:
        path.write_text(before, encoding="utf-8")
    assert Builder().path("joint_trajectory.two/quintic").read_bytes() == first
    assert FolderProvider("devices").path("joint_trajectory.two/quintic").is_file()


def test_devices_are_found_by_folder_and_by_the_environment(
    here: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "two" in devices("serial_arm") and "two" not in devices("gearbox")
    monkeypatch.chdir(tmp_path)
    assert "two" not in devices("serial_arm")
    with pytest.raises(UnknownVariantError, match="'serial_arm' has no device 'two'"):
        build_model("serial_arm.two/kinematic")
    assert own_names() == []
    monkeypatch.setenv("COSIM_DEVICES", str(here / "devices"))
    assert build_model("serial_arm.two/kinematic").device == "two"
    assert "serial_arm.two/rigid" in own_names() and own_names("gearbox") == []
    assert not any(".two/" in name for name in names("arm_drive"))


@pytest.mark.slow
def test_without_the_sources_fmus_beside_the_device_file_serve(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    built = default_provider().path("joint_trajectory.two/quintic")

    def missing(module: str) -> None:
        raise VariantError("building FMUs needs casadi, which is not installed")

    monkeypatch.setattr("cosim.installation.builder.sources", missing)
    assert Installed().path("joint_trajectory.two/quintic") == built
    with pytest.raises(VariantError, match=r"devices: has no FMU of 'joint_trajectory.two/swung'"):
        Installed().path("joint_trajectory.two/swung")


def test_a_device_does_not_hide_one_that_comes_with_cosim(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COSIM_DEVICES", str(tmp_path))
    (tmp_path / "two_link.toml").write_text('components = ["serial_arm"]', encoding="utf-8")
    with pytest.raises(UnknownVariantError, match="has a device 'two_link' already"):
        devices("serial_arm")
    (tmp_path / "two_link.toml").write_text("components = [", encoding="utf-8")
    with pytest.raises(VariantError, match=r"two_link.toml: is no TOML"):
        default_provider().path("serial_arm.two_link/rigid")


def test_an_arm_that_nobody_has_imported(here: Path) -> None:
    with pytest.raises(UnknownNameError, match=r"did you mean 'two'.*cosim arm import"):
        arms.write("x", here / "x", "twoo", {}, default_provider(), logs=False)
    with pytest.raises(InputError, match="is the name of a scenario"):
        arms.write("ur10e", here / "y", "two", {}, default_provider(), logs=False)
    assert not (here / "x").exists() and not (here / "y").exists()


@pytest.mark.slow
def test_the_command_line(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(home / "robot.urdf", tmp_path)
    monkeypatch.chdir(tmp_path)

    def cosim(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr("sys.argv", ["cosim", *arguments])
        with pytest.raises(SystemExit) as left:
            main()
        return left.value.code, *capsys.readouterr()

    code, out, err = cosim("arm", "import", "robot.urdf", "--no-build", "--json")
    assert code == 0, err
    content = json.loads(out)
    assert content["file"] == "devices/two_link.toml"
    assert content["joints"] == ["shoulder", "elbow"] and content["tip"] == "tool"
    assert "note: link 'tool' has no <inertial>" in err
    path = tmp_path / "devices" / "two_link.toml"
    path.write_text(path.read_text().replace("[4.0, 2.0]", "[4.5, 2.0]"), encoding="utf-8")
    code, _, err = cosim("arm", "import", "robot.urdf", "--no-build")
    assert code == 2 and "is there and differs" in err and "4.5" in path.read_text()
    code, _, err = cosim("arm", "import", "robot.urdf", "--no-build", "--replace")
    assert code == 0 and "4.5" not in path.read_text()
    code, _, err = cosim("arm", "import", "robot.urdf")
    assert code == 2 and "'two_link' is a device of 'serial_arm' that comes with cosim" in err
    code, _, err = cosim("arm", "import", "robot.urdf", "--tip", "toll")
    assert code == 2 and "did you mean 'tool'" in err
    code, out, _ = cosim("new", "system", "--json")
    assert {item["template"] for item in json.loads(out)} >= {"arm", "diff_drive"}
    code, _, err = cosim("new", "system", "thing")
    assert code == 2 and "Give --template or --from" in err
