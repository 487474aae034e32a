"""What holds at any state: energy is conserved, absent effects are absent, nothing is NaN."""

from __future__ import annotations

import numpy as np
import pytest

from sources.function import Functions, Oracle
from sources.model import Declared
from tests.support import oracle_of

pytestmark = pytest.mark.slow

FIDELITIES = [
    *(f"wheel_contact/{name}" for name in ("rolling", "creep", "stick_slip", "spatial", "brush")),
    *(f"caster/{name}" for name in ("point", "swivel", "creep")),
    "mobile_base/kinematic",
    "mobile_base/planar",
    "mobile_base/planar[wheel_contact=brush,caster=creep]",
    "mobile_base.lab/planar[wheel_contact=creep,caster=creep]",
    "mobile_base/planar[wheel_contact=rolling,caster=point]",
    "mobile_base/six_dof",
    "mobile_base/six_dof[wheel_contact=brush]",
    "mobile_base.lab/sprung[wheel_contact=creep,caster=creep]",
    "mobile_base/sprung",
    "base_body/planar",
    "base_body.lab/planar",
]
ON_WHEELS = [
    "bearing_drag",
    "rolling_resistance",
    "pivot_torque",
    "low_friction_patch",
    "wheel_runout",
    "radius_offset",
    "toe_angle",
]
ON_BODIES = ["floor_slope", "cable_force", "payload", "body_drag", "turning_friction"]
EFFECTS = [
    *(f"wheel_contact/spatial+{name}" for name in (*ON_WHEELS, "coulomb", "bristle")),
    *(f"wheel_contact/brush+{name}" for name in ON_WHEELS),
    *(f"wheel_contact/{name}+creepage" for name in ("creep", "rolling")),
    *(f"caster/swivel+{name}" for name in ON_WHEELS[:4]),
    *(f"caster/creep+{name}@swivel" for name in ("coulomb", "stribeck", "bristle")),
    *(f"mobile_base/planar+{name}" for name in (*ON_BODIES, "load_shift", "wheel_runout")),
    *(f"mobile_base/six_dof+{name}" for name in (*ON_BODIES, "load_shift", "wheel_runout")),
    "base_body/planar+payload",
    "base_body/planar+load_shift+cable_force",
    "mobile_base/sprung+payload",
    "mobile_base/sprung+floor_slope",
    "mobile_base/planar+pivot_torque@caster.floor+pivot_torque@drive_wheel.floor",
    "mobile_base/planar+coulomb@caster.swivel+rolling_resistance@caster.axle",
    "mobile_base/six_dof+coulomb@caster_fl.swivel+toe_angle@left.toe",
]


def random_values(oracle: Oracle, rng: np.random.Generator) -> dict[str, float]:
    """States and inputs around their start values, in units of their nominal magnitude."""

    def drawn(v: Declared) -> float:
        return v.start + rng.normal() * (v.quantity.nominal or 1.0) / 2

    model = oracle.model
    return {v.name: drawn(v) for v in model.variables.values() if v.role in ("state", "input")}


@pytest.mark.parametrize("variant", [*FIDELITIES, *EFFECTS])
def test_energy_neither_appears_nor_vanishes(variant: str) -> None:
    oracle, rng = oracle_of(variant), np.random.default_rng(1)
    for _ in range(10):
        defect, largest = oracle.energy_defect(random_values(oracle, rng))
        # rounding; the terms inside exceed `largest` where random speeds meet 1e6 N/m
        assert abs(defect) <= 1e-12 * largest + 1e-10


@pytest.mark.parametrize("variant", FIDELITIES)
def test_a_lagging_direction_of_rolling_keeps_the_energy(variant: str) -> None:
    oracle, rng = oracle_of(variant), np.random.default_rng(3)
    lags = {v.name: 0.05 for v in oracle.model.of_role("parameter") if v.name.endswith("t_turn")}
    assert lags or "wheel_contact" not in variant
    acts = []
    for _ in range(20):
        values = random_values(oracle, rng)
        defect, largest = oracle.energy_defect({**values, **lags})
        assert abs(defect) <= 1e-12 * largest + 1e-10  # as above
        acts.append(oracle.derivatives({**values, **lags}) != oracle.derivatives(values))
    assert any(acts) == bool(lags)  # not where random heights lift the wheels


@pytest.mark.parametrize("variant", EFFECTS)
def test_effect_of_strength_0_is_absent_bit_for_bit(variant: str) -> None:
    with_effect = oracle_of(variant)
    without = oracle_of(variant.partition("+")[0])
    parameters = with_effect.model.of_role("parameter")
    absent = {v.name: 0.0 for v in parameters if v.of_effect and v.quantity.strength}
    assert absent
    rng = np.random.default_rng(2)
    values = random_values(without, rng)
    outputs, derivatives = without.outputs(values), without.derivatives(values)
    for found, expected in (
        (with_effect.outputs({**values, **absent}), outputs),
        (with_effect.derivatives({**values, **absent}), derivatives),
    ):
        assert {name: found[name] for name in expected} == expected


@pytest.mark.parametrize("variant", [*FIDELITIES, *EFFECTS])
def test_nothing_is_nan_at_rest(variant: str) -> None:
    oracle = oracle_of(variant)
    model = oracle.model
    lifted = {v.name: 0.0 for v in model.of_role("input")}
    flat = {v.name: 0.0 for v in model.of_role("state")}
    for values in ({}, lifted, {**lifted, **flat}):
        for function in (oracle.functions.jacobian, oracle.functions.outputs):
            for result in function(*oracle.arguments(values)):
                assert np.isfinite(np.asarray(result)).all()
        args = oracle.arguments(values)
        seeds = [np.ones_like(np.asarray(item, dtype=float)) for item in args]
        for result in oracle.functions.directional(*args, *seeds):
            assert np.isfinite(np.asarray(result)).all()


def test_six_dof_base_stays_cheap() -> None:
    """About 5 us per internal step ask for at most some 1500 and 10000 operations."""
    functions = Functions(oracle_of("mobile_base/six_dof").model)  # as its FMU has them
    assert functions.derivatives.n_instructions() < 1500
    assert functions.jacobian.n_instructions() < 10000
