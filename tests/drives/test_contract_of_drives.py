"""Every drive with every effect: energy closes, strength 0 is absence, nothing breaks at rest."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from sources.function import Oracle
from sources.model import Model, misfit
from sources.variant import build_model, components, device_values, devices, effects, fidelities
from tests.support import oracle_of

pytestmark = pytest.mark.slow

COMPONENTS = ("dc_motor", "gearbox", "inertia")
PLAIN = [f"{c}/{f}" for c in COMPONENTS for f in fidelities(c)]


def variants() -> list[str]:
    """Every fidelity with every effect at every balance that takes it."""
    found = []
    for plain in PLAIN:
        for balance in oracle_of(plain).model.balances.values():
            for effect, module in effects().items():
                if not misfit(module.EFFECT, balance):
                    found.append(f"{plain}+{effect}@{balance.name}")
    return found


WITH_EFFECT = variants()
DISSIPATIVE = {
    "asymmetric_coulomb",
    "battery_sag",
    "bristle",
    "brush_drop",
    "coulomb",
    "hysteresis",
    "load_friction",
    "quadratic_drag",
    "stribeck",
    "temperature_drift",
    "viscous",
    "winding_heating",
}


def random_point(model: Model, rng: np.random.Generator) -> dict[str, float]:
    """States, sampled values and inputs of their usual size; parameters at their start."""
    point = {}
    for variable in model.variables.values():
        if variable.role in ("state", "discrete", "input"):
            size = variable.quantity.nominal or 1.0
            low, high = variable.quantity.minimum, variable.quantity.maximum
            value = size * float(rng.normal())
            value = max(value, low) if low is not None else value
            point[variable.name] = min(value, high) if high is not None else value
    return point


@pytest.mark.parametrize("name", PLAIN + WITH_EFFECT)
def test_energy_balance_closes(name: str) -> None:
    oracle, rng = oracle_of(name), np.random.default_rng(1)
    for _ in range(20):
        point = random_point(oracle.model, rng)
        defect, largest = oracle.energy_defect(point)
        # an identity: some ten operations of 1e-16, on terms that cancel by up to 1000
        assert abs(defect) <= 1e-12 * max(largest, 1.0), point


def ticks(oracle: Oracle) -> dict[str, Callable[[dict[str, float]], dict[str, float]]]:
    """The clocks' updates by name, as functions from named values to sampled values."""
    names = [v.name for v in oracle.model.of_role("discrete")]

    def named(update: ca.Function) -> Callable[[dict[str, float]], dict[str, float]]:
        def tick(point: dict[str, float]) -> dict[str, float]:
            own = {key: point[key] for key in point if key in oracle.model.variables}
            after = np.asarray(update(*oracle.arguments(own))).ravel()
            return dict(zip(names, after.tolist(), strict=True))

        return tick

    clocks = oracle.model.clocks
    return {c.name: named(f) for c, f in zip(clocks, oracle.functions.updates, strict=True)}


@pytest.mark.parametrize("name", WITH_EFFECT)
def test_strength_0_is_absence_bit_for_bit(name: str) -> None:
    oracle, plain = oracle_of(name), oracle_of(name.partition("+")[0])
    rng = np.random.default_rng(2)
    parameters = oracle.model.of_role("parameter")
    absent = {v.name: 0.0 for v in parameters if v.of_effect and v.quantity.strength}
    assert absent
    for _ in range(10):
        point = random_point(oracle.model, rng)
        own = {v.name for v in plain.model.variables.values()}
        shared = {key: value for key, value in point.items() if key in own}
        for method in ("outputs", "derivatives"):
            full = getattr(oracle, method)({**point, **absent})
            bare = getattr(plain, method)(shared)
            assert {key: full[key] for key in bare} == bare
    full_ticks, bare_ticks = (ticks(o) for o in (oracle, plain))
    for clock, tick in bare_ticks.items():
        after = tick({**point, **absent})
        before = full_ticks[clock]({**point, **absent})
        assert {key: before[key] for key in after} == after


@pytest.mark.parametrize("name", PLAIN + WITH_EFFECT)
def test_everything_is_finite_at_rest(name: str) -> None:
    """Values and all derivatives, also with respect to the parameters."""
    oracle = oracle_of(name)
    arguments = oracle.arguments()
    functions = oracle.functions
    results = [*functions.outputs(*arguments), *functions.jacobian(*arguments)]
    for index, argument in enumerate(arguments):
        for element in range(np.size(argument)):
            seeds = [np.zeros_like(np.atleast_1d(a), dtype=float) for a in arguments]
            seeds[index][element] = 1.0
            results += functions.directional(*arguments, *seeds)
    for result in results:
        assert np.all(np.isfinite(np.asarray(result)))


@pytest.mark.parametrize(
    "name", [n for n in WITH_EFFECT if n.partition("+")[2].partition("@")[0] in DISSIPATIVE]
)
def test_friction_and_resistance_never_give_power(name: str) -> None:
    oracle, rng = oracle_of(name), np.random.default_rng(3)
    effect, _, balance = name.partition("+")[2].partition("@")
    seen = 0.0
    for _ in range(200):
        point = random_point(oracle.model, rng)
        # a warmth beyond 1 or a negative mean loss lies outside what the equations can reach
        reach = {"temperature_drift": (".h", 0, 1), "winding_heating": (".p", 0, np.inf)}
        if effect in reach:
            suffix, low, high = reach[effect]
            key = f"{balance}.{effect}{suffix}"
            point[key] = float(np.clip(point[key], low, high))
        loss = oracle.outputs(point)[f"{balance}.{effect}.P_loss"]
        assert loss >= 0.0, point
        seen = max(seen, loss)
    assert seen > 0.0


def test_every_effect_made_for_drives_finds_a_place() -> None:
    used = {name.partition("+")[2].partition("@")[0] for name in WITH_EFFECT}
    made = DISSIPATIVE | {"backlash", "cogging", "cubic_stiffness", "current_gain"}
    made |= {"current_offset", "mesh_ripple", "pwm_dead_zone", "torque_constant_saturation"}
    made |= {"torque_ripple", "unbalance"}
    assert made <= used


@pytest.mark.parametrize("component", COMPONENTS)
def test_fidelities_can_be_swapped(component: str) -> None:
    """Same inputs, and the outputs of the simplest fidelity everywhere."""
    models = [oracle_of(f"{component}/{fidelity}").model for fidelity in fidelities(component)]
    inputs = [{v.name for v in m.of_role("input")} for m in models]
    outputs = [{v.name for v in m.of_role("output")} for m in models]
    assert all(names == inputs[0] for names in inputs)
    assert all(outputs[0] <= names for names in outputs)
    promised = {q.name for port in components()[component].ports for q in (port.effort, port.flow)}
    assert promised <= inputs[0] | outputs[0]


@pytest.mark.parametrize("component", COMPONENTS)
def test_device_values_all_belong_to_some_fidelity(component: str) -> None:
    declared = {
        v.quantity.name
        for f in fidelities(component)
        for v in oracle_of(f"{component}/{f}").model.variables.values()
    }
    for device in devices(component):
        assert set(device_values(component, device)) <= declared
        for fidelity in fidelities(component):
            build_model(f"{component}.{device}/{fidelity}")  # checks the units
