"""What the gearboxes without elasticity share."""

from __future__ import annotations

from collections.abc import Callable

from .. import gearbox as qs
from ..model import SX, Model


def rigid(m: Model, efficiency: Callable[[SX, SX], SX]) -> None:
    """Rigid gear; `efficiency(tau, w_a)` is the factor on the torque `tau` into the mesh.

    w_a = ratio w_b,   tau_b = ratio factor tau_a - b w_b,   J_b = ratio^2 J_a
    """
    u = m.inputs(qs.TAU_A, qs.W_B)
    p = m.parameters(qs.RATIO, qs.B, qs.J_A)
    # Speed and torque use the same ratio, so a ripple of it neither takes nor gives power.
    ripple = m.balance("ratio", "coefficient", unit="1", value=p.ratio, turning=u.w_b)
    ratio = p.ratio + ripple.effort
    w_a = ratio * u.w_b
    flange_b = m.balance("flange_b", "rotation", velocity=u.w_b, load=ratio * u.tau_a)
    flange_a = m.balance("flange_a", "rotation", velocity=w_a, load=u.tau_a)
    into_mesh = u.tau_a + flange_a.effort
    factor = efficiency(into_mesh, w_a)
    tau_b = ratio * factor * into_mesh - p.b * u.w_b + flange_b.effort
    m.output(qs.W_A, w_a)
    m.output(qs.TAU_B, tau_b)
    m.output(qs.J_B, p.ratio**2 * p.J_a)
    m.port(qs.FLANGE_A, u.tau_a, w_a)
    m.port(qs.FLANGE_B, tau_b, u.w_b)
    m.loss("mesh", (1 - factor) * into_mesh * w_a)
    m.loss("bearings", p.b * u.w_b**2)
