"""One instance, FMI 2 and FMI 3, through the same interface."""

from __future__ import annotations

import ctypes
import math
from pathlib import Path

import numpy as np
import pytest

from cosim.errors import FmuCallError, UnknownNameError, ValueRangeError
from cosim.fmu.instance import Instance
from cosim.spec.units import parse
from tests.fmus import Slave, fmu

BOTH = pytest.mark.parametrize("fmi", [2, 3])
MOTOR = "dc_motor/electrical"


def started(name: str, fmi: int) -> Instance:
    instance = Instance(fmu(name, "native", fmi), "x")
    instance.enter_initialization(0.0)
    instance.exit_initialization()
    return instance


@BOTH
def test_description(fmi: int) -> None:
    with Instance(fmu("gearbox/ratio", "native", fmi)) as instance:
        description = instance.description
        assert description.fmi == fmi
        tau_b = description.find("tau_b")
        assert tau_b.causality == "output" and tau_b.unit is not None
        assert tau_b.unit.exponents == parse("N.m").exponents
        assert description.dependencies["w_a"] == ("w_b",)
        assert description.dependencies["J_b"] == ()
        assert not description.assumed
        ratio = description.find("ratio")
        assert (ratio.minimum, ratio.maximum, ratio.causality) == (1e-3, 1e4, "parameter")
        port = next(port for port in description.ports if port.name == "flange_b")
        assert (port.effort, port.flow, port.sign) == (("tau_b",), ("w_b",), -1)
        assert all(description.can(what) for what in (
            "canGetAndSetFMUState", "canSerializeFMUState", "providesDirectionalDerivatives"
        ))  # fmt: skip


@BOTH
def test_same_bits_as_fmpy(fmi: int) -> None:
    path = fmu(MOTOR, "native", fmi)
    instance = started(MOTOR, fmi)
    outputs = [v.name for v in instance.description.of("output")]
    with Slave(path) as slave, instance:
        for k in range(20):
            inputs = {"w_ref": 10.0 + k, "w": 0.3 * k}
            slave.set(inputs)
            instance.set(inputs)
            slave.step(k * 1e-3, 1e-3)
            instance.step(k * 1e-3, 1e-3)
            np.testing.assert_array_equal(instance.get(*outputs), slave.get(outputs))


@BOTH
def test_save_restore_serialize(fmi: int) -> None:
    with started(MOTOR, fmi) as one, started(MOTOR, fmi) as other:
        one.set({"w_ref": 50.0})
        one.step(0.0, 1e-2)
        state = one.save()
        content = one.serialize(state)
        one.step(1e-2, 1e-2)
        expected = one.get("i", "u", "tau")
        one.restore(state)
        one.step(1e-2, 1e-2)
        np.testing.assert_array_equal(one.get("i", "u", "tau"), expected)
        one.release(state)
        moved = other.deserialize(content)
        other.restore(moved)
        other.release(moved)
        other.step(1e-2, 1e-2)
        np.testing.assert_array_equal(other.get("i", "u", "tau"), expected)


@BOTH
def test_directional_derivative(fmi: int) -> None:
    with started("gearbox/ratio", fmi) as instance:
        ratio, eta = instance.get("ratio", "eta")
        result = instance.directional_derivative(["tau_b", "w_a"], ["tau_a", "w_b"], [1.0, 2.0])
        np.testing.assert_allclose(result, [ratio * eta, 2.0 * ratio], rtol=1e-15)  # one rounding
        with pytest.raises(ValueRangeError, match="1 seeds for 2 known variables"):
            instance.directional_derivative(["tau_b"], ["tau_a", "w_b"], [1.0])


@BOTH
def test_reset_is_fresh(fmi: int) -> None:
    with started(MOTOR, fmi) as instance:
        fresh = instance.get("i", "u")
        instance.set({"w_ref": 50.0})
        instance.step(0.0, 1e-2)
        assert (instance.get("i", "u") != fresh).any()
        instance.reset()
        instance.enter_initialization(0.0)
        instance.exit_initialization()
        np.testing.assert_array_equal(instance.get("i", "u"), fresh)


