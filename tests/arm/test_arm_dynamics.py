"""The arm against pinocchio at random states, fixed and moving."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sources.function import Oracle
from tests.arm.chains import DEVICES, Reference, laws, named, symmetric, vector
from tests.support import oracle_of

pytestmark = pytest.mark.slow

COUNT = 1000 // len(DEVICES) + 1
RELATIVE = 1e-9  # two codes in double precision; 1e-12 is what they reach


@lru_cache(maxsize=None)
def oracle(variant: str) -> Oracle:
    return oracle_of(variant)


def close(a: np.ndarray, b: np.ndarray) -> None:
    """Equal to RELATIVE of the largest element, as elements may cancel."""
    assert np.abs(a - b).max() <= RELATIVE * np.abs(b).max()


def draw(rng: np.random.Generator) -> dict[str, np.ndarray]:
    attitude = Rotation.random(random_state=rng)
    return {
        "angle": rng.uniform(-np.pi, np.pi, 6),
        "speed": 2 * rng.normal(size=6),
        "tau": 50 * rng.normal(size=6),
        "J_added": rng.uniform(0, 1, 6),
        "mount_position": rng.normal(size=3),
        "mount_quaternion": attitude.as_quat(scalar_first=True) * rng.uniform(0.5, 2),
        "mount_velocity": rng.normal(size=3),
        "mount_rate": rng.normal(size=3),
        "mount_acceleration": 5 * rng.normal(size=3),
        "mount_angular_acceleration": 5 * rng.normal(size=3),
    }


def turn(point: dict[str, np.ndarray]) -> np.ndarray:
    return Rotation.from_quat(point["mount_quaternion"], scalar_first=True).as_matrix()


@pytest.mark.parametrize("device", DEVICES)
def test_moving_mount(device: str) -> None:
    """Joint accelerations, wrench and its split, tool pose, energy."""
    model, reference = oracle(f"ur5_arm.{device}/rigid_moving"), Reference(device)
    rng = np.random.default_rng(1)
    for _ in range(COUNT):
        p = draw(rng)
        outputs = model.outputs(named(**p))
        qdd = vector(model.derivatives(named(**p)), "speed")
        gravity = turn(p).T @ np.array([0, 0, -9.81])
        motion = np.concatenate(
            [p["mount_acceleration"] - gravity, p["mount_angular_acceleration"]]
        )
        tau, wrench = reference.inverse(p["angle"], p["speed"], qdd, p["mount_rate"], motion)
        close(tau + p["J_added"] * qdd, p["tau"])
        close(vector(outputs, "wrench"), wrench)

        # the forward direction on its own: M qdd = tau - h
        zero_tau, _ = reference.inverse(
            p["angle"], p["speed"], np.zeros(6), p["mount_rate"], motion
        )
        matrix = reference.mass_matrix(p["angle"])[6:, 6:] + np.diag(p["J_added"])
        close(qdd, np.linalg.solve(matrix, p["tau"] - zero_tau))

        # inertia and bias hold for every other acceleration of the mount, too
        other = 5 * rng.normal(size=6)
        motion = other - np.concatenate([gravity, np.zeros(3)])
        zero_tau, _ = reference.inverse(
            p["angle"], p["speed"], np.zeros(6), p["mount_rate"], motion
        )
        qdd = np.linalg.solve(matrix, p["tau"] - zero_tau)
        _, wrench = reference.inverse(p["angle"], p["speed"], qdd, p["mount_rate"], motion)
        inertia = symmetric(vector(outputs, "arm_inertia"))
        close(inertia @ other + vector(outputs, "arm_bias"), wrench)

        position, rotation = reference.tool(p["angle"])
        close(vector(outputs, "tool_position"), p["mount_position"] + turn(p) @ position)
        seen = Rotation.from_rotvec(vector(outputs, "tool_rotation")).as_matrix()
        close(seen, turn(p) @ rotation)

        twist = np.concatenate([p["mount_velocity"], p["mount_rate"]])
        kinetic = reference.kinetic_energy(p["angle"], twist, p["speed"])
        kinetic += p["J_added"] @ p["speed"] ** 2 / 2
        mass, moment, _ = (np.asarray(v) for v in laws(device)["mass"](p["angle"]))
        height = (p["mount_position"] * mass.item() + turn(p) @ moment.ravel())[2]
        assert outputs["E_stored"] == pytest.approx(kinetic + 9.81 * height, rel=RELATIVE)


@pytest.mark.parametrize("device", DEVICES)
def test_mount_at_rest(device: str) -> None:
    """`rigid` on an inclined mount at rest, with its locked-joint inertia."""
    model, reference = oracle(f"ur5_arm.{device}/rigid"), Reference(device)
    rng = np.random.default_rng(2)
    for _ in range(COUNT):
        p = draw(rng)
        outputs = model.outputs(named(**p))
        qdd = vector(model.derivatives(named(**p)), "speed")
        up = np.concatenate([turn(p).T @ np.array([0, 0, 9.81]), np.zeros(3)])
        tau, wrench = reference.inverse(p["angle"], p["speed"], qdd, np.zeros(3), up)
        close(tau + p["J_added"] * qdd, p["tau"])
        close(vector(outputs, "wrench"), wrench)
        close(vector(outputs, "arm_bias"), wrench)
        locked = reference.mass_matrix(p["angle"])[:6, :6]
        close(symmetric(vector(outputs, "arm_inertia")), locked)


@pytest.mark.parametrize("device", DEVICES)
def test_inverse_dynamics_and_mass_matrix(device: str) -> None:
    reference = Reference(device)
    rng = np.random.default_rng(3)
    for _ in range(COUNT):
        q, qd, qdd = rng.uniform(-np.pi, np.pi, 6), rng.normal(size=6), 5 * rng.normal(size=6)
        rate, motion = rng.normal(size=3), 5 * rng.normal(size=6)
        tau, wrench = laws(device)["inverse"](q, qd, qdd, rate, motion[:3], motion[3:])
        expected = np.concatenate(reference.inverse(q, qd, qdd, rate, motion))
        close(np.concatenate([np.asarray(tau).ravel(), np.asarray(wrench).ravel()]), expected)
        matrix = reference.mass_matrix(q)[6:, 6:]
        close(np.asarray(laws(device)["mass_matrix"](q)), matrix)


def test_without_motion_the_mount_may_be_called_moving() -> None:
    """`rigid` and `rigid_moving` agree where both apply."""
    rng = np.random.default_rng(4)
    p = draw(rng)
    still = {
        k: 0 * v if k.endswith(("velocity", "rate", "acceleration")) else v for k, v in p.items()
    }
    fixed = oracle("ur5_arm/rigid").derivatives(named(**still))
    moving = oracle("ur5_arm/rigid_moving").derivatives(named(**still))
    # the same algorithm, with zeros that are known or found at run time
    close(vector(fixed, "speed"), vector(moving, "speed"))


def test_elastic_gears_pass_torque_on() -> None:
    """Link side: `rigid` without rotors under the springs' torque. Gear side: the hubs."""
    rng = np.random.default_rng(5)
    p = draw(rng)
    stiffness, damping = np.full(6, 1e4), np.full(6, 3.0)
    theta, thetad = p["angle"] + 1e-3 * rng.normal(size=6), rng.normal(size=6)
    values = named(
        **{k: v for k, v in p.items() if k not in ("angle", "speed")},
        angle=theta,
        speed=thetad,
        twist=theta - p["angle"],
        twist_rate=thetad - p["speed"],
        K=stiffness,
        D=damping,
    )
    through = stiffness * (theta - p["angle"]) + damping * (thetad - p["speed"])
    rates = oracle("ur5_arm/elastic").derivatives(values | {"J_hub": 0.01})
    links = named(**p) | named(tau=through, J_added=np.zeros(6))
    rigid = oracle("ur5_arm/rigid").derivatives(links)
    close(vector(rates, "speed") - vector(rates, "twist_rate"), vector(rigid, "speed"))
    close(vector(rates, "speed"), (p["tau"] - through) / (p["J_added"] + 0.01))


