"""The arms of the device files as pinocchio models, and vectors as named values."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

import casadi as ca
import numpy as np
import pinocchio as pin

from sources.laws.rigid_chain import Chain, Posture, standard_dh
from sources.variant import device_values

DEVICES = ("ur5", "ur5e", "lab")
NAMES = ("d", "a", "alpha", "mass", "centre", "inertia")


def named(**vectors: Iterable[float]) -> dict[str, float]:
    """`named(q=[...])` -> {"q[1]": ..., ...}."""
    return {
        f"{name}[{k + 1}]": float(value)
        for name, vector in vectors.items()
        for k, value in enumerate(vector)
    }


def vector(values: dict[str, float], name: str) -> np.ndarray:
    size = sum(key.startswith(f"{name}[") for key in values)
    return np.array([values[f"{name}[{k + 1}]"] for k in range(size)])


def symmetric(triangle: np.ndarray) -> np.ndarray:
    """6x6 from the upper triangle row by row."""
    matrix = np.zeros((6, 6))
    matrix[np.triu_indices(6)] = triangle
    return matrix + np.triu(matrix, 1).T


@lru_cache(maxsize=None)
def chain(device: str) -> Chain:
    values = device_values("ur5_arm", device)
    return standard_dh(*(values[name].value for name in NAMES))


class Reference:
    """An arm on a free mount in pinocchio, from the same data by another route.

    `q`, `qd` and `qdd` are of the joints; the mount's motion is in mount axes, its acceleration the
    second derivative of its position. Gravity acts as an acceleration of the mount.
    """

    def __init__(self, device: str) -> None:
        values = {k: v.value for k, v in device_values("ur5_arm", device).items()}
        self.model = pin.Model()
        self.model.gravity.linear = np.zeros(3)
        joint = self.model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "mount")
        place = pin.SE3.Identity()
        for k in range(6):
            joint = self.model.addJoint(joint, pin.JointModelRZ(), place, f"joint_{k + 1}")
            alpha = values["alpha"][k]
            turn = pin.AngleAxis(alpha, np.array([1.0, 0.0, 0.0])).toRotationMatrix()
            place = pin.SE3(turn, np.array([values["a"][k], 0.0, values["d"][k]]))
            xx, yy, zz, xy, xz, yz = values["inertia"][k]
            inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            body = pin.Inertia(values["mass"][k], np.array(values["centre"][k]), inertia)
            self.model.appendBodyToJoint(joint, body, place)
        self.flange = self.model.addFrame(pin.Frame("flange", joint, place, pin.FrameType.OP_FRAME))
        self.data = self.model.createData()

    def configuration(self, q: np.ndarray) -> np.ndarray:
        return np.concatenate([np.zeros(6), [1.0], q])

    def inverse(
        self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, rate: np.ndarray, motion: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Joint torques and wrench; `motion` is [acceleration - gravity; angular acceleration].

        The mount's velocity is taken as 0, which changes no force.
        """
        v = np.concatenate([np.zeros(3), rate, qd])
        force = pin.rnea(
            self.model, self.data, self.configuration(q), v, np.concatenate([motion, qdd])
        )
        return force[6:], force[:6]

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """12x12, mount first."""
        upper = np.triu(pin.crba(self.model, self.data, self.configuration(q)))
        return upper + np.triu(upper, 1).T

    def tool(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position and rotation matrix of the flange in mount axes."""
        pin.framesForwardKinematics(self.model, self.data, self.configuration(q))
        place = self.data.oMf[self.flange]
        return place.translation.copy(), place.rotation.copy()

    def kinetic_energy(self, q: np.ndarray, twist: np.ndarray, qd: np.ndarray) -> float:
        v = np.concatenate([twist, qd])
        return float(pin.computeKineticEnergy(self.model, self.data, self.configuration(q), v))


@lru_cache(maxsize=None)
def laws(device: str) -> dict[str, ca.Function]:
    """Inverse dynamics, mass matrix and mass properties of a device as numeric functions."""
    q, qd, qdd = (ca.SX.sym(name, 6) for name in ("q", "qd", "qdd"))
    rate, acceleration, angular = (ca.SX.sym(name, 3) for name in ("w", "a", "alpha"))
    posture = Posture(chain(device), q)
    tau, wrench = posture.inverse_dynamics(
        qd,
        qdd,
        base_rate=rate,
        base_acceleration=acceleration,
        base_angular_acceleration=angular,
    )
    whole = posture.mass_properties()
    return {
        "inverse": ca.Function("inverse", [q, qd, qdd, rate, acceleration, angular], [tau, wrench]),
        "mass_matrix": ca.Function("mass_matrix", [q], [posture.mass_matrix()]),
        "mass": ca.Function("mass", [q], [whole.mass, whole.first_moment, whole.inertia]),
    }
