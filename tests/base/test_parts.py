"""The base in parts: body, wheels and casters of their own are the equations of the packed base."""

from __future__ import annotations

import numpy as np
import pytest

from sources.base_body import MOUNTS
from sources.function import Oracle
from tests.support import oracle_of

Values = dict[str, float]
CASES = [
    # drive wheel, caster, what is added to the body
    ("wheel_contact/stick_slip", "caster/swivel", ""),
    ("wheel_contact/brush", "caster/creep", ""),
    ("wheel_contact.lab/creep+creepage", "caster.lab/creep+coulomb@swivel", "+payload"),
    ("wheel_contact/rolling", "caster/point", "+floor_slope+load_shift"),
]
PACKED = [
    "mobile_base/planar",
    "mobile_base/planar[wheel_contact=brush,caster=creep]",
    "mobile_base.lab/planar[wheel_contact=creep,caster=creep]"
    "+creepage+coulomb@caster.swivel+payload",
    "mobile_base/planar[wheel_contact=rolling,caster=point]+floor_slope+load_shift",
]


def strong(oracle: Oracle, given: Values) -> Values:
    """Parameters of effects as `given` by their own names, whatever they are called in a part."""
    effects = [v.name for v in oracle.model.of_role("parameter") if v.of_effect]
    return {name: given[name.rpartition(".")[2]] for name in effects}


class Parts:
    """Body, wheels and casters, put together by hand as `mir250_parts` connects them.

    Attributes:
        passed: outputs of the wheels that the body takes.
    """

    passed = ("f_x", "f_y", "m_z", "mass", "relief[1]", "relief[2]", "relief[3]")

    def __init__(self, wheel: str, caster: str, added: str) -> None:
        device = ".lab" if ".lab" in wheel else ""
        self.body = oracle_of(f"base_body{device}/planar{added}")
        kinds = {False: oracle_of(wheel), True: oracle_of(caster)}
        self.wheels = {mount.name: kinds[mount.caster] for mount in MOUNTS}

    def __call__(self, state: Values, inputs: Values, given: Values) -> tuple[Values, Values]:
        """Derivatives, and energy with the losses, of the whole."""
        own = {n: state[n] for n in self.body.state_names} | strong(self.body, given)
        own |= {n: v for n, v in inputs.items() if n.startswith("arm")}
        masses = {
            f"{name}_mass": oracle.outputs({})["mass"]
            for name, oracle in self.wheels.items()
            if name.startswith("caster")
        }
        moved = self.body.outputs({**own, **masses})
        taken, rates, sums = {**own, **masses}, {}, {"E_stored": 0.0, "P_loss": 0.0}
        for name, oracle in self.wheels.items():
            u = {key: moved[f"{name}_{key}"] for key in ("v_x", "v_y", "f_n", "x_w", "y_w")}
            u["w_z"] = moved["w_z"]
            if name in ("left", "right"):
                u |= {"tau": inputs[f"tau_{name[0]}"], "J_added": inputs[f"J_{name[0]}"]}
            values = u | {n: state[f"{name}.{n}"] for n in oracle.state_names}
            values |= strong(oracle, given)
            y = oracle.outputs(values)
            taken |= {f"{name}_{key}": y[key] for key in self.passed if key in y}
            rates |= {f"{name}.{n}": v for n, v in oracle.derivatives(values).items()}
            sums = {key: total + y[key] for key, total in sums.items()}
        y = self.body.outputs(taken)
        return rates | self.body.derivatives(taken), {k: v + y[k] for k, v in sums.items()}


@pytest.mark.parametrize(("parts", "packed"), list(zip(CASES, PACKED, strict=True)))
def test_the_parts_move_as_the_packed_base_at_any_state(
    parts: tuple[str, str, str], packed: str
) -> None:
    whole, apart, rng = oracle_of(packed), Parts(*parts), np.random.default_rng(4)
    own = [v for v in whole.model.of_role("parameter") if v.of_effect]
    given = {v.name.rpartition(".")[2]: v.start + rng.uniform(0.1, 0.3) for v in own}
    for _ in range(5):
        state = {n: rng.normal() * 0.3 for n in whole.state_names}
        inputs = {"tau_l": 3.0, "tau_r": -2.0, "J_l": 0.2, "J_r": 0.1}
        values = {**state, **inputs, **strong(whole, given)}
        rates, sums = apart(state, inputs, given)
        expected, y = whole.derivatives(values), whole.outputs(values)
        assert set(rates) == set(expected)
        for name, value in expected.items():
            # rounding: forces of 1e5 N cancel where random slip meets stiff contacts
            assert rates[name] == pytest.approx(value, rel=1e-9, abs=1e-9), name
        assert sums["E_stored"] == pytest.approx(y["E_stored"], rel=1e-12)
        assert sums["P_loss"] == pytest.approx(y["P_loss"], rel=1e-9)


def test_what_a_caster_leaves_to_the_body_is_needed() -> None:
    """The twin of the above: without `relief` the base is heavier than it is."""
    apart, rng = Parts(*CASES[0]), np.random.default_rng(4)
    whole = oracle_of(PACKED[0])
    state = {n: rng.normal() * 0.3 for n in whole.state_names}
    inputs = {"tau_l": 3.0, "tau_r": -2.0, "J_l": 0.2, "J_r": 0.1}
    apart.passed = ("f_x", "f_y", "m_z", "mass")
    expected = whole.derivatives({**state, **inputs})["vel_x"]
    # four forks take off up to 0.2 kg each of 98 kg
    assert abs(apart(state, inputs, {})[0]["vel_x"] / expected - 1.0) > 1e-3