def test_tick_is_a_semi_implicit_euler_step() -> None:
    rng = np.random.default_rng(6)
    p = draw(rng)
    ticked, period = oracle("ur5_arm/ticked"), 1e-3
    values = named(**p, held_speed=p["speed"]) | {"T": period}
    arguments = ticked.arguments(values)
    z = np.asarray(ticked.functions.updates[0](*arguments)).ravel()
    qdd = vector(oracle("ur5_arm/rigid").derivatives(named(**p)), "speed")
    close(z[:6], p["speed"] + period * qdd)
    arguments[2] = z
    slope = np.asarray(ticked.functions.derivatives(*arguments)).ravel()
    np.testing.assert_array_equal(slope[:6], z[:6])  # the angle runs on at the new speed


def after_a_tick(fidelity: str, period: float, **values: np.ndarray) -> np.ndarray:
    model = oracle(f"ur5_arm/{fidelity}")
    arguments = model.arguments(named(**values) | {"T": period})
    return np.asarray(model.functions.updates[0](*arguments)).ravel()


def test_ticks_of_gears_that_yield() -> None:
    """Both sides of each spring accelerate as its torque says, which is c f = x + t x'."""
    rng = np.random.default_rng(7)
    p, period = draw(rng), 1e-3
    c, t_d = rng.uniform(1e-4, 1e-3, 6), rng.uniform(1e-4, 1e-3, 6)
    twist, rate = 1e-3 * rng.normal(size=6), 0.1 * rng.normal(size=6)
    state = {**p, "angle": p["angle"] + twist, "speed": p["speed"] + rate, "twist": twist}
    state |= {"held_speed": state["speed"], "held_rate": rate, "c": c, "t_d": t_d}
    z = after_a_tick("ticked_elastic", period, **state)
    turning, twisting, new_rate = z[6:12], z[18:24], z[12:18]
    least = np.array([0.08, 0.3, 0.07, 7e-3, 3e-3, 1.3e-4])  # as the module says
    through = (twist + (t_d + period / (1 + (c * least / period**2) ** 2)) * new_rate) / c
    links = named(**p) | named(tau=through, J_added=np.zeros(6))
    rigid = vector(oracle("ur5_arm/rigid").derivatives(links), "speed")
    close(turning - twisting, rigid)
    close(p["J_added"] * turning, p["tau"] - through)


