"""Quaternions in tables: four columns, of which a system on a floor has the yaw."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..calibrate.columns import UNIT_LENGTH, yaw_of
from .topic import Topic

LETTERS = ("x", "y", "z", "w")
YAW = "yaw"


def with_yaws(topic: Topic) -> Topic:
    """The topic with the yaw of each quaternion as a column of its own, in `Topic.made`.

    A quaternion is four columns whose names differ in their last letter, x, y, z and w, and whose
    squares add up to 1 wherever something was measured.
    """
    columns, units, made = dict(topic.log.columns), dict(topic.log.units), dict(topic.made)
    for name in topic.log.columns:
        if name[-1:].lower() != LETTERS[-1]:
            continue
        stem = name[:-1]
        parts = [stem + (c if name[-1] == LETTERS[-1] else c.upper()) for c in LETTERS]
        own = stem.removesuffix("q").removesuffix("Q") + YAW
        if own in columns or any(part not in topic.log.columns for part in parts):
            continue
        values = np.stack([topic.log.columns[part] for part in parts])
        length = np.sqrt(np.sum(values**2, axis=0))
        length = length[np.isfinite(length) & (length > 0.0)]
        if length.size and np.max(np.abs(length - 1.0)) < UNIT_LENGTH:
            columns[own], units[own], made[own] = yaw_of(values), "rad", tuple(parts)
    if made == topic.made:
        return topic
    return replace(topic, log=replace(topic.log, columns=columns, units=units), made=made)
