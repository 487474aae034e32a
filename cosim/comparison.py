"""How far a recording is from a reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import UnitError, ValueRangeError
from .recording import Recording
from .units import conversion, parse

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Reference:
    """What a signal is compared with.

    Attributes:
        signal: name in the recording.
        times, values: samples; gaps are NaN.
        unit: of the values, "" if the signal's.
        text: where it comes from.
    """

    signal: str
    times: Vector
    values: Vector
    unit: str
    text: str


@dataclass(frozen=True)
class Comparison:
    """Differences `simulated - reference` on the reference's time grid, in the signal's unit.

    Attributes:
        signal: name in the recording.
        unit: of the signal.
        rms, max: root mean square and largest magnitude of the differences.
        count: number of samples compared.
        reference: where the reference comes from.
        times, differences: the differences themselves.
    """

    signal: str
    unit: str
    rms: float
    max: float
    count: int
    reference: str
    times: Vector
    differences: Vector


def convert_reference(recording: Recording, reference: Reference) -> Vector:
    """The reference's values in the signal's unit.

    Raises:
        UnitError: the units do not convert.
    """
    unit = recording.units.get(reference.signal, "")
    if not reference.unit or not unit:
        return reference.values
    try:
        gain, offset = conversion(parse(reference.unit), parse(unit))
    except UnitError as error:
        raise UnitError(
            f"cannot compare {reference.signal} with {reference.text}: {error}"
        ) from None
    return reference.values * gain + offset


def compare(recording: Recording, reference: Reference) -> Comparison:
    """Compare a signal with a reference.

    The recording is interpolated linearly to the reference's times; samples outside the recording
    and gaps (NaN) are left out.

    Raises:
        UnknownNameError: the signal was not recorded.
        UnitError: the units do not convert.
        ValueRangeError: no sample of the reference lies within the recording.
    """
    values = convert_reference(recording, reference)
    simulated = recording[reference.signal]
    margin = 1e-9  # sample times and k * h differ by rounding
    inside = (
        np.isfinite(values)
        & (reference.times >= recording.time[0] - margin)
        & (reference.times <= recording.time[-1] + margin)
    )
    times = reference.times[inside]
    if not times.size:
        raise ValueRangeError(
            f"{reference.text}: no sample lies within the recording of {reference.signal} "
            f"({recording.time[0]:g} s to {recording.time[-1]:g} s)"
        )
    differences = np.interp(times, recording.time, simulated) - values[inside]
    return Comparison(
        signal=reference.signal,
        unit=recording.units.get(reference.signal, ""),
        rms=float(np.sqrt(np.mean(differences**2))),
        max=float(np.max(np.abs(differences))),
        count=int(times.size),
        reference=reference.text,
        times=times,
        differences=differences,
    )
