"""Arms from URDF and MJCF: the same as pinocchio and MuJoCo make of the files."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from cosim.errors import InputError
from cosim.robots import device, reader
from cosim.robots.tree import Arm
from sources.function import Oracle
from sources.laws import base_parameters as base
from sources.variant import build_model

from .chains import named, vector
from .urdfs import PANDA_LINKS, panda, random_chain

HERE = Path(__file__).parent
ROUNDING = 1e-9
"""Relative to the largest: some hundred operations of 1e-16 each, and what cancels between them."""
DECIMALS = 1e-10
"""MuJoCo's numbers are printed to twelve digits; the largest is 52."""


MUJOCO_MATRIX = (
    (6.22, -0.490404944136, 0.0723091996963, -0.000351638554566),
    (-0.490404944136, 0.190793839836, -0.0233539848954, 0.00107368947032),
    (0.0723091996963, -0.0233539848954, 0.06408773017, -0.00102640632297),
    (-0.000351638554566, 0.00107368947032, -0.00102640632297, 0.02107),
)
MUJOCO_BIAS = (52.2384469748, -3.03140787365, 0.0451335936524, 0.026536788993)
"""mj_fullM and qfrc_bias of MuJoCo 4.0.0 for mjcf_arm.xml at q = (0.2, 0.3, -0.4, 0.5)."""


def read(text: str, folder: Path, tip: str = "") -> Arm:
    path = folder / "robot.urdf"
    path.write_text(text, encoding="utf-8")
    return reader.read_arm(path, tip=tip)


def values(arm: Arm) -> dict[str, Any]:
    table = tomllib.loads(device.text(arm, "test"))
    return {key: item["value"] for key, item in table.items() if "value" in item}


def symmetric(upper: np.ndarray) -> np.ndarray:
    return np.triu(upper) + np.triu(upper, 1).T


def assert_near(found: Any, wanted: Any) -> None:
    scale = max(float(np.max(np.abs(wanted))), 1.0)
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=ROUNDING * scale)


@pytest.fixture
def devices(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "somewhere"
    folder.mkdir()
    monkeypatch.setenv("COSIM_DEVICES", str(folder))
    return folder


@pytest.mark.parametrize("seed", range(20))
def test_inertia_gravity_and_regressor_are_those_of_pinocchio(seed: int, tmp_path: Path) -> None:
    size = 1 + seed % 7
    text = random_chain(seed, size)
    arm = read(text, tmp_path)
    model = pin.buildModelFromXML(text)
    data = model.createData()
    q, qd, qdd = np.random.default_rng(seed).uniform(-2.0, 2.0, (3, size))
    assert [joint.name for joint in arm.joints] == list(model.names)[1:]
    assert_near(arm.inertia_matrix(q), symmetric(pin.crba(model, data, q)))
    assert_near(arm.gravity_torques(q), pin.computeGeneralizedGravity(model, data, q))
    given = values(arm)
    geometry = given["rotation"], given["offset"], given["prismatic"]
    standard = base.standard_parameters(given["mass"], given["centre"], given["inertia"])
    torques = base.regressor(*geometry, q, qd, qdd) @ np.ravel(standard)
    assert_near(torques, pin.rnea(model, data, q, qd, qdd))


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "size"), [(1, 2), (2, 4), (30, 6)])
def test_fmus_move_as_pinocchio_says(seed: int, size: int, tmp_path: Path, devices: Path) -> None:
    text = random_chain(seed, size)
    (devices / "robot.toml").write_text(device.text(read(text, tmp_path, "tool"), "test"), "utf-8")
    model = pin.buildModelFromXML(text)
    data = model.createData()
    q, qd, qdd, tau = np.random.default_rng(seed).uniform(-2.0, 2.0, (4, size))
    free = Oracle(build_model("serial_arm.robot/rigid"))
    given = named(angle=q, speed=qd, tau=tau)
    assert_near(vector(free.derivatives(given), "speed"), pin.aba(model, data, q, qd, tau))
    outputs = free.outputs(given)
    pin.framesForwardKinematics(model, data, q)
    tool = data.oMf[model.getFrameId("tool")]
    assert_near(vector(outputs, "tool_position"), tool.translation)
    turned = pin.exp3(vector(outputs, "tool_rotation"))
    assert_near(turned, tool.rotation)
    led = Oracle(build_model("moved_arm.robot/rigid"))
    no_rotors = named(J_m=np.zeros(size))
    torques = vector(led.outputs(named(q=q, qd=qd, qdd=qdd) | no_rotors), "tau")
    assert_near(torques, pin.rnea(model, data, q, qd, qdd))


