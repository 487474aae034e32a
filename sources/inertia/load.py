"""The balance of moments that all loads share."""

from __future__ import annotations

from collections.abc import Callable

from ..model import SX, Model
from . import ANGLE, FLANGE, J_ADDED, PHI, SPEED, TAU, B, J, W


def rotation(m: Model, gravity: Callable[[SX], tuple[SX, SX]] | None = None) -> None:
    """Rotation under torque, friction and, where given, gravity (torque and energy by angle)."""
    torque, added = m.input(TAU), m.input(J_ADDED)
    inertia, friction = m.parameter(J), m.parameter(B)
    angle, speed = m.state(ANGLE), m.state(SPEED)
    weight, height = gravity(angle) if gravity else (0.0, 0.0)
    signals = {"velocity": speed, "angle": angle, "load": torque}
    if gravity:
        signals["reaction"] = weight
    flange = m.balance("flange", "rotation", **signals)
    m.derivative(angle, speed)
    m.derivative(speed, (torque + weight - friction * speed + flange.effort) / (inertia + added))
    m.output(W, speed)
    m.output(PHI, angle)
    m.port(FLANGE, torque, speed)
    m.stored_energy((inertia + added) * speed**2 / 2 + height)
    m.loss("bearings", friction * speed**2)
