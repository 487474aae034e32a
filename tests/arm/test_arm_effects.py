"""What single effects do to arm and drive, against first principles or pinocchio."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from sources.effect import Effect
from sources.effect_model import EffectModel
from sources.function import Oracle
from sources.model import Attachment, Model
from sources.quantity import Quantity
from sources.variant import build_model, device_values, fidelity
from tests.arm.chains import Reference, named, vector
from tests.support import oracle_of

pytestmark = pytest.mark.slow

Q = np.array([0.3, -1.1, 1.4, -0.8, 0.6, -0.4])
QD = np.array([0.5, -0.4, 0.3, 0.2, -0.6, 0.7])
ROTOR = np.array([1.02, 1.02, 1.02, 0.2, 0.2, 0.2])


@lru_cache(maxsize=None)
def oracle(variant: str) -> Oracle:
    return oracle_of(variant)


def accelerations(variant: str, **more: float) -> np.ndarray:
    values = named(angle=Q, speed=QD, J_added=ROTOR) | more
    return vector(oracle(variant).derivatives(values), "speed")


def test_base_tilt_is_a_turned_mount() -> None:
    """Gravity in the arm's axes, as if the mount were turned about the same axis."""
    tilt, heading = 0.07, 0.8
    axis = np.array([np.cos(heading), np.sin(heading), 0])
    quaternion = Rotation.from_rotvec(tilt * axis).as_quat(scalar_first=True)
    tilted = accelerations(
        "ur5_arm/rigid+base_tilt", **{"base_tilt.tilt": tilt, "base_tilt.heading": heading}
    )
    turned = accelerations("ur5_arm/rigid", **named(mount_quaternion=quaternion))
    np.testing.assert_allclose(tilted, turned, rtol=0, atol=1e-12)  # rounding
    level = accelerations("ur5_arm/rigid")
    assert np.abs(tilted - level).max() > 0.1


def test_hose_pulls_at_its_joint() -> None:
    pulled = named(J_added=np.full(6, 1e9))  # rotors so heavy that torque is J times acceleration
    values = named(angle=Q) | pulled
    name = "ur5_arm/rigid+hose_spring@joint_2"
    difference = 1e9 * (
        vector(oracle(name).derivatives(values | {"joint_2.hose_spring.theta_0": 0.5}), "speed")
        - vector(oracle("ur5_arm/rigid").derivatives(values), "speed")
    )
    expected = np.array([0, -2.0 * (Q[1] - 0.5), 0, 0, 0, 0])
    np.testing.assert_allclose(difference, expected, rtol=0, atol=1e-6)  # 1e9 times rounding


def test_harmonic_ripple_has_two_cycles_per_motor_turn() -> None:
    drive = oracle("ur5_drive/sampled+harmonic_ripple@joint_3")
    q = np.linspace(0, 2 * np.pi / 101, 65)  # one turn of the motor
    torque = np.array([drive.outputs(named(q=[0, 0, x, 0, 0, 0]))["tau[3]"] for x in q])
    np.testing.assert_allclose(torque[0], torque[32], rtol=0, atol=1e-12)  # rounding
    spectrum = np.abs(np.fft.rfft(torque[:-1])) / 32
    assert np.argmax(spectrum) == 2
    assert spectrum[2] == pytest.approx(1.0, rel=1e-9)  # one line: no leakage
    drive_2 = oracle("ur5_drive/sampled").outputs(named(q=Q))
    rippled = drive.outputs(named(q=Q))
    assert all(rippled[f"tau[{k}]"] == drive_2[f"tau[{k}]"] for k in (1, 2, 4, 5, 6))


def test_encoder_offset_moves_what_the_servo_believes() -> None:
    offset = 0.01
    wrong = oracle("ur5_drive/perfect+encoder_offset@encoder_4").outputs(
        named(q_set=Q, q=Q) | {"encoder_4.encoder_offset.offset": offset}
    )
    moved = Q.copy()
    moved[3] += offset
    right = oracle("ur5_drive/perfect").outputs(named(q_set=Q, q=moved))
    np.testing.assert_array_equal(vector(wrong, "tau"), vector(right, "tau"))
    assert wrong["q_measured[4]"] == moved[3]


MASS, PLACE = 2.0, np.array([0.03, -0.02, 0.11])
INERTIA = np.array([[0.02, 0.001, -0.002], [0.001, 0.03, 0.003], [-0.002, 0.003, 0.01]])
PULL = np.array([5.0, -3.0, 2.0, 0.4, -0.3, 0.2])
STRENGTH = Quantity("strength", "1", "test", start=1.0, strength=True)