@pytest.mark.slow
def test_the_account_of_energy_closes_with_sliding_joints(tmp_path: Path, devices: Path) -> None:
    text = random_chain(2, 4)
    assert "prismatic" in text
    (devices / "robot.toml").write_text(device.text(read(text, tmp_path, "tool"), "test"), "utf-8")
    random = np.random.default_rng(0)
    for fidelity in ("kinematic", "rigid_moving", "elastic"):
        model = Oracle(build_model(f"serial_arm.robot/{fidelity}"))
        names = [*model.state_names, *(v.name for v in model.model.of_role("input"))]
        state = dict(zip(names, random.uniform(0.1, 1.0, len(names)), strict=True))
        defect, largest = model.energy_defect(state)
        assert abs(defect) < ROUNDING * largest


@pytest.mark.slow
def test_a_panda_has_43_base_parameters_and_torques_follow_them(
    tmp_path: Path, devices: Path
) -> None:
    arm = read(panda(), tmp_path)
    (devices / "panda.toml").write_text(device.text(arm, "test"), "utf-8")
    given = values(arm)
    geometry = given["rotation"], given["offset"], given["prismatic"]
    found = base.find(*geometry)
    assert len(found) == 43  # Gaz et al., 2019
    assert {item.name for item in found} >= {"base_h_x_7", "base_h_y_4", "base_J_zz_1"}
    led = Oracle(build_model("moved_arm.panda/rigid"))
    random = np.random.default_rng(1)
    q, qd, qdd = random.uniform(-1.0, 1.0, (3, 7))
    motion = named(q=q, qd=qd, qdd=qdd)
    starts = {v.name: v.start for v in led.model.of_role("parameter")}
    before = vector(led.outputs(motion), "tau")
    changes = random.uniform(-0.1, 0.1, len(found))
    changed = {
        item.name: starts[item.name] + change for item, change in zip(found, changes, strict=True)
    }
    matrix = base.regressor(*geometry, q, qd, qdd)
    columns = [matrix[:, 10 * (item.link - 1) + item.element] for item in found]
    after = vector(led.outputs(motion | changed), "tau")
    assert_near(after - before, np.column_stack(columns) @ changes)


@pytest.mark.slow
def test_base_parameters_of_other_masses_make_the_arm_move_like_one_with_them(
    tmp_path: Path, devices: Path
) -> None:
    text, heavier = random_chain(6, 4), random_chain(6, 4)
    for mass in re.findall(r'mass value="([\d.]+)"', text):
        heavier = heavier.replace(f'mass value="{mass}"', f'mass value="{1.5 * float(mass)!r}"')
    (devices / "robot.toml").write_text(device.text(read(text, tmp_path, "tool"), "test"), "utf-8")
    other = values(read(heavier, tmp_path, "tool"))
    standard = base.standard_parameters(other["mass"], other["centre"], other["inertia"])
    found = base.find(other["rotation"], other["offset"], other["prismatic"])
    changed = {item.name: item.value(standard) for item in found}
    free = Oracle(build_model("serial_arm.robot/rigid"))
    q, qd, tau = np.random.default_rng(3).uniform(-2.0, 2.0, (3, 4))
    state = named(angle=q, speed=qd, tau=tau)
    model = pin.buildModelFromXML(heavier)
    wanted = pin.aba(model, model.createData(), q, qd, tau)
    moved = vector(free.derivatives(state | changed), "speed")
    # the formulas are rounded to nine decimals; the lightest joint carries 0.1 kg.m2
    np.testing.assert_allclose(moved, wanted, rtol=1e-6, atol=1e-6)
    assert np.max(np.abs(vector(free.derivatives(state), "speed") - wanted)) > 0.1


@pytest.mark.slow
def test_masses_that_show_in_no_torque_do_not_change_the_base_parameters(tmp_path: Path) -> None:
    given = values(read(panda(), tmp_path))
    geometry = given["rotation"], given["offset"], given["prismatic"]
    found = base.find(*geometry)
    standard = np.array(base.standard_parameters(given["mass"], given["centre"], given["inertia"]))
    random = np.random.default_rng(2)
    rows = [base.regressor(*geometry, *random.uniform(-2, 2, (3, 7))) for _ in range(40)]
    unseen = np.linalg.svd(np.vstack(rows))[2][len(found) :]
    other = standard + (unseen.T @ random.uniform(-1, 1, len(unseen))).reshape(7, 10)
    # the combinations are rounded to nine decimals, and the Panda's right angles to eleven
    for item in found:
        assert item.value(other) == pytest.approx(item.value(standard), abs=1e-7)
    torques = rows[0] @ np.ravel(standard)
    np.testing.assert_allclose(rows[0] @ np.ravel(other), torques, atol=1e-9)