def test_ticks_of_rigid_gears_are_a_limit_of_those_that_yield() -> None:
    p, period = draw(np.random.default_rng(8)), 5e-4
    rigid = after_a_tick("ticked", period, **p, held_speed=p["speed"])
    stiff = {**p, "held_speed": p["speed"], "c": np.zeros(6)}
    # the same sums in another order
    close(after_a_tick("ticked_elastic", period, **stiff)[:12], rigid)


@pytest.mark.parametrize(
    "fidelity", ["rigid", "rigid_moving", "elastic", "ticked", "ticked_elastic", "kinematic"]
)
def test_finite_at_rest(fidelity: str) -> None:
    """Start values, zero inputs: every function and derivative is a number."""
    model = oracle(f"ur5_arm/{fidelity}")
    arguments = model.arguments()
    seeds = [np.ones(np.size(a)) for a in arguments]
    functions = model.functions
    results = [
        functions.outputs(*arguments),
        functions.jacobian(*arguments),
        functions.directional(*arguments, *seeds),
    ]
    for result in results:
        assert all(np.isfinite(np.asarray(item)).all() for item in result)


def test_dynamics_stay_cheap() -> None:
    """Numbers that are zero stay out of the code: 1343 and 2561 operations as first written."""
    functions = oracle("ur5_arm/rigid").functions
    assert functions.derivatives.n_instructions() < 1500
    assert functions.outputs.n_instructions() < 2800
