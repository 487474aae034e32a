"""An FMU that is simulated alone, with its default experiment and values, shows something."""

from __future__ import annotations

from functools import lru_cache

import fmpy
import numpy as np
import pytest

from sources.variant import components, fidelities
from tests.fmus import fmu

pytestmark = pytest.mark.slow

SMALL = 1e-6
"""Far below every motion, force or current that these values cause."""


@lru_cache(maxsize=None)
def alone(variant: str) -> np.ndarray:
    """The default experiment as FMPy runs it, nothing set and nothing connected."""
    result = fmpy.simulate_fmu(
        str(fmu(variant)), fmi_type="CoSimulation", output_interval=0.1, record_events=False
    )
    assert result["time"][-1] == pytest.approx(3.0)  # set motions begin at 1 s
    return result


def moves(result: np.ndarray, name: str) -> bool:
    return float(np.ptp(result[name])) > SMALL


STILL = {"omni_base", "omni_drive"}
"""A base without torques stands, and a drive that is told no motion asks for none."""


@pytest.mark.parametrize("component", sorted(set(components()) - STILL))
def test_something_is_seen(component: str) -> None:
    first = min(fidelities(component).items(), key=lambda item: item[1].FIDELITY.level)[0]
    result = alone(f"{component}/{first}")
    names = [name for name in result.dtype.names if name != "time"]
    assert any(moves(result, name) or np.abs(result[name]).max() > SMALL for name in names)


def test_a_motor_drives_a_gear_carries_a_wheel_rolls_an_arm_falls() -> None:
    motor = alone("dc_motor/electrical")
    assert motor["tau"].max() > 1.0 and moves(motor, "i")  # N.m, against a held shaft
    gear = alone("gearbox/ratio")
    # a factor on the torque, and the ratio: 1 N.m of the motor, within the values of the device
    assert 0.5 * 10.167 < gear["tau_b"][-1] <= 10.167
    assert gear["w_a"][-1] == pytest.approx(10.167)  # the load turns with 1 rad/s
    wheel = alone("wheel_contact/rolling")
    assert wheel["w"][-1] > 1.0
    arm = alone("ur5_arm/rigid")
    assert any(moves(arm, f"q[{joint}]") for joint in range(1, 7))