@BOTH
def test_vectors_by_name(fmi: int) -> None:
    with Instance(fmu("ur5_drive/perfect", "native", fmi)) as instance:
        block = instance.block(["q_set"])
        assert block.names == tuple(f"q_set[{k}]" for k in range(1, 7))
        instance.set({"q_set": [1, 2, 3, 4, 5, 6]})
        np.testing.assert_array_equal(block.get(), [1, 2, 3, 4, 5, 6])
        with pytest.raises(ValueRangeError, match="q_set takes 6 values, but 2 are given"):
            instance.set({"q_set": [1, 2]})


@BOTH
def test_addresses_are_those_of_the_functions(fmi: int) -> None:
    with started("gearbox/ratio", fmi) as instance:
        block = instance.block(["ratio"])
        (part,) = block.parts
        name = "fmi2GetReal" if fmi == 2 else "fmi3GetFloat64"
        counts = [ctypes.c_size_t] if fmi == 3 else []
        function = ctypes.CFUNCTYPE(
            ctypes.c_int,
            ctypes.c_void_p,
            ctypes.c_void_p,
            ctypes.c_size_t,
            ctypes.c_void_p,
            *counts,
        )(instance.functions[name])
        assert function(instance.address, *part.arguments) == 0
        assert block.values[0] == instance.get("ratio")[0]


@BOTH
def test_errors_carry_what_the_fmu_said(fmi: int) -> None:
    with started("gearbox/ratio", fmi) as instance:
        instance.step(0.0, 0.25)
        block = instance.block(["tau_a"])
        with pytest.raises(FmuCallError, match=r"setting tau_a at t = 0\.25 s failed") as caught:
            block.set([math.nan])
        assert any(
            "tau_a" in message and "not finite" in message for message in caught.value.messages
        )
        assert "not finite" in str(caught.value)


@BOTH
def test_bad_values_and_names(fmi: int) -> None:
    with Instance(fmu("gearbox/ratio", "native", fmi), "g") as instance:
        with pytest.raises(
            ValueRangeError, match=r"ratio = -1 is outside its bounds \[0.001, 10000\]"
        ):
            instance.set({"ratio": -1.0})
        with pytest.raises(ValueRangeError, match="ratio = nan is not finite"):
            instance.set({"ratio": math.nan})
        with pytest.raises(ValueRangeError, match="ratio = 'fast' is not a number"):
            instance.set({"ratio": "fast"})
        with pytest.raises(UnknownNameError, match="no variable 'ration'; did you mean 'ratio'"):
            instance.set({"ration": 1.0})


def test_freed_instances_refuse() -> None:
    instance = started("gearbox/ratio", 2)
    block = instance.block(["tau_b"])
    instance.free()
    instance.free()
    with pytest.raises(FmuCallError, match="is freed"):
        block.get()
    with pytest.raises(FmuCallError, match="is freed"):
        instance.step(0.0, 0.1)


def test_foreign_fmi2_with_integers_and_booleans(affine: Path) -> None:
    with Instance(affine, logging=True) as instance:
        instance.set({"a": 3.0, "fail_at": 0.15})
        instance.enter_initialization(0.0)
        instance.exit_initialization()
        block = instance.block(["u", "n", "on"])
        block.set([2.0, 41.0, 0.0])
        np.testing.assert_array_equal(instance.get("y", "next", "off"), [6.0, 42.0, 1.0])
        np.testing.assert_array_equal(block.get(), [2.0, 41.0, 0.0])
        instance.step(0.0, 0.1)
        with pytest.raises(FmuCallError, match=r"a step of 0\.1 s at t = 0\.1 s.*belt came off"):
            instance.step(0.1, 0.1)
    assert "y" in instance.description.assumed  # pythonfmu declares no dependencies


def test_foreign_fmi3_with_integers_and_booleans(foreign3: Path) -> None:
    with Instance(foreign3) as instance:
        instance.enter_initialization(0.0)
        instance.set({"u": 2.0, "n": 41, "on": False})
        instance.exit_initialization()
        instance.step(0.0, 0.1)
        np.testing.assert_array_equal(instance.get("y", "next", "off"), [4.0, 42.0, 1.0])


def test_missing_capability_is_said(affine: Path) -> None:
    with (
        Instance(affine) as instance,
        pytest.raises(FmuCallError, match="declares providesDirectionalDerivatives = false"),
    ):
        instance.directional_derivative(["y"], ["u"], [1.0])
