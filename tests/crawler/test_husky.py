"""Values of the device that follow from others."""

from __future__ import annotations

import pytest

from sources.variant import device_values


def test_its_yaw_inertia_is_that_of_the_box_that_it_is_taken_for() -> None:
    values = device_values("crawler", "husky")
    assert values["yaw_inertia"].origin == "box of 0.99 m by 0.67 m"
    box = values["mass"].value * (0.99**2 + 0.67**2) / 12
    assert values["yaw_inertia"].value == pytest.approx(box, abs=0.005)  # three digits
