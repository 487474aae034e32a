"""The balance of moments that all loads share."""

from __future__ import annotations

from collections.abc import Callable

from .. import inertia as qs
from ..model import SX, Model


def rotation(m: Model, gravity: Callable[[SX], tuple[SX, SX]] | None = None) -> None:
    """Rotation under torque, friction and, where given, gravity (torque and energy by angle)."""
    u = m.inputs(qs.TAU, qs.J_ADDED)
    p = m.parameters(qs.J, qs.B)
    x = m.states(qs.ANGLE, qs.SPEED)
    weight, height = gravity(x.angle) if gravity else (0.0, 0.0)
    signals = {"velocity": x.speed, "angle": x.angle, "load": u.tau}
    if gravity:
        signals["reaction"] = weight
    flange = m.balance("flange", "rotation", **signals)
    m.derivative(x.angle, x.speed)
    m.derivative(x.speed, (u.tau + weight - p.b * x.speed + flange.effort) / (p.J + u.J_added))
    m.output(qs.W, x.speed)
    m.output(qs.PHI, x.angle)
    m.port(qs.FLANGE, u.tau, x.speed)
    m.stored_energy((p.J + u.J_added) * x.speed**2 / 2 + height)
    m.loss("bearings", p.b * x.speed**2)
