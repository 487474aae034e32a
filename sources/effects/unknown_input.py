"""Unknown effort or error at a balance, as a curve against what may drive it.

    u = g sum_k c_k B_k(s),   s = w_time t + sum_i w_i x_i

with hat functions B_k on equally spaced knots from `s_first` to `s_last`, constant beyond them, and
x_i the scalar signals of the balance (speed, angle, load, ...). A probe to find out where and on
what a missing effect acts; it says nothing about why.

Not modelled: memory (hysteresis), curves over two drivers at once.

Source: interpolation by hat functions (linear finite elements).
"""

from __future__ import annotations

import casadi as ca

from ..effect import KINDS, Effect
from ..effect_model import EffectModel
from ..laws.drivers import MOVING, drivers, shared
from ..quantity import Quantity

KNOTS = 9
G = Quantity("g", "1", "factor on the curve, 0 = absent", start=1.0, strength=True)
C = Quantity("c", "1", "value at each knot", start=0.01, size=KNOTS)
S_FIRST = Quantity("s_first", "1", "driver at the first knot", start=0.0)
S_LAST = Quantity("s_last", "1", "driver at the last knot", start=1.0)
SHARE = Quantity("share", "1", "part of it that each element of the balance gets", start=1.0)
S = Quantity("s", "1", "what drives the curve")
U = Quantity("u", "1", "the unknown effort or error")

EFFECT = Effect(
    "unknown_input",
    "Curve of an unknown effort against its driver.",
    MOVING,
    G,
    source="hat functions",
    probe=True,
)


def law(e: EffectModel) -> None:
    """Add the curve's value."""
    p = e.parameters(G, C, S_FIRST, S_LAST)
    share = shared(e, SHARE)
    s = e.parameter(_weight("time", 1.0)) * e.t
    for name, signal in drivers(e, share).items():
        s += e.parameter(_weight(name, 0.0)) * signal
    place = (KNOTS - 1) * (s - p.s_first) / (p.s_last - p.s_first)
    place = ca.fmin(ca.fmax(place, 0.0), KNOTS - 1.0)
    u = ca.SX(0)
    for k in range(KNOTS):
        u += p.c[k] * ca.fmax(1 - ca.fabs(place - k), 0)
    u *= p.g
    e.output(S, s)
    e.output(U, u)
    u = u * share
    e.add(u)
    flow = KINDS[e.kind].flow
    if flow:
        e.supply(u * e.signal(flow))
    elif e.kind == "body":
        e.supply(ca.dot(u[:3], e.signal("velocity")) + ca.dot(u[3:], e.signal("rate")))
    e.loss(0)


def _weight(signal: str, start: float) -> Quantity:
    return Quantity(f"w_{signal}", "1", f"weight of {signal} in what drives the curve", start=start)