def with_tool(law: object) -> Oracle:
    """`rigid_moving` of the UR5 with a law of the test on its tool."""
    component, equations = fidelity("ur5_arm", "rigid_moving")
    effect = Effect("test", "test", ("body",), STRENGTH)
    model = Model(
        component,
        "rigid_moving",
        values={k: v.value for k, v in device_values("ur5_arm", "ur5").items()},
        attachments=(Attachment(effect, law, "tool"),),  # type: ignore[arg-type]
    )
    equations(model)
    return Oracle(model.finish())


def point(seed: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {
        "angle": rng.uniform(-3, 3, 6),
        "speed": rng.normal(size=6),
        "tau": 20 * rng.normal(size=6),
        "J_added": ROTOR,
        "mount_rate": rng.normal(size=3),
        "mount_acceleration": rng.normal(size=3),
        "mount_angular_acceleration": rng.normal(size=3),
    }


def test_load_on_the_tool() -> None:
    """Extended rigid load: the same body in pinocchio."""

    def law(e: EffectModel) -> None:
        e.add_mass(MASS * e.parameter(STRENGTH), ca.DM(PLACE), ca.DM(INERTIA))
        e.loss(0)

    model, reference = with_tool(law), Reference("ur5")
    body = pin.Inertia(MASS, PLACE, INERTIA)
    flange = reference.model.frames[reference.flange]
    reference.model.appendBodyToJoint(flange.parentJoint, body, flange.placement)
    reference.data = reference.model.createData()
    for seed in range(20):
        p = point(seed)
        qdd = vector(model.derivatives(named(**p)), "speed")
        motion = np.concatenate([p["mount_acceleration"], p["mount_angular_acceleration"]])
        motion[2] += 9.81
        tau, wrench = reference.inverse(p["angle"], p["speed"], qdd, p["mount_rate"], motion)
        # relative to the largest; both in double precision
        scale = np.abs(wrench).max()
        np.testing.assert_allclose(tau + ROTOR * qdd, p["tau"], rtol=0, atol=1e-11 * scale)
        seen = vector(model.outputs(named(**p)), "wrench")
        np.testing.assert_allclose(seen, wrench, rtol=0, atol=1e-11 * scale)


def test_wrench_on_the_tool() -> None:
    """A force and moment on the flange act through the transposed Jacobian."""

    def law(e: EffectModel) -> None:
        e.add(e.parameter(STRENGTH) * ca.DM(PULL))
        e.supply(ca.dot(ca.DM(PULL), ca.vertcat(e.signal("velocity"), e.signal("rate"))))
        e.loss(0)

    model, plain, reference = with_tool(law), oracle("ur5_arm/rigid_moving"), Reference("ur5")
    for seed in range(10):
        p = point(seed)
        jacobian = pin.computeFrameJacobian(
            reference.model,
            reference.data,
            reference.configuration(p["angle"]),
            reference.flange,
            pin.ReferenceFrame.LOCAL,
        )[:, 6:]
        pushed = vector(model.derivatives(named(**p)), "speed")
        p["tau"] = p["tau"] + jacobian.T @ PULL
        expected = vector(plain.derivatives(named(**p)), "speed")
        # relative to the largest; both in double precision
        np.testing.assert_allclose(pushed, expected, rtol=0, atol=1e-11 * np.abs(expected).max())
        defect, largest = model.energy_defect(named(**p))
        assert abs(defect) < 1e-12 * (largest + 100)  # rounding


def test_unknown_place_is_explained() -> None:
    with pytest.raises(ValueError, match=r"payload.*cannot act on balance 'joint'"):
        build_model("ur5_arm/rigid+payload@joint")
    with pytest.raises(ValueError, match="fits no balance of ur5_arm/kinematic"):
        build_model("ur5_arm/kinematic+payload")


@pytest.mark.parametrize(
    "fidelity", ["rigid", "rigid_moving", "elastic", "ticked", "ticked_elastic"]
)
def test_payload_of_0_leaves_every_bit(fidelity: str) -> None:
    """Numbers that the chain folds at build time round as they do beside a mass of 0."""
    plain = oracle_of(f"ur5_arm/{fidelity}")
    loaded = oracle_of(f"ur5_arm/{fidelity}+payload")
    rng = np.random.default_rng(0)
    for _ in range(100):
        values = {
            v.name: v.start + rng.normal() * (v.quantity.nominal or 0.3)
            for role in ("input", "state")
            for v in plain.model.of_role(role)
        }
        absent = {**values, "payload.mass": 0.0}
        outputs = loaded.outputs(absent)
        assert plain.derivatives(values) == loaded.derivatives(absent)
        assert all(outputs[name] == value for name, value in plain.outputs(values).items())
