"""Rods from joint to joint, from where the device says that its joints are; thickness drawn freely.

Devices with standard Denavit-Hartenberg data are drawn as `ur5_arm` is, with as many joints.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..scene import ACCENT, STEEL, cylinder, move, node, turn
from ..ur5_arm.scene import SCENE as UR5
from ..ur5_arm.scene import links

THICK = 0.045
"""Radius of a joint over the arm's length."""


def quaternion(rows: Sequence[float]) -> dict[str, Any]:
    """The rotation of a 3x3 matrix, row by row."""
    r = np.reshape(np.asarray(rows, dtype=np.float64), (3, 3))
    # the eigenvector of 1 of this matrix is the quaternion (Bar-Itzhack, 2000)
    k = np.array(
        [
            [r[0, 0] - r[1, 1] - r[2, 2], r[1, 0] + r[0, 1], r[2, 0] + r[0, 2], r[2, 1] - r[1, 2]],
            [r[1, 0] + r[0, 1], r[1, 1] - r[0, 0] - r[2, 2], r[2, 1] + r[1, 2], r[0, 2] - r[2, 0]],
            [r[2, 0] + r[0, 2], r[2, 1] + r[1, 2], r[2, 2] - r[0, 0] - r[1, 1], r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], np.trace(r)],
        ]
    )
    x, y, z, w = np.linalg.eigh(k)[1][:, -1].tolist()
    return {"quaternion": [w, x, y, z]}


def scene(values: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The nodes of a device.

    Args:
        values: of its device file.
    """
    if "alpha" in values:
        count = len(values["alpha"])
        return [UR5[0], *links(count), {**UR5[-1], "parent": f"link {count}"}]
    offsets = np.asarray(values["offset"], dtype=np.float64)
    radius = THICK * float(np.linalg.norm(offsets, axis=1).sum() or 1.0)
    found, last = [UR5[0]], "mount"
    for i, (place, rows) in enumerate(zip(offsets, values["rotation"], strict=True), 1):
        name = f"joint {i}"
        pose, shapes = [move(*place.tolist()), quaternion(rows)], []
        if i == len(offsets):
            found.append(node("tool", pose, [{"frame": 3.0 * radius}], last, trail=True))
            break
        slides = bool(values["prismatic"][i - 1])
        pose.append(move(0, 0, f"q[{i}]") if slides else turn("z", f"q[{i}]"))
        shapes.append(cylinder(radius, 2.2 * radius, "z", colour=ACCENT))
        rod = {"rod": [[0, 0, 0], offsets[i].tolist()], "radius": 0.7 * radius, "colour": STEEL}
        found.append(node(name, pose, [*shapes, rod], last))
        last = name
    return found
