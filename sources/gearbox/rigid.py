"""What the gearboxes without elasticity share."""

from __future__ import annotations

from collections.abc import Callable

from ..model import SX, Model
from . import FLANGE_A, FLANGE_B, J_A, J_B, RATIO, TAU_A, TAU_B, W_A, W_B, B


def rigid(m: Model, efficiency: Callable[[SX, SX], SX]) -> None:
    """Rigid gear; `efficiency(tau, w_a)` is the factor on the torque `tau` into the mesh.

    w_a = ratio w_b,   tau_b = ratio factor tau_a - b w_b,   J_b = ratio^2 J_a
    """
    tau_a, w_b = m.input(TAU_A), m.input(W_B)
    nominal, friction, inertia = m.parameter(RATIO), m.parameter(B), m.parameter(J_A)
    # Speed and torque use the same ratio, so a ripple of it neither takes nor gives power.
    ripple = m.balance("ratio", "coefficient", unit="1", value=nominal, speed=w_b)
    ratio = nominal + ripple.effort
    w_a = ratio * w_b
    flange_b = m.balance("flange_b", "rotation", velocity=w_b, load=ratio * tau_a)
    flange_a = m.balance("flange_a", "rotation", velocity=w_a, load=tau_a)
    into_mesh = tau_a + flange_a.effort
    factor = efficiency(into_mesh, w_a)
    tau_b = ratio * factor * into_mesh - friction * w_b + flange_b.effort
    m.output(W_A, w_a)
    m.output(TAU_B, tau_b)
    m.output(J_B, nominal**2 * inertia)
    m.port(FLANGE_A, tau_a, w_a)
    m.port(FLANGE_B, tau_b, w_b)
    m.loss("mesh", (1 - factor) * into_mesh * w_a)
    m.loss("bearings", friction * w_b**2)