def test_limits_and_masses_are_kept(tmp_path: Path) -> None:
    arm = read(panda(), tmp_path)
    given = values(arm)
    assert given["q_min"][3] == -3.0718 and given["q_max"][5] == 3.7525
    assert given["tau_max"] == [87.0] * 4 + [12.0] * 3 and given["speed_max"][6] == 2.61
    assert given["mass"] == pytest.approx([mass for mass, _, _ in PANDA_LINKS])
    assert arm.tip == "panda_link8" and arm.base == "panda_link0"
    assert "link 'panda_link8' has no <inertial>: it counts as massless" in arm.notes


def test_a_hand_is_merged_with_its_fingers_locked(tmp_path: Path) -> None:
    text = panda(hand=True)
    arm = read(text, tmp_path, tip="panda_link8")
    assert arm.bodies[-1].mass == pytest.approx(PANDA_LINKS[-1][0] + 0.73 + 2 * 0.015)
    assert sum("locked at 0" in note for note in arm.notes) == 2
    whole = pin.buildModelFromXML(text)
    model = pin.buildReducedModel(whole, [8, 9], pin.neutral(whole))
    data = model.createData()
    q = np.linspace(-1.0, 1.0, 7)
    assert_near(arm.inertia_matrix(q), symmetric(pin.crba(model, data, q)))


def test_a_mujoco_arm_is_what_mujoco_makes_of_it() -> None:
    arm = reader.read_arm(HERE / "mjcf_arm.xml")
    q = [0.2, 0.3, -0.4, 0.5]
    armature = [joint.armature for joint in arm.joints]
    found = arm.inertia_matrix(q) + np.diag(armature)
    np.testing.assert_allclose(found, MUJOCO_MATRIX, rtol=0.0, atol=DECIMALS)
    np.testing.assert_allclose(arm.gravity_torques(q), MUJOCO_BIAS, rtol=0.0, atol=DECIMALS)
    assert [joint.name for joint in arm.joints] == ["lift", "swing", "roll", "wrist"]
    assert [joint.kind for joint in arm.joints] == ["prismatic", *["revolute"] * 3]
    wrist = arm.joints[3]
    assert (wrist.lower, wrist.upper) == pytest.approx((-np.pi / 2, 2 * np.pi / 3))
    assert (wrist.damping, wrist.friction, wrist.armature) == (0.1, 0.05, 0.02)
    assert arm.joints[0].effort == 300.0 and arm.joints[2].upper == np.inf


def link(name: str, mass: float = 1.0) -> str:
    return (
        f'<link name="{name}"><inertial><mass value="{mass}"/>'
        '<inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
    )


def joint(name: str, parent: str, child: str, kind: str = "revolute", inside: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="0 0 1"/>{inside}</joint>'
    )


def robot(*parts: str) -> str:
    return f'<robot name="r">{"".join(parts)}</robot>'


