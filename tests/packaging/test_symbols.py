"""Laws call quantities and signals as their formulas do."""

from __future__ import annotations

import casadi as ca
import pytest

from sources.component import Component
from sources.effect import Effect
from sources.effect_model import EffectModel
from sources.model import Attachment, Model
from sources.quantity import Quantity

TAU_C = Quantity("tau_c", "N.m", "friction torque, 0 = absent", start=0.5, strength=True)
W_0 = Quantity("w_0", "rad/s", "speed over which the sign is smoothed", start=2e-3)
FRICTION = Effect("friction", "Friction.", ("rotation",), TAU_C)


def law(e: EffectModel) -> None:
    p, s = e.parameters(W_0, f_c=TAU_C), e.signals("load", v="velocity")
    e.add(-p.f_c * s.load * ca.tanh(s.v / p.w_0))
    with pytest.raises(AttributeError, match=r"^no symbol 'tau_c'; declared are w_0, f_c$"):
        _ = p.tau_c


def test_symbols_of_a_formula_stand_for_quantities_and_signals() -> None:
    m = Model(
        Component("shaft", "A shaft.", energy=False),
        "test",
        attachments=(Attachment(FRICTION, law),),
    )
    w, load = ca.SX.sym("w"), ca.SX.sym("load")
    shaft = m.balance("shaft", "rotation", velocity=w, load=load)
    # declared under the quantities' names, in the order of the call
    assert [v.name for v in m.of_role("parameter")] == ["friction.w_0", "friction.tau_c"]
    values = [v.symbol for v in m.of_role("parameter")]
    effort = ca.Function("effort", [*values, w, load], [shaft.effort])
    assert float(effort(2.0, 0.5, 1e3, 3.0)) == -1.5
