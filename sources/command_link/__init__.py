"""The way of a command from who gives it to who carries it out."""

from __future__ import annotations

from typing import Any

import casadi as ca

from ..component import Component
from ..model import Model
from ..quantity import Quantity
from ..trajectory import PHI_D, V_D, W_D, XD_D, YD_D

SX = Any

V_SET = Quantity("v_set", "m/s", "forward speed as commanded", start=0.3)
W_SET = Quantity("w_set", "rad/s", "yaw rate as commanded")
XD_SET = Quantity("xd_set", "m/s", "speed along the world's x axis as commanded")
YD_SET = Quantity("yd_set", "m/s", "speed along the world's y axis as commanded")
PHI_SET = Quantity("phi_set", "rad", "heading as commanded")

COMPONENT = Component(
    "command_link",
    "Command interface: the set motion of a base on its way to the controller.",
    device="lab",
    source="digital twin paper (the base gets its speeds through a network interface)",
    energy=False,
)


def commands(m: Model) -> SX:
    """The inputs as one column."""
    return ca.vertcat(*[m.input(q) for q in (V_SET, W_SET, XD_SET, YD_SET, PHI_SET)])


def deliver(m: Model, command: SX) -> None:
    """Outputs from the column that arrives, and the balances on the way.

    What is added to the forward speed is added to the world speeds along the set heading.
    """
    command += m.balance("command", "bundle", value=command).effort
    v_d, w_d, xd_d, yd_d, phi_d = ca.vertsplit(command)
    more = m.balance("speed", "signal", unit="m/s", value=v_d).effort
    m.output(V_D, v_d + more)
    m.output(W_D, w_d + m.balance("yaw_rate", "signal", unit="rad/s", value=w_d).effort)
    m.output(XD_D, xd_d + more * ca.cos(phi_d))
    m.output(YD_D, yd_d + more * ca.sin(phi_d))
    m.output(PHI_D, phi_d)