TWO = link("a") + link("b") + link("c")
REFUSED = {
    "branch": (
        robot(TWO, joint("left", "a", "b"), joint("right", "a", "c")),
        r"branches at link 'a' into 'left' and 'right'.*--tip, e.g. a, b, c",
    ),
    "loop": (
        robot(TWO, joint("1", "a", "b"), joint("2", "a", "c"), joint("3", "b", "c")),
        r"link 'c' hangs on two joints, '2' and '3': a closed loop",
    ),
    "ring": (
        robot(link("a"), link("b"), joint("1", "a", "b"), joint("2", "b", "a")),
        r"0 links hang on no joint \(a closed loop\)",
    ),
    "mimic": (
        robot(TWO, joint("1", "a", "b"), joint("2", "b", "c", inside='<mimic joint="1"/>')),
        r"joint '2' of the chain mimics '1'",
    ),
    "floating": (
        robot(TWO, joint("1", "a", "b", "floating"), joint("2", "b", "c")),
        r"joint '1' of the chain is of type 'floating'",
    ),
    "nothing moves": (robot(link("a"), link("b"), joint("1", "a", "b", "fixed")), "no joint moves"),
    "no such link": (robot(link("a"), joint("1", "a", "z")), "joint '1': its child 'z' is no"),
    "axis": (
        robot(link("a"), link("b"), joint("1", "a", "b").replace("0 0 1", "0 0 0")),
        "joint '1': its axis is '0 0 0'",
    ),
    "number": (robot(link("a").replace('"1"', '"one"', 1)), r"link 'a': ixx is 'one'"),
    "two names": (robot(link("a"), link("a")), "two <link> have the name 'a'"),
    "mass": (robot(link("a"), link("b", -1.0), joint("1", "a", "b")), "mass -1 kg"),
    "limits": (
        robot(link("a"), link("b"), joint("1", "a", "b", inside='<limit lower="1" upper="0"/>')),
        "its lower limit 1 lies above its upper limit 0",
    ),
    "effort": (
        robot(link("a"), link("b"), joint("1", "a", "b", inside='<limit effort="-1"/>')),
        "joint '1': its effort is -1; it must not be negative",
    ),
    "damping": (
        robot(link("a"), link("b"), joint("1", "a", "b", inside='<dynamics damping="-2"/>')),
        "joint '1': its damping is -2; it must not be negative",
    ),
    "xacro": (
        '<robot xmlns:xacro="http://ros.org/xacro" name="r"><xacro:include/></robot>',
        "is a xacro file",
    ),
    "other": ("<sdf/>", "root element is <sdf>; a URDF has <robot> and an MJCF <mujoco>"),
    "entities": ("<!DOCTYPE r><robot/>", "document type"),
    "mujoco loop": (
        '<mujoco><worldbody><body name="a"><joint name="1"/></body></worldbody><equality>'
        '<connect body1="a" anchor="0 0 0"/></equality></mujoco>',
        "<connect> ties bodies 'a' and 'world'",
    ),
    "mujoco free": (
        '<mujoco><worldbody><body name="a"><freejoint/></body></worldbody></mujoco>',
        "body 'a' has a <freejoint>",
    ),
    "mujoco ball": (
        '<mujoco><worldbody><body name="a"><joint name="1" type="ball"/></body></worldbody>'
        "</mujoco>",
        "joint '1' of the chain is of type 'ball'",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_what_is_no_serial_chain_is_refused_in_one_sentence(what: str, tmp_path: Path) -> None:
    text, message = REFUSED[what]
    with pytest.raises(InputError, match=message) as caught:
        read(text, tmp_path)
    assert "\n" not in str(caught.value) and "robot.urdf" in str(caught.value)


def test_a_tip_in_a_ring_of_its_own_is_refused(tmp_path: Path) -> None:
    ring = joint("2", "c", "d"), joint("3", "d", "c")
    with pytest.raises(InputError, match="link 'c' does not hang on 'a'"):
        read(robot(TWO, link("d"), joint("1", "a", "b"), *ring), tmp_path, tip="c")


def test_one_limit_alone_leaves_the_other_at_0(tmp_path: Path) -> None:
    for key, lower, upper in (("upper", 0.0, 1.5), ("lower", -1.5, 0.0)):
        value = upper if key == "upper" else lower
        inside = f'<limit {key}="{value}" effort="1"/>'
        arm = read(robot(link("a"), link("b"), joint("1", "a", "b", inside=inside)), tmp_path)
        assert (arm.joints[0].lower, arm.joints[0].upper) == (lower, upper)
    bare = joint("1", "a", "b", inside='<limit effort="1"/>')  # many files say no position
    assert read(robot(link("a"), link("b"), bare), tmp_path).joints[0].upper == np.inf


def test_names_with_quotes_and_line_breaks_make_a_device_file(tmp_path: Path) -> None:
    odd = joint("j&#10;value = 1 &quot;", "a", "b")
    arm = read(robot(link("a"), link("b"), odd), tmp_path)
    assert len(tomllib.loads(device.text(arm, 'a "robot".urdf'))["mass"]["value"]) == 1


def test_links_without_mass_are_told_and_real_bodies_are_not(tmp_path: Path) -> None:
    arm = read(robot(link("a"), '<link name="b"/>', joint("1", "a", "b")), tmp_path)
    assert arm.massless() == "1"
    assert arm.notes[0] == "link 'b' has no <inertial>: it counts as massless"
    whole = read(robot(link("a"), link("b"), joint("1", "a", "b")), tmp_path)
    assert whole.massless() == ""
    flat = robot(link("a"), link("b").replace('izz="1"', 'izz="5"'), joint("1", "a", "b"))
    assert any("belong to no real body" in note for note in read(flat, tmp_path).notes)
    assert not any("no real body" in note for note in whole.notes)
