"""A shaft is asked at one of its ends, unless its law reads what differs between the two."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim.diagnose.candidates import candidates
from cosim.installation.builder import default_provider
from sources.distribution.contents import declared

RIGS = Path(__file__).parents[2] / "scenarios"


def asked(rig: str) -> list[str]:
    return [c.label for c in candidates(declared(RIGS / rig / "dataset.toml", default_provider()))]


@pytest.mark.parametrize(
    ("rig", "giver", "taker"),
    [
        ("ur5_bench", "drive.joint_2", "arm.joint_2"),
        ("motor_bench", "motor.shaft", "gearbox.flange_a"),
    ],
)
def test_the_torque_that_passes_is_another_one_before_the_givers_friction(
    rig: str, giver: str, taker: str
) -> None:
    """So friction in proportion to it is asked at both ends, where they are twins after the other
    one; dry friction, which only knows the motion, is asked at the end that gives that.
    """
    found = asked(rig)
    assert f"coulomb at {taker}" in found and f"coulomb at {giver}" not in found
    first, second = (found.index(f"load_friction at {place}") for place in (taker, giver))
    assert first < second
