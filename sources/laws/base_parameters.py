"""Base parameters of a serial chain: what a motion and joint torques can tell of its links.

    tau = Y(q, q', q'') pi,    pi = (m, h_x, h_y, h_z, J_xx, J_yy, J_zz, J_xy, J_xz, J_yz) per link

Some of the ten parameters of each link show in no torque, others only together. A column of Y
that is a combination of columns before it, at random motions, is left out, and its parameter goes
into theirs: beta_i = pi_i + sum_c kappa_ic pi_c. The columns are taken in an order in which the
customary ones stay, link by link from the mount: J_zz, h_x, h_y, J_xx and the products of inertia;
J_yy, h_z and m go to the link before.

The mount is at rest and level: gravity acts along its -z axis.

Source: Khalil, Dombre, Modeling, Identification and Control of Robots, 2002, ch. 9; Gautier, J.
Robotic Systems 8(4), 1991, 485-506.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

Vector = Any

ELEMENTS = ("m", "h_x", "h_y", "h_z", "J_xx", "J_yy", "J_zz", "J_xy", "J_xz", "J_yz")
"""Parameters of a link: mass, first moment and inertia about its frame's origin."""
UNITS = ("kg", *("kg.m",) * 3, *("kg.m2",) * 6)
_ORDER = tuple(
    ELEMENTS.index(name)
    for name in ("J_zz", "h_x", "h_y", "J_xx", "J_xy", "J_xz", "J_yz", "J_yy", "h_z", "m")
)
MOTIONS = 6
"""Random motions per parameter: many more rows than columns, so that rank does not hang on luck."""
INVISIBLE = 1e-4
"""Share of a parameter's torques that is left when other parameters explain the rest, below which
no torque sensor tells it from them. Files that write right angles as 1.5708 leave 4e-6."""
DIGITS = 9
"""Decimals of the combinations: rounding differs between machines behind them."""


@dataclass(frozen=True)
class BaseParameter:
    """A combination of parameters of links that torques show.

    Attributes:
        link: number of the link whose parameter it is named after, from 1.
        element: index into `ELEMENTS`.
        others: (link, element, factor) of what cannot be told from it.
    """

    link: int
    element: int
    others: tuple[tuple[int, int, float], ...]

    @property
    def name(self) -> str:
        """As the FMU has it."""
        return f"base_{ELEMENTS[self.element]}_{self.link}"

    @property
    def unit(self) -> str:
        """Unit of the parameter it is named after."""
        return UNITS[self.element]

    def value(self, standard: Any) -> float:
        """Its value for the parameters of all links, one row each."""
        total = float(standard[self.link - 1][self.element])
        for link, element, factor in self.others:
            total += factor * float(standard[link - 1][element])
        return total

    def formula(self) -> str:
        """The combination as a sum."""
        text = f"{ELEMENTS[self.element]}_{self.link}"
        for link, element, factor in self.others:
            size = "" if abs(factor) == 1.0 else f"{abs(factor):.6g} "
            text += f" {'-' if factor < 0 else '+'} {size}{ELEMENTS[element]}_{link}"
        return text


def standard_parameters(
    mass: Sequence[float],
    centre: Sequence[Sequence[float]],
    inertia: Sequence[Sequence[float]],
) -> list[list[float]]:
    """Parameters of the links about their frames' origins from those about their centres of mass.

    `inertia` is (Ixx, Iyy, Izz, Ixy, Ixz, Iyz) of each link.
    """
    rows = []
    for m, c, (xx, yy, zz, xy, xz, yz) in zip(mass, centre, inertia, strict=True):
        x, y, z = c
        rows.append(
            [m, m * x, m * y, m * z,
             xx + m * (y * y + z * z), yy + m * (x * x + z * z), zz + m * (x * x + y * y),
             xy - m * x * y, xz - m * x * z, yz - m * y * z]
        )  # fmt: skip
    return rows


