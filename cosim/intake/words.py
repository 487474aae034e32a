"""Words in the names of columns and variables, and what they mean."""

from __future__ import annotations

import re

_CAMEL = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")
_ALIKE = (
    ("time", "t", "stamp", "timestamp", "clock", "epoch"),
    ("speed", "spd", "vel", "velocity", "w", "omega", "rate", "gyro"),
    ("angle", "ang", "theta", "pos", "position", "q"),
    ("yaw", "heading", "phi", "psi", "hdg"),
    ("current", "cur", "curr", "i", "amps"),
    ("voltage", "volt", "volts", "u", "pwm"),
    ("torque", "tau", "trq", "effort", "moment"),
    ("temperature", "temp"),
    ("left", "l", "lft"),
    ("right", "r", "rgt"),
    ("motor", "mot"),
    ("command", "cmd", "set", "setpoint", "ref", "reference", "desired", "goal", "target", "des"),
    ("measured", "meas", "act", "actual", "feedback", "fb"),
    ("x", "px"), ("y", "py"), ("z", "pz"),
)  # fmt: skip
"""Words of one meaning, the first of each stands for all."""
MEANING = {word: group[0] for group in _ALIKE for word in group}
COMMAND, TIME = "command", "time"
ORDERS = ("pwm", "duty", "throttle", "setpoint")
"""Words of what is ordered, besides those that mean `COMMAND`."""


def pieces(name: str) -> list[str]:
    """Parts of a name between dots, underscores, blanks and brackets, as written."""
    return [part for part in re.split(r"[^A-Za-z0-9%°µ]+", name) if part]


def words(name: str) -> list[str]:
    """Words of a name in small letters, apart at capitals too, as their meanings."""
    found = [(word.lower(), part) for part in pieces(name) for word in _CAMEL.findall(part)]
    # a letter of `u32` is none of a quantity; that of `i1` is
    return [
        MEANING.get(word, word) if len(word) > 1 or len(part) <= 2 or part.isalpha() else word
        for word, part in found
    ]


def commands(name: str) -> bool:
    """Whether a name says that it is ordered, not measured."""
    plain = [word.lower() for part in pieces(name) for word in _CAMEL.findall(part)]
    return COMMAND in words(name) or any(word in ORDERS for word in plain)
