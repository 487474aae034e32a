"""Law given by numbers: a smooth curve of one signal, or a smooth surface over two.

    u = g sum_k sum_m c_km N_k(x) P_m(y),   x = wx_time t + sum_i wx_i s_i,   y likewise

s_i are the scalar signals of the balance (speed, angle, load, ...). N_1 ... N_12 are cubic
B-splines on knots that are equally spaced in asinh(x / x_scale) from `x_first` to `x_last`: dense
around 0 where the scale is small, equally spaced in x where it is large. N_13 = tanh(x / x_0) is
the jump at 0 that no smooth curve has (dry friction). P_1 ... P_8 are cubic B-splines on equally
spaced knots from `y_first` to `y_last`, on a circle of that circumference where `turn` is 1, of |y|
where `fold` is 1. Beyond the first and last knot, u keeps its value there. With the same c_km for
all m, u depends on x alone.

Not modelled: memory (hysteresis), more than two signals.

Source: de Boor, A Practical Guide to Splines, 2001, ch. 9.
"""

from __future__ import annotations

import casadi as ca

from ..effect import KINDS, Effect
from ..effect_model import EffectModel
from ..laws.drivers import MOVING, drivers, shared
from ..model import SX
from ..quantity import Quantity

ALONG_X, ALONG_Y = 12, 8
"""Splines along x (without the jump) and y. Cubic splines of 9 intervals follow a curve with a
rise, a peak and a fall; 8 on a circle follow three harmonics to a few per cent."""

G = Quantity("g", "1", "factor on the law, 0 = absent", start=1.0, strength=True)
C = Quantity(
    "c",
    "1",
    "values of the law, c[(k - 1) 8 + m] for spline k of x (13: the jump) and m of y",
    start=(0.0,) * (ALONG_X * ALONG_Y) + (-0.01,) * ALONG_Y,
    size=(ALONG_X + 1) * ALONG_Y,
)
X_FIRST = Quantity("x_first", "1", "x at its first knot", start=-1.0)
X_LAST = Quantity("x_last", "1", "x at its last knot", start=1.0)
X_SCALE = Quantity("x_scale", "1", "x around which its knots are dense", start=1e3, minimum=1e-12)
X_0 = Quantity("x_0", "1", "x over which the jump is smoothed", start=1e-2, minimum=1e-12)
Y_FIRST = Quantity("y_first", "1", "y at its first knot", start=0.0)
Y_LAST = Quantity("y_last", "1", "y at its last knot", start=1.0)
TURN = Quantity("turn", "1", "1 where the law repeats with y, else 0", minimum=0.0, maximum=1.0)
FOLD = Quantity("fold", "1", "1 where y counts without its sign, else 0", minimum=0.0, maximum=1.0)
SHARE = Quantity("share", "1", "part of it that each element of the balance gets", start=1.0)
X = Quantity("x", "1", "first signal that the law depends on")
Y = Quantity("y", "1", "second signal that the law depends on")
U = Quantity("u", "1", "effort or error that the law gives")

EFFECT = Effect(
    "fitted_law",
    "Law given by numbers, as a log tells it.",
    MOVING,
    G,
    source="de Boor 2001",
    probe=True,
)


def law(e: EffectModel) -> None:
    """Add the law's value."""
    share = shared(e, SHARE)
    known = {"time": e.t, **drivers(e, share)}
    names, signals = list(known), list(known.values())
    p = e.parameters(G, C, X_FIRST, X_LAST, X_SCALE, X_0, Y_FIRST, Y_LAST, TURN, FOLD)
    x, y = (
        sum(
            (e.parameter(_weight(axis, name, axis + name == default)) * signal
             for name, signal in zip(names, signals, strict=True)),
            ca.SX(0),
        )
        for axis, default in (("x", "x" + names[-1 if len(names) == 1 else 1]), ("y", ""))
    )  # fmt: skip
    y = p.fold * ca.fabs(y) + (1 - p.fold) * y
    first, last, place = (ca.asinh(value / p.x_scale) for value in (p.x_first, p.x_last, x))
    intervals = ALONG_X - 3
    place = intervals * (place - first) / (last - first)
    place = ca.fmin(ca.fmax(place, 0.0), intervals)
    along_x = [_spline(place - (k - 1)) for k in range(ALONG_X)] + [ca.tanh(x / p.x_0)]
    intervals = ALONG_Y - 3 + 3 * p.turn
    place = intervals * (y - p.y_first) / (p.y_last - p.y_first)
    held = ca.fmin(ca.fmax(place, 0.0), intervals)
    place = p.turn * place + (1 - p.turn) * held
    along_y = []
    for m in range(ALONG_Y):
        away = place - m + (1 - p.turn)
        away -= p.turn * ALONG_Y * ca.floor(away / ALONG_Y + 0.5)
        along_y.append(_spline(away))
    u = p.g * sum(
        (n * ca.dot(p.c[k * ALONG_Y : (k + 1) * ALONG_Y], ca.vertcat(*along_y))
         for k, n in enumerate(along_x)),
        ca.SX(0),
    )  # fmt: skip
    e.output(X, x)
    e.output(Y, y)
    e.output(U, u)
    u = u * share
    e.add(u)
    flow = KINDS[e.kind].flow
    if flow:
        e.supply(u * e.signal(flow))
    elif e.kind == "body":
        e.supply(ca.dot(u[:3], e.signal("velocity")) + ca.dot(u[3:], e.signal("rate")))
    e.loss(0)


def _weight(axis: str, signal: str, default: bool) -> Quantity:
    return Quantity(f"w{axis}_{signal}", "1", f"weight of {signal} in {axis}", start=float(default))


def _spline(away: SX) -> SX:
    """Cubic B-spline on knots one apart, this far from its middle."""
    distance = ca.fabs(away)
    near, far = ca.fmax(1 - distance, 0), ca.fmax(2 - distance, 0)
    return (far**3 - 4 * near**3) / 6
