"""Energy of arm and drive closes with every effect, and effects of strength 0 are not there."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from sources.function import Oracle
from sources.model import misfit
from sources.variant import effects
from tests.arm.chains import vector
from tests.support import oracle_of

pytestmark = pytest.mark.slow

# Ways into the arm and the drive for the kinds of effects; the contract tests of the FMUs cover the
# highest fidelities.
PLAIN = [
    *(f"ur5_arm/{f}" for f in ("kinematic", "rigid", "ticked", "rigid_moving", "elastic")),
    "ur5_arm/ticked_elastic",
    "ur5_arm.ur5e/rigid_moving",
    "ur5_arm.lab/ticked",
    *(f"ur5_drive/{f}" for f in ("perfect", "servo", "servo_lossy", "sampled")),
    "ur5_drive.ur5_lab/sampled",
]
EVERY_EFFECT = ("ur5_arm/rigid_moving", "ur5_drive/sampled")
ON_TOOL = ("ur5_arm/elastic+payload", "ur5_arm.ur5e/elastic+payload", "ur5_arm/ticked+payload")
SOME = (
    "ur5_arm/kinematic+coulomb",
    "ur5_arm/rigid+hose_spring@joint_2+coulomb@joint_3+base_tilt",
    "ur5_arm/rigid_moving+hose_spring@joint_2+bristle@joint_6+harmonic_ripple+base_tilt",
    "ur5_arm/ticked+hose_spring+bristle@joint_2+coulomb",
    "ur5_arm/elastic+backlash+coulomb@joint_1+temperature_drift+base_tilt",
    "ur5_arm/ticked_elastic+payload+coulomb@joint_2",
    "ur5_arm/elastic+hysteresis+cubic_stiffness",
    "ur5_drive/perfect+coulomb+hose_spring@joint_2",
    "ur5_drive/servo+stribeck@joint_4+winding_heating@winding_2+encoder_offset@encoder_3",
    "ur5_drive/servo_lossy+load_friction+current_offset@current_sensor_5",
)


@lru_cache(maxsize=None)
def oracle(variant: str) -> Oracle:
    return oracle_of(variant)


def fitting() -> list[str]:
    names = []
    for base in EVERY_EFFECT:
        balances = oracle(base).model.balances.values()
        names += [
            f"{base}+{effect}"
            for effect, module in effects().items()
            if not all(misfit(module.EFFECT, balance) for balance in balances)
        ]
    return names


FITTING = [*fitting(), *ON_TOOL]


def random_point(model: Oracle, rng: np.random.Generator) -> dict[str, float]:
    """All variables off their start values; inertias stay positive."""
    values = {}
    for role in ("state", "discrete", "input"):
        for variable in model.model.of_role(role):
            value = variable.start + rng.normal() * (variable.quantity.nominal or 1.0)
            values[variable.name] = abs(value) if variable.quantity.name == "J_added" else value
    # what stiff springs hold together stays together
    for k in range(1, 7):
        if f"q_set[{k}]" in values:
            values[f"q_set[{k}]"] = values[f"q[{k}]"] + 1e-3 * rng.normal()
    return values


def test_effects_reach_arm_and_drive() -> None:
    """What a study of the arm needs is there; a list that shrinks would hide in the tests below."""
    arm = {"coulomb", "viscous", "stribeck", "load_friction", "temperature_drift", "bristle"}
    arm |= {"asymmetric_coulomb", "hose_spring", "harmonic_ripple"}
    for effect in arm:
        assert {f"{base}+{effect}" for base in EVERY_EFFECT} <= set(FITTING)
    assert "ur5_arm/rigid_moving+base_tilt" in FITTING
    for effect in ("encoder_offset", "winding_heating", "current_offset", "current_gain", "delay"):
        assert f"ur5_drive/sampled+{effect}" in FITTING


@pytest.mark.parametrize("variant", [*PLAIN, *SOME, *FITTING])
def test_energy_balance_closes(variant: str) -> None:
    model = oracle(variant)
    rng = np.random.default_rng(1)
    for _ in range(5):
        point = random_point(model, rng)
        defect, largest = model.energy_defect(point)
        # rounding of sums of hundreds of terms, some of which are larger than their sums
        assert abs(defect) <= 1e-12 * (largest + 100.0), (defect, largest)


@pytest.mark.parametrize("variant", FITTING)
def test_strength_0_is_absence(variant: str) -> None:
    model, plain = oracle(variant), oracle(variant.split("+")[0])
    strengths = [v for v in model.model.of_role("parameter") if v.of_effect and v.quantity.strength]
    assert strengths
    rng = np.random.default_rng(2)
    for _ in range(3):
        point = random_point(plain, rng)
        absent = point | {v.name: 0.0 for v in strengths}
        outputs, expected = model.outputs(absent, 0.3), plain.outputs(point, 0.3)
        assert {name: outputs[name] for name in expected} == expected
        rates, expected = model.derivatives(absent, 0.3), plain.derivatives(point, 0.3)
        assert {name: rates[name] for name in expected} == expected
        # the component's own clock is the last one
        after = (
            np.asarray(plain.functions.updates[-1](*plain.arguments(point))).ravel()
            if plain.functions.updates
            else np.zeros(0)
        )
        if after.size:
            updated = np.asarray(model.functions.updates[-1](*model.arguments(absent))).ravel()
            np.testing.assert_array_equal(updated[: after.size], after)


def test_moving_mount_needs_the_rates_of_its_inputs() -> None:
    """The negative twin: with the pose held while the mount moves, the balance does not close."""
    model = oracle("ur5_arm/rigid_moving")
    point = random_point(model, np.random.default_rng(3))
    defect, _ = model.energy_defect(point)
    held = Oracle(model.model)
    held._input_rates = lambda *_: np.zeros(len(held.model.of_role("input")))
    broken, largest = held.energy_defect(point)
    assert abs(defect) < 1e-12 * largest  # rounding
    assert abs(broken) > 0.01 * largest


def test_power_of_the_wrench_is_part_of_the_balance() -> None:
    model = oracle("ur5_arm/rigid_moving")
    point = random_point(model, np.random.default_rng(4))
    outputs = model.outputs(point)
    wrench = vector(outputs, "wrench")
    twist = [point[f"mount_velocity[{k}]"] for k in (1, 2, 3)]
    twist += [point[f"mount_rate[{k}]"] for k in (1, 2, 3)]
    joints = sum(point[f"tau[{k}]"] * outputs[f"qd[{k}]"] for k in range(1, 7))
    # two sums of the same products
    assert outputs["P_in"] == pytest.approx(joints + wrench @ twist, rel=1e-12)