def regressor(
    rotation: Any, offset: Any, prismatic: Sequence[float], q: Vector, qd: Vector, qdd: Vector
) -> Any:
    """Y(q, q', q''), joints by ten times links, for g = 9.81 m/s2 along the mount's -z axis.

    Args:
        rotation: axes of each frame at q = 0 in those of its predecessor, 3x3 row by row.
        offset: origins in the predecessor's frame [m].
        prismatic: per joint 1 if it slides along z, 0 if it turns about z.
        q, qd, qdd: motion of the joints.
    """
    size = len(prismatic)
    matrix = np.zeros((size, 10 * size))
    turn, place = np.eye(3), np.zeros(3)
    w, alpha, a = np.zeros(3), np.zeros(3), np.array([0.0, 0.0, 9.81])  # all in mount axes
    axes, origins = [], []
    for i in range(size):
        fixed = np.reshape(rotation[i], (3, 3))
        shift = turn @ np.asarray(offset[i], dtype=float)
        turn = turn @ fixed
        z = turn[:, 2]
        if prismatic[i]:
            shift = shift + z * q[i]
        a = a + np.cross(alpha, shift) + np.cross(w, np.cross(w, shift))
        place = place + shift
        if prismatic[i]:
            a = a + 2 * np.cross(w, z) * qd[i] + z * qdd[i]
        else:
            alpha = alpha + np.cross(w, z) * qd[i] + z * qdd[i]
            w = w + z * qd[i]
            c, s = np.cos(q[i]), np.sin(q[i])
            turn = turn @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        axes.append(z)
        origins.append(place)
        force, moment = _body(turn.T @ a, turn.T @ alpha, turn.T @ w)
        force, moment = turn @ force, turn @ moment
        for k in range(i + 1):
            if prismatic[k]:
                row = axes[k] @ force
            else:
                arm = place - origins[k]
                row = axes[k] @ (moment + np.cross(arm, force, axis=0))
            matrix[k, 10 * i : 10 * i + 10] = row
    return matrix


def _body(a: Vector, alpha: Vector, w: Vector) -> tuple[Any, Any]:
    """Force and moment at a link's origin per parameter (3x10 each), link axes."""
    force, moment = np.zeros((3, 10)), np.zeros((3, 10))
    force[:, 0] = a
    force[:, 1:4] = _skew(alpha) + _skew(w) @ _skew(w)
    moment[:, 1:4] = -_skew(a)
    turning, spin = _inertia_columns(alpha), _inertia_columns(w)
    moment[:, 4:] = turning + _skew(w) @ spin
    return force, moment


def _skew(v: Vector) -> Any:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def _inertia_columns(v: Vector) -> Any:
    """`J v` per (Jxx, Jyy, Jzz, Jxy, Jxz, Jyz)."""
    x, y, z = v
    return np.array([[x, 0, 0, y, z, 0], [0, y, 0, x, 0, z], [0, 0, z, 0, x, y]], dtype=float)


def find(rotation: Any, offset: Any, prismatic: Sequence[float]) -> tuple[BaseParameter, ...]:
    """The base parameters of a chain on a level mount at rest; arguments as of `regressor`."""
    rows = (
        tuple(tuple(float(value) for value in row) for row in rows) for rows in (rotation, offset)
    )
    return _find(*rows, tuple(float(flag) for flag in prismatic))


@lru_cache(maxsize=64)
def _find(rotation: Any, offset: Any, prismatic: tuple[float, ...]) -> tuple[BaseParameter, ...]:
    size = len(prismatic)
    random = np.random.default_rng(0)
    rows = []
    for _ in range(MOTIONS * 10):
        q = random.uniform(-np.pi, np.pi, size)
        rows.append(regressor(rotation, offset, prismatic, q, *random.uniform(-3, 3, (2, size))))
    matrix = np.vstack(rows)
    length = np.linalg.norm(matrix, axis=0)
    units = [UNITS[column % 10] for column in range(length.size)]
    largest = {
        unit: max(value for value, each in zip(length, units, strict=True) if each == unit)
        for unit in UNITS
    }
    kept: list[int] = []
    basis = np.zeros((matrix.shape[0], 0))
    absorbed: dict[int, list[tuple[int, int, float]]] = {}
    for column in (10 * link + element for link in range(size) for element in _ORDER):
        if length[column] <= INVISIBLE * largest[UNITS[column % 10]]:
            continue
        values = matrix[:, column]
        rest = values - basis @ (basis.T @ values)
        rest -= basis @ (basis.T @ rest)  # twice is enough
        if np.linalg.norm(rest) > INVISIBLE * length[column]:
            kept.append(column)
            absorbed[column] = []
            basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
            continue
        factors = np.linalg.solve(basis.T @ matrix[:, kept], basis.T @ values)
        rounded: list[float] = [round(float(factor), DIGITS) for factor in factors]
        for column_kept, factor in zip(kept, rounded, strict=True):
            if factor:
                absorbed[column_kept].append((column // 10 + 1, column % 10, factor))
    return tuple(
        BaseParameter(column // 10 + 1, column % 10, tuple(absorbed[column])) for column in kept
    )
