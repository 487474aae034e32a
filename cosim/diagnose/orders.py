"""How often per turn does something repeat? Orders of a residual over the angle of a shaft.

A force that repeats n times per turn goes through the system to every channel at n times the
shaft's speed, however it is weakened and delayed on its way. Over stretches of a few turns, on
which the speed hardly changes, with a window w against leakage, a parabola over time taken away
from residual r and wave exp(-i n theta(t - d)) alike, and R_n what a wave leaves,

    g = M/2 ln(|w r|^2 / |w R_n|^2),    P(n) = max over lags d of
        sum over stretches and channels of  ln(1 + exp(g) / M)

where g is what the wave gains in log likelihood beside noise of unknown size, for M independent
samples. What a stretch holds besides does not count, be it ever so large, nor does a shaft at rest.
A wave shows where speed and loops let it, so each stretch and channel may have it or not, at even
odds; that it has one costs two parameters, ln M (Schwarz). No model of the system between the shaft
and the channels is needed, and no list of usual orders.

Source: order tracking, Fyfe and Munck, Mech. Syst. Signal Process. 11(2), 1997.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
HIGHEST = 200
"""Cycles per turn: teeth, slots and poles of what robots have, and their products, are fewer."""
PEAKS = 6
"""Orders worth a simulation each: neighbours of a peak leak, and other laws have orders, too."""
TURNS = 2.0
"""Turns in a stretch: with fewer, a window mixes an order with its neighbours; with more, the speed
changes, and with it how late the force arrives."""
LEAST = 8
"""Samples in a stretch below which a window leaves nothing to tell orders apart."""
SLOW = 2
"""Degree of what is slow: drift and one bend of a stretch; an order has two periods or more."""
GRAIN, MOST = 1e-3, 1.0 - 1e-9
"""Share of a wave's square that must be left for it to count; share of a residual that it may
explain, since logarithms end there."""
LAGS = (0.0, 0.002, 0.004, 0.008, 0.016)
"""How late a force may arrive [s]. A lag that is wrong by d turns the phase by n d times the change
of speed within a stretch, which hides an order once that is a turn; loops of drives and links take
between a tick and some 20 ms."""
TURNED = 0.1
"""Phase [rad] that a lag may turn within a stretch beside what it turns all of it, for the wave to
count as the one without lag: it hides a hundredth of its square at most."""
CHUNK = 4096
"""Samples whose waves are held at once: a shaft at rest is one long stretch."""


def spectrum(
    times: Sequence[Vector], angles: Sequence[Vector], residuals: Sequence[Vector]
) -> Vector:
    """P(n) of the orders 1 to `HIGHEST`, one row per run.

    Args:
        times: of the samples of each run [s].
        angles: of the shaft there [rad].
        residuals: (samples, channels) of each run over the noise, NaN in gaps.
    """
    runs = zip(times, angles, residuals, strict=True)
    return np.array([_power(*run) for run in runs])


def _power(time: Vector, angle: Vector, residual: Vector) -> Vector:
    """P(n) of one run."""
    power = np.zeros((len(LAGS), HIGHEST))
    paths = np.array([np.interp(time - lag, time, angle) for lag in LAGS])
    turns = np.cumsum(np.abs(np.diff(angle, prepend=angle[:1]))) / (2.0 * np.pi)
    first = np.flatnonzero(np.diff(np.floor(turns / TURNS), prepend=-1.0))
    for begin, end in zip(first, [*first[1:], angle.size], strict=True):
        if end - begin < LEAST:
            continue
        rows = np.nan_to_num(residual[begin:end])
        prompt = _gained(paths[0, begin:end], rows, 1)
        for place, path in enumerate(paths[:, begin:end]):
            # at a speed that stays the same, a lag turns the phase alone, and changes no gain
            turned = float(np.ptp(path - paths[0, begin:end]))
            same = HIGHEST if turned * HIGHEST <= TURNED else int(TURNED / turned)
            gained = prompt[:same]
            if same < HIGHEST:
                gained = np.concatenate([gained, _gained(path, rows, same + 1)])
            power[place] += gained
    return np.asarray(np.max(power, axis=0))


def _gained(angle: Vector, rows: Vector, lowest: int) -> Vector:
    """Summands of P(n) of one stretch, n from the lowest order on."""
    orders = HIGHEST + 1 - lowest
    window = np.hanning(angle.size)
    time = np.linspace(-1.0, 1.0, angle.size)
    slow, _ = np.linalg.qr(window[:, None] * time[:, None] ** np.arange(SLOW + 1))
    own = window[:, None] * rows
    own -= slow @ (slow.T @ own)
    columns = window[:, None] * np.hstack([own, slow])
    weights, channels = window**2, rows.shape[1]
    products = np.zeros((2, orders, columns.shape[1]))
    squares, mixed = np.zeros(orders), np.zeros(orders)
    for part in range(0, angle.size, CHUNK):
        piece = slice(part, part + CHUNK)
        waves = _waves(angle[piece], lowest)
        cosine, sine = np.ascontiguousarray(waves.real), np.ascontiguousarray(waves.imag)
        products += np.stack([cosine @ columns[piece], sine @ columns[piece]])
        sine *= cosine
        mixed += sine @ weights[piece]
        cosine *= cosine
        squares += cosine @ weights[piece]
    crossed, absorbed = products[..., :channels], products[..., channels:]
    # what the parabola does not absorb of cosine and sine, and a grain against what is left of none
    size = float(np.sum(weights))
    gram = squares, size - squares, mixed
    a, b, c = (
        gram[k] - np.sum(absorbed[i] * absorbed[j], axis=1)
        for k, (i, j) in enumerate(((0, 0), (1, 1), (0, 1)))
    )
    a, b = a + GRAIN * size, b + GRAIN * size
    x, y = crossed
    shares = (b[:, None] * x**2 - 2.0 * c[:, None] * x * y + a[:, None] * y**2) / (
        (a * b - c**2)[:, None]
    )
    # noise has unit size: less than that is luck
    whole = np.maximum(np.sum(own**2, axis=0), size)
    count = size**2 / float(np.sum(window**4))
    gain = -0.5 * count * np.log1p(-np.minimum(shares / whole, MOST))
    return np.asarray(np.sum(np.logaddexp(0.0, gain - np.log(count)), axis=1))


def _waves(angle: Vector, lowest: int) -> NDArray[np.complex128]:
    """exp(i n theta) of the orders n from the lowest on, one row each."""
    orders = HIGHEST + 1 - lowest
    few = math.isqrt(orders - 1) + 1
    turn = np.exp(1j * angle)
    near = np.multiply.accumulate(np.broadcast_to(turn, (few, angle.size)), axis=0)
    far = np.multiply.accumulate(np.broadcast_to(near[-1], (few, angle.size)), axis=0)
    base = np.exp(1j * (lowest - 1) * angle)
    far = np.vstack([base, base * far[:-1]])
    return (far[:, None] * near).reshape(-1, angle.size)[:orders]


def peaks(power: Vector, most: int = PEAKS) -> list[float]:
    """The orders at local maxima, those that stand out most first; as many as there may be.

    An order stands out of the spectrum of one run, or of all together, whichever is more: it may
    show only in the run in which its shaft turns slowly enough.

    Args:
        power: P(n), one row per run.
        most: orders to give.
    """
    rows = np.vstack([power, power.sum(axis=0)])
    middle = np.median(rows, axis=1, keepdims=True)
    spread = np.median(np.abs(rows - middle), axis=1, keepdims=True)
    out = np.max(np.divide(rows - middle, spread, where=spread > 0.0, out=0.0 * rows), axis=0)
    padded = np.concatenate([[-np.inf], out, [-np.inf]])
    local = (out >= padded[:-2]) & (out >= padded[2:])
    ranked = np.argsort(np.where(local, -out, np.inf), kind="stable")
    return [float(n + 1) for n in ranked[: min(most, int(local.sum()))]]
