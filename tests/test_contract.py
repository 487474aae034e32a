"""What every FMU of the catalogue promises, checked over all of them through fmpy."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest

from cosim.fmu.check import check
from sources.function import Oracle
from sources.model import Role
from sources.variant import components, parse_name
from tests.fmus import Slave, catalogue, fmu
from tests.support import oracle_of

pytestmark = pytest.mark.slow

NAMES = catalogue()
PLAIN = [name for name in NAMES if "+" not in name]
WITH_EFFECT = [name for name in NAMES if "+" in name]
H = 1e-3


def exercise(slave: Slave, seed: int) -> dict[str, float]:
    """Inputs of their nominal magnitude, off the symmetric points where errors hide."""
    rng = np.random.default_rng(seed)
    return {
        v.name: float(v.start) + rng.uniform(0.2, 0.8) * ((v.nominal and float(v.nominal)) or 0.1)
        for v in slave.inputs
    }


def run(slave: Slave, steps: int = 12, *, first: int = 0, seed: int = 1) -> np.ndarray:
    """Outputs over communication steps, inputs changing on the way."""
    outputs = slave.names("output")
    rows = []
    for k in range(first, first + steps):
        slave.set(exercise(slave, seed + k // 5))
        slave.step(k * H, H)
        rows.append(slave.get(outputs))
    return np.array(rows)


@pytest.fixture(params=["native", "python"])
def kind(request: pytest.FixtureRequest) -> Iterator[str]:
    yield request.param


@pytest.mark.parametrize("name", NAMES)
def test_check_finds_no_problem(name: str, kind: str) -> None:
    assert check(fmu(name, kind)) == []
    if kind == "native" and name in PLAIN:
        assert check(fmu(name, kind, 3)) == []


@pytest.mark.parametrize("name", NAMES)
def test_native_is_python(name: str) -> None:
    # same operations in the same order, same C library: not one bit may differ
    with Slave(fmu(name)) as native, Slave(fmu(name, "python")) as python:
        np.testing.assert_array_equal(run(native), run(python))


@pytest.mark.parametrize("name", PLAIN)
def test_fmi_3_is_fmi_2(name: str) -> None:
    # an effect changes the equations, which both versions include as they are
    with Slave(fmu(name)) as two, Slave(fmu(name, fmi=3)) as three:
        np.testing.assert_array_equal(run(two), run(three))


@pytest.mark.parametrize("name", NAMES)
def test_reset_is_fresh_and_instances_are_independent(name: str, kind: str) -> None:
    path = fmu(name, kind)
    with Slave(path) as one, Slave(path) as other:
        expected = run(one)
        run(other, seed=7)
        one.fmu.reset()
        one.initialize()
        run(other, first=12, seed=9)
        np.testing.assert_array_equal(run(one), expected)


@pytest.mark.parametrize("name", NAMES)
def test_saved_state_restores_exactly(name: str, kind: str) -> None:
    path = fmu(name, kind)
    with Slave(path) as slave, Slave(path) as other:
        run(slave, 6)
        state = slave.fmu.getFMUState()
        expected = run(slave, 6, first=6)
        slave.fmu.setFMUState(state)
        np.testing.assert_array_equal(run(slave, 6, first=6), expected)
        saved = slave.fmu.serializeFMUState(state)
        run(other, 3)
        other.fmu.setFMUState(other.fmu.deSerializeFMUstate(saved))
        np.testing.assert_array_equal(run(other, 6, first=6), expected)
        slave.fmu.freeFMUState(state)


@pytest.mark.parametrize("name", NAMES)
def test_directional_derivatives_are_difference_quotients(name: str) -> None:
    """Along a random direction of inputs, states and parameters at once.

    A central difference errs by truncation (sharp laws) or by rounding, depending on its
    step, so the best of six steps counts. 1e-6 of the largest terms is what the best step reaches
    with margin (rounding 1e-16 over a step of 1e-6, times cancellation); a wrong formula errs by 1.
    """
    oracle = oracle_of(name)
    rng = np.random.default_rng(3)
    with Slave(fmu(name)) as slave:
        values = exercise(slave, 3)
        point = oracle.arguments(_random_point(oracle, slave, 3), 0.1)
        sizes = [_magnitudes(oracle, role) for role in ("state", "discrete", "input", "parameter")]
        seeds = [np.zeros(1)]
        for place, size in zip(point[1:], sizes, strict=True):
            seeds.append(rng.normal(size=size.size) * (np.abs(place) + 0.1 * size))
        exact = _flat(oracle.functions.directional(*point, *seeds))
        size = np.abs(exact) + np.abs(_flat(oracle.functions.outputs(*point))) + 1e-6
        best = np.full(exact.size, np.inf)
        for step in np.logspace(-3, -8, 6):
            plus, minus = (
                _flat(
                    oracle.functions.outputs(
                        *(a + sign * step * d for a, d in zip(point, seeds, strict=True))
                    )
                )
                for sign in (1, -1)
            )
            best = np.minimum(best, np.abs(exact - (plus - minus) / (2 * step)) / size)
        np.testing.assert_array_less(best, 1e-6)
        # and the FMU gives what the oracle gives
        inputs, outputs = slave.names("input"), slave.names("output")
        if inputs and outputs:
            slave.set(values)
            direction = rng.normal(size=len(inputs))
            got = slave.fmu.getDirectionalDerivative(
                [slave.vr[n] for n in outputs], [slave.vr[n] for n in inputs], list(direction)
            )
            start = oracle.arguments(values)
            seeds = [np.zeros_like(np.atleast_1d(a)) for a in start]
            seeds[3] = direction
            _, expected = oracle.functions.directional(*start, *seeds)
            # the same operations; only the C library's transcendental functions may round apart,
            # and what is left of terms as large as the largest output has their last digit (1e-16)
            wanted = np.asarray(expected).ravel()
            least = max(1e-16 * float(np.abs(wanted).max()), 1e-300)
            np.testing.assert_allclose(got, wanted, rtol=1e-12, atol=least)


def _magnitudes(oracle: Oracle, role: Role) -> np.ndarray:
    """Nominal magnitudes; without one, that of the start value, else 1."""
    return np.array([v.quantity.nominal or abs(v.start) or 1.0 for v in oracle.model.of_role(role)])


def _flat(results: object) -> np.ndarray:
    return np.concatenate([np.asarray(r).ravel() for r in results])  # type: ignore[attr-defined]


def _random_point(oracle: Oracle, slave: Slave, seed: int) -> dict[str, float]:
    rng = np.random.default_rng(seed)
    values: dict[str, float] = exercise(slave, seed)
    for variable in oracle.model.of_role("state") + oracle.model.of_role("discrete"):
        magnitude = variable.quantity.nominal or 0.1
        values[variable.name] = variable.start + 0.3 * magnitude * float(rng.normal())
    return values


@pytest.mark.parametrize("name", [n for n in NAMES if components()[parse_name(n).component].energy])
def test_energy_balance_closes(name: str) -> None:
    """dE/dt = P_in - P_loss at random states; an identity, so only rounding may remain."""
    oracle = oracle_of(name)
    with Slave(fmu(name)) as slave:
        for seed in range(20):
            defect, largest = oracle.energy_defect(_random_point(oracle, slave, seed))
            # 1e-9 of the largest single term inside: sums of hundreds of terms that cancel
            assert abs(defect) <= 1e-9 * max(largest, 1e-6), (
                f"seed {seed}: {defect:g} W of {largest:g} W are missing; what a law dissipates is "
                "told by e.loss or m.loss, what it stores by energy"
            )


@pytest.mark.parametrize("name", WITH_EFFECT)
def test_strength_0_is_absence(name: str) -> None:
    model = oracle_of(name).model
    strengths = [v.name for v in model.of_role("parameter") if v.of_effect and v.quantity.strength]
    assert strengths, "an effect without a strength"
    absent = dict.fromkeys(strengths, 0.0)
    with Slave(fmu(name), absent) as null, Slave(fmu(name.split("+")[0])) as base:
        shared = base.names("output")
        full, plain = run(null), run(base)
        columns = [null.names("output").index(output) for output in shared]
        np.testing.assert_array_equal(full[:, columns], plain)


@pytest.mark.parametrize("name", WITH_EFFECT)
def test_effect_has_an_effect(name: str) -> None:
    """The negative twin: with its default strength, 60 ms of motion or a random state differ."""
    model = oracle_of(name).model
    strengths = [v for v in model.of_role("parameter") if v.of_effect and v.quantity.strength]
    absent = dict.fromkeys((v.name for v in strengths), 0.0)
    with Slave(fmu(name)) as on, Slave(fmu(name), absent) as off:
        if not np.array_equal(run(on, 60), run(off, 60)):
            return
        oracle = oracle_of(name)
        differs = False
        for seed in range(8):
            nearer = 10.0 ** -(seed % 4)  # some effects live close to standstill
            nearer *= 1.0 if seed < 4 else -1.0  # some act in one direction
            point = {k: v * nearer for k, v in _random_point(oracle, on, seed).items()}
            present, null = oracle.outputs(point, 0.01 * seed), oracle.outputs({**point, **absent})
            differs |= any(present[k] != null[k] for k in present)
        assert differs


def _at_20_ms(name: str, cuts: list[float], shrink: float = 1.0) -> np.ndarray:
    path = fmu(name)
    with Slave(path, initialize=False) as slave:
        values = {}
        if "solver.step" in slave.vr:
            step = oracle_of(name).model.solver.step
            values["solver.step"] = min(step, cuts[1] - cuts[0]) * shrink
        slave.initialize(values)
        slave.set(exercise(slave, 5))
        for left, right in pairwise(cuts):
            slave.step(left, right - left)
        return slave.get(slave.names("output"))


@pytest.mark.parametrize("name", PLAIN)
def test_result_does_not_depend_on_how_an_interval_is_cut(name: str) -> None:
    """Inputs held: 20 ms in one piece, in equal and in unequal pieces.

    Cuts that do not fall on internal steps change those and with them the solver's error. So the
    measure is that error, estimated by halving the internal step: pieces may differ by a few times
    as much, of each output or of the state as a whole. A tick lost or doubled at a cut, or a state
    not carried over, shows as more. The internal step is an eighth of the default one, because the
    estimate holds only where the solver has begun to converge. Rounding is that of sums of the
    largest output, 1e-12 of it.
    """
    whole = _at_20_ms(name, [0.0, 0.02], 1 / 8)
    error = np.abs(whole - _at_20_ms(name, [0.0, 0.02], 1 / 16))
    scale = np.abs(whole) + 1e-12
    bound = 4 * np.maximum(error, (error / scale).max(initial=0.0) * scale) + 1e-9 * scale
    bound += 1e-12 * np.abs(whole).max(initial=0.0)
    for cuts in ([0.0, 0.01, 0.02], [0.0, 0.0037, 0.0041, 0.0163, 0.02]):
        np.testing.assert_array_less(np.abs(_at_20_ms(name, cuts, 1 / 8) - whole), bound)


@pytest.mark.parametrize("name", PLAIN)
def test_nan_is_refused_by_name(name: str, kind: str) -> None:
    with Slave(fmu(name, kind)) as slave:
        inputs = slave.names("input")
        if not inputs:
            inputs = slave.names("parameter")
        with pytest.raises(Exception, match=r"status [34]"):
            slave.set({inputs[0]: float("nan")})
        text = " ".join(slave.messages)
        assert inputs[0] in text and "time" in text and "nan" in text


@pytest.mark.parametrize("name", PLAIN)
def test_parameter_out_of_bounds_is_refused(name: str, kind: str) -> None:
    with Slave(fmu(name, kind), initialize=False) as slave:
        bounded = [
            v
            for v in slave.description.modelVariables
            if v.causality == "parameter" and v.min is not None and v.type == "Real"
        ]
        if not bounded:
            assert not oracle_of(name).model.of_role("state")
            return
        variable = bounded[0]
        with pytest.raises(Exception, match=r"status [34]"):
            slave.set({variable.name: float(variable.min) - 1.0})
        assert any(variable.name in text and "outside" in text for text in slave.messages)


@pytest.mark.parametrize("name", PLAIN[:1])
def test_wrong_token_is_refused(name: str) -> None:
    with pytest.raises(Exception, match="instantiate"):
        Slave(fmu(name), token="{00000000-0000-0000-0000-000000000000}")


@pytest.mark.parametrize("name", PLAIN[:3])
def test_zero_length_calls_are_legal(name: str) -> None:
    with Slave(fmu(name)) as slave:
        library = slave.fmu
        for function in (
            library.fmi2GetReal,
            library.fmi2SetReal,
            library.fmi2GetInteger,
            library.fmi2SetInteger,
            library.fmi2GetBoolean,
            library.fmi2SetBoolean,
            library.fmi2GetString,
            library.fmi2SetString,
        ):
            function(library.component, None, 0, None)
