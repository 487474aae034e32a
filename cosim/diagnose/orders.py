"""How often per turn does something repeat? Orders of a residual over the angle of a shaft.

A force that repeats n times per turn goes through the system to every channel at n times the
shaft's speed, however it is weakened and delayed on its way. Over stretches of a few turns, on
which the speed hardly changes, with a window w against leakage,

    P(n) = max over lags d of sum over stretches and channels of
           |sum_k w_k r_k exp(-i n theta(t_k - d))|^2 / sum_k w_k^2

is large at the true n and, for noise of unit size, about the number of stretches elsewhere. No
model of the system between the shaft and the channels is needed, and no list of usual orders.

Source: order tracking, Fyfe and Munck, Mech. Syst. Signal Process. 11(2), 1997.
"""

from __future__ import annotations

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
LAGS = (0.0, 0.002, 0.004, 0.008, 0.016)
"""How late a force may arrive [s]. A lag that is wrong by d turns the phase by n d times the change
of speed within a stretch, which hides an order once that is a turn; loops of drives and links take
between a tick and some 20 ms."""
CHUNK = 4096
"""Samples whose waves are held at once: a shaft at rest is one long stretch."""


def spectrum(
    times: Sequence[Vector], angles: Sequence[Vector], residuals: Sequence[Vector]
) -> Vector:
    """Power P(n) of the orders 1 to `HIGHEST`.

    Args:
        times: of the samples of each run [s].
        angles: of the shaft there [rad].
        residuals: (samples, channels) of each run over the noise, NaN in gaps.
    """
    power = np.zeros((len(LAGS), HIGHEST))
    for time, angle, residual in zip(times, angles, residuals, strict=True):
        for index, lag in enumerate(LAGS):
            power[index] += _power(np.interp(time - lag, time, angle), residual)
    return np.asarray(power.max(axis=0))


def _power(angle: Vector, residual: Vector) -> Vector:
    """P(n) of one run without a lag."""
    power, orders = np.zeros(HIGHEST), -1j * np.arange(1.0, HIGHEST + 1.0)
    turns = np.cumsum(np.abs(np.diff(angle, prepend=angle[:1]))) / (2.0 * np.pi)
    first = np.flatnonzero(np.diff(np.floor(turns / TURNS), prepend=-1.0))
    for begin, end in zip(first, [*first[1:], angle.size], strict=True):
        if end - begin < LEAST:
            continue
        window = np.hanning(end - begin)
        rows = np.nan_to_num(residual[begin:end]) * window[:, None]
        wave = np.zeros((HIGHEST, rows.shape[1]), dtype=np.complex128)
        for part in range(0, end - begin, CHUNK):
            turned = np.outer(orders, angle[begin + part : min(begin + part + CHUNK, end)])
            wave += np.exp(turned) @ rows[part : part + CHUNK]
        power += np.sum(np.abs(wave) ** 2, axis=1) / float(window @ window)
    return power


def peaks(power: Vector, most: int = PEAKS) -> list[float]:
    """The orders at local maxima of the spectrum, the highest first; as many as there may be."""
    padded = np.concatenate([[0.0], power, [0.0]])
    local = (power >= padded[:-2]) & (power >= padded[2:])
    ranked = np.argsort(np.where(local, -power, np.inf), kind="stable")
    return [float(n + 1) for n in ranked[: min(most, int(local.sum()))]]
