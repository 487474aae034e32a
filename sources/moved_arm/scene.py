"""Links of a UR arm that is moved as given: as `ur5_arm` draws them, on the floor."""

from __future__ import annotations

from ..ur5_arm.scene import SCENE as UR5

SCENE = [{**UR5[0], "pose": []}, *UR5[1:]]
