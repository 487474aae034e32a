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
    phi, w = x.angle, x.speed
    weight, height = gravity(phi) if gravity else (0.0, 0.0)
    signals = {"velocity": w, "angle": phi, "load": u.tau}
    if gravity:
        signals["reaction"] = weight
    flange = m.balance("flange", "rotation", **signals)
    m.derivative(phi, w)
    m.derivative(w, (u.tau + weight - p.b * w + flange.effort) / (p.J + u.J_added))
    m.output(qs.W, w)
    m.output(qs.PHI, phi)
    m.port(qs.FLANGE, u.tau, w)
    m.stored_energy((p.J + u.J_added) * w**2 / 2 + height)
    m.loss("bearings", p.b * w**2)
