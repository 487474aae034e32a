"""The stepper of these tests follows the tick rules of sources/README.md."""

from __future__ import annotations

import math

import pytest

from sources.component import Component
from sources.model import Model
from sources.quantity import Quantity
from tests.fmus import Slave, fmu
from tests.support import Stepper


def sampler(period: float = 0.01) -> Model:
    """z samples u; z2 of a clock declared later samples z; x follows z."""
    m = Model(Component("sampler", "Two clocks.", energy=False), "test")
    u = m.input(Quantity("u", "1", "input"))
    period = m.parameter(Quantity("T", "s", "period", start=period))
    first, second = m.clock("first", period), m.clock("second", period)
    z, z2 = m.discrete(Quantity("z", "1", "sample")), m.discrete(Quantity("z2", "1", "copy"))
    x = m.state(Quantity("x", "1", "lag"))
    m.update(first, z, u)
    m.update(second, z2, z)
    m.derivative(x, z - x)
    m.output(Quantity("y", "1", "sample"), z)
    m.output(Quantity("y2", "1", "copy"), z2)
    return m.finish()


@pytest.mark.slow
@pytest.mark.parametrize("period", [0.01, 0.001, 0.1 / 3])
def test_a_tick_sees_the_inputs_of_the_step_that_it_begins(period: float) -> None:
    stepper = Stepper(sampler(period))
    for k in range(300):
        out = stepper.step({"u": float(k)}, period)
        # Neither the previous input nor, at the end of the step, the same one twice.
        assert out == {"y": float(k), "y2": float(k)}


def test_ticks_inside_a_step_and_between_steps() -> None:
    stepper = Stepper(sampler(0.01))
    seen = [stepper.step({"u": stepper.t}, 0.004)["y"] for _ in range(6)]
    # Ticks at 0, 0.01 (in the step from 0.008), 0.02 (begins the step from 0.020).
    assert seen == pytest.approx([0.0, 0.0, 0.008, 0.008, 0.008, 0.020], abs=1e-15)  # k * dt


def test_state_between_ticks_is_integrated() -> None:
    stepper = Stepper(sampler(0.1))
    stepper.step({"u": 1.0}, 0.5)
    # z = 1 from the first tick on; RK4 with h = 1 ms has an error of 1e-15.
    assert stepper.values["x"] == pytest.approx(1 - math.exp(-0.5), abs=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["encoder/counts", "command_link/held+rate_limit@speed"])
@pytest.mark.parametrize("dt", [0.001, 0.0035, 0.01])
def test_stepper_and_fmu_agree(variant: str, dt: float) -> None:
    """The same tick rules in the FMU and here, with ticks on and between communication points."""
    stepper = Stepper(variant)
    inputs = [v.name for v in stepper.model.of_role("input")]
    with Slave(fmu(variant)) as slave:
        outputs = slave.names("output")
        for k in range(40):
            values = {name: math.sin(0.7 * k + i) for i, name in enumerate(inputs)}
            slave.set(values)
            slave.step(k * dt, dt)
            ours = stepper.step(values, (k + 1) * dt - stepper.t)
            # Time is k * dt there and a sum here; the rest is the same arithmetic.
            assert slave.get(outputs) == pytest.approx([ours[n] for n in outputs], abs=1e-12)
