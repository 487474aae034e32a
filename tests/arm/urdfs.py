"""Random serial chains as URDF texts, and as pinocchio models."""

from __future__ import annotations

import numpy as np
import pinocchio as pin


def row(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)


def inertial(random: np.random.Generator) -> str:
    """A real body: point masses at random."""
    points = random.normal(0.0, 0.1, (8, 3))
    masses = random.uniform(0.1, 0.5, 8)
    centre = masses @ points / masses.sum()
    d = points - centre
    j = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, d, strict=True))
    # the inertia is written in axes of its own
    angles = random.uniform(-3, 3, 3)
    turn = pin.rpy.rpyToMatrix(*angles)
    j = turn.T @ j @ turn
    elements = (
        ("ixx", 0, 0),
        ("iyy", 1, 1),
        ("izz", 2, 2),
        ("ixy", 0, 1),
        ("ixz", 0, 2),
        ("iyz", 1, 2),
    )
    inertia = " ".join(f'{name}="{float(j[i, k])!r}"' for name, i, k in elements)
    return (
        f'<inertial><origin xyz="{row(centre)}" rpy="{row(angles)}"/>'
        f'<mass value="{float(masses.sum())!r}"/><inertia {inertia}/></inertial>'
    )


def random_chain(seed: int, size: int, prismatic: float = 0.25, fixed: float = 0.3) -> str:
    """A chain of `size` moving joints with any axes; fixed joints and side links among them."""
    random = np.random.default_rng(seed)
    links, joints = ['<link name="l0"/>'], []
    parent = "l0"

    def add(name: str, parent: str, kind: str) -> None:
        links.append(f'<link name="{name}">{inertial(random)}</link>')
        axis = random.normal(size=3) if random.random() < 0.6 else np.eye(3)[random.integers(3)]
        if random.random() < 0.3:
            axis = -axis
        joints.append(
            f'<joint name="j_{name}" type="{kind}"><parent link="{parent}"/><child link="{name}"/>'
            f'<origin xyz="{row(random.normal(0, 0.3, 3))}" rpy="{row(random.uniform(-3, 3, 3))}"/>'
            f'<axis xyz="{row(axis)}"/><limit lower="-2" upper="2.5" effort="50" velocity="3"/>'
            "</joint>"
        )

    for k in range(size):
        if random.random() < fixed:
            add(f"f{k}", parent, "fixed")
            parent = f"f{k}"
        add(f"l{k + 1}", parent, "prismatic" if random.random() < prismatic else "revolute")
        parent = f"l{k + 1}"
        if random.random() < fixed:
            add(f"side{k}", parent, "fixed")
    add("tool", parent, "fixed")
    return f'<robot name="random">{"".join(links)}{"".join(joints)}</robot>'


PANDA_LINKS = (
    (4.970684, (0.003875, 0.002081, -0.04762),
     (0.70337, 0.70661, 0.009117, -0.000139, 0.006772, 0.019169)),
    (0.646926, (-0.003141, -0.02872, 0.003495),
     (0.007962, 0.02811, 0.025995, -0.003925, 0.010254, 0.000704)),
    (3.228604, (0.027518, 0.039252, -0.066502),
     (0.037242, 0.036155, 0.01083, -0.004761, -0.011396, -0.012805)),
    (3.587895, (-0.05317, 0.104419, 0.027454),
     (0.025853, 0.019552, 0.028323, 0.007796, -0.001332, 0.008641)),
    (1.225946, (-0.011953, 0.041065, -0.038437),
     (0.035549, 0.029474, 0.008627, -0.002117, -0.004037, 0.000229)),
    (1.666555, (0.060149, -0.014117, -0.010517),
     (0.001964, 0.004354, 0.005433, 0.000109, -0.001158, 0.000341)),
    (0.735522, (0.010517, -0.004252, 0.061597),
     (0.012516, 0.010027, 0.004815, -0.000428, -0.001196, -0.000741)),
)  # fmt: skip
"""Mass, centre and (xx, yy, zz, xy, xz, yz) of the links of a Franka Emika Panda: Gaz, Cognetti,
Oliva, Robuffo Giordano, De Luca, IEEE Robotics and Automation Letters 4(4), 2019, 4147-4154."""
PANDA_JOINTS = (
    ("0 0 0.333", "0 0 0", -2.8973, 2.8973, 87, 2.175),
    ("0 0 0", "-1.57079632679 0 0", -1.7628, 1.7628, 87, 2.175),
    ("0 -0.316 0", "1.57079632679 0 0", -2.8973, 2.8973, 87, 2.175),
    ("0.0825 0 0", "1.57079632679 0 0", -3.0718, -0.0698, 87, 2.175),
    ("-0.0825 0.384 0", "-1.57079632679 0 0", -2.8973, 2.8973, 12, 2.61),
    ("0 0 0", "1.57079632679 0 0", -0.0175, 3.7525, 12, 2.61),
    ("0.088 0 0", "1.57079632679 0 0", -2.8973, 2.8973, 12, 2.61),
)
"""xyz, rpy, limits, largest torque and speed, as its maker prints them."""


def panda(hand: bool = False) -> str:
    """A Panda; with a hand whose fingers branch, if wanted."""
    parts = ['<link name="panda_link0"/>']
    for k, (mass, centre, about) in enumerate(PANDA_LINKS):
        names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        inertia = " ".join(f'{name}="{value}"' for name, value in zip(names, about, strict=True))
        parts.append(
            f'<link name="panda_link{k + 1}"><inertial><origin xyz="{row(np.array(centre))}"/>'
            f'<mass value="{mass}"/><inertia {inertia}/></inertial></link>'
        )
        xyz, rpy, low, high, torque, speed = PANDA_JOINTS[k]
        parts.append(
            f'<joint name="panda_joint{k + 1}" type="revolute"><parent link="panda_link{k}"/>'
            f'<child link="panda_link{k + 1}"/><origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="0 0 1"/>'
            f'<limit lower="{low}" upper="{high}" effort="{torque}" velocity="{speed}"/></joint>'
        )
    parts.append(
        '<link name="panda_link8"/>'
        + fixed("panda_joint8", "panda_link7", "panda_link8", "0 0 0.107")
    )
    if hand:
        body = (
            '<inertial><mass value="0.73"/>'
            '<inertia ixx="1e-3" iyy="2.5e-3" izz="1.7e-3" ixy="0" ixz="0" iyz="0"/></inertial>'
        )
        finger = (
            '<inertial><mass value="0.015"/>'
            '<inertia ixx="2e-6" iyy="2e-6" izz="1e-6" ixy="0" ixz="0" iyz="0"/></inertial>'
        )
        parts.append(
            f'<link name="panda_hand">{body}</link>'
            + fixed("hand_joint", "panda_link8", "panda_hand", "0 0 0")
        )
        for side, sign in (("left", 1), ("right", -1)):
            mimic = '<mimic joint="finger_left"/>' if side == "right" else ""
            parts.append(
                f'<link name="finger_{side}_link">{finger}</link><joint name="finger_{side}" '
                f'type="prismatic"><parent link="panda_hand"/><child link="finger_{side}_link"/>'
                f'<origin xyz="0 0 0.0584"/><axis xyz="0 {sign} 0"/><limit lower="0" upper="0.04" '
                f'effort="20" velocity="0.2"/>{mimic}</joint>'
            )
    return f'<robot name="panda">{"".join(parts)}</robot>'


def fixed(name: str, parent: str, child: str, xyz: str) -> str:
    return (
        f'<joint name="{name}" type="fixed"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/></joint>'
    )
