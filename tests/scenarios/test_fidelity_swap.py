"""Every instance of a system runs with every fidelity of its component, and with every part."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.running.runner import run
from cosim.scenario.scenario import find
from cosim.system.variants import component
from sources.variant import fidelities
from tests.scenarios.running import PROVIDER

pytestmark = pytest.mark.slow

RUNS = [
    "crawler/SET2_1",
    "crawler_paper/SET1_1",
    "mir250/CN1",
    "mobile_manipulator/IY",
    "motor_bench/ST1",
    "omni_base/closed",
    "ur5_bench/UR5e",
]


def swaps() -> list[tuple[str, str, str]]:
    found = []
    for name in RUNS:
        file, run_name = find(name)
        instances = file.scenario(run_name).system.instances
        for instance, variant in instances.items():
            found += [(name, instance, item) for item in fidelities(component(variant))]
    return found


def check(name: str, changes: dict[str, str]) -> None:
    result = run(name, provider=PROVIDER, variants=changes, duration=0.05)
    (item,) = result.runs.values()
    assert len(item.recording) > 1 and np.isfinite(item.recording.values).all()
    assert not item.recording.error


@pytest.mark.parametrize(("name", "instance", "fidelity"), swaps())
def test_fidelity(name: str, instance: str, fidelity: str) -> None:
    check(name, {instance: fidelity})


@pytest.mark.parametrize("slot", ["wheel_contact", "caster"])
def test_parts_of_the_base(slot: str) -> None:
    for item in fidelities(slot):
        if item != "spatial":
            check("mir250/CN1", {"base": "planar", slot: item})


def test_a_planar_base_refuses_wheels_that_want_its_height() -> None:
    with pytest.raises(ValueError, match="take stick_slip, or six_dof"):
        check("mir250/CN1", {"base": "planar", "wheel_contact": "spatial"})
