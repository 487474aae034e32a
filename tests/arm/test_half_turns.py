"""Poses of flanges behind joints that are turned right round."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sources.laws.chain import standard_dh
from sources.laws.rigid_chain import Posture
from sources.laws.rotation import rotation_vector


@pytest.mark.parametrize("alpha", [math.pi, -math.pi, 3.1416, 2.1, math.pi / 2, 0.0])
def test_the_rotation_vector_is_that_of_the_flange_for_any_twist_of_a_joint(alpha: float) -> None:
    nothing = [[0.0] * 3] * 2
    arm = standard_dh([0.1, 0.2], [0.0, 0.3], [alpha, 0.0], [1.0] * 2, nothing, [[0.1] * 6] * 2)
    q = ca.SX.sym("q", 2)
    posture = Posture(arm, q)
    told = ca.Function("told", [q], [rotation_vector(posture.flange_quaternion())])([0.3, 0.4])
    turn = Rotation.from_euler("z", 0.3) * Rotation.from_euler("x", alpha)
    turn = turn * Rotation.from_euler("z", 0.4)
    found = Rotation.from_rotvec(np.array(told).ravel())
    assert (found * turn.inv()).magnitude() < 1e-12  # rounding of a few products
