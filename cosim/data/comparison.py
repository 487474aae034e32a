"""How far a recording is from a reference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import UnitError, ValueRangeError
from ..spec.units import Unit, change
from .recording import Recording

Vector = NDArray[np.float64]
ROUNDING = 1e-9
"""[s] Sample times, ends of windows and k * h differ by so much, or by four units in the last place
of large times: a product and a sum on either side."""


@dataclass(frozen=True)
class Reference:
    """What a signal, or a path of several signals, is compared with.

    Attributes:
        signals: names in the recording; of several, all of one unit, the distance is taken.
        times: sample times [s].
        values: samples, one column per signal; gaps are NaN.
        unit: of the values, "" if the signals'.
        text: where it comes from.
    """

    signals: tuple[str, ...]
    times: Vector
    values: Vector
    unit: str
    text: str

    @property
    def name(self) -> str:
        """The signals in one text."""
        return ", ".join(self.signals)


@dataclass(frozen=True)
class Comparison:
    """Differences `simulated - reference` on the reference's time grid, in the signals' unit.

    Attributes:
        signals: names in the recording.
        unit: of the signals.
        rms, max: root mean square and largest magnitude of the differences.
        count: number of samples compared.
        reference: where the reference comes from.
        times, differences: the differences themselves; of a path the distances.
        definition: of the unit, None where there is none or nobody knows it.
    """

    signals: tuple[str, ...]
    unit: str
    rms: float
    max: float
    count: int
    reference: str
    times: Vector
    differences: Vector
    definition: Unit | None = None

    def _repr_html_(self) -> str:
        from ..display.chart import Line, lines
        from ..display.html import quantity
        from ..display.notebook import key_values, view

        name = ", ".join(self.signals)
        return view(
            f"{name} against {self.reference}", f"{self.count} samples",
            key_values([("RMS", quantity(self.rms, self.unit)),
                        ("largest", quantity(self.max, self.unit))]),
            lines([Line(name, self.times, self.differences)],
                  title=f"simulated − reference [{self.unit}]"),
        )  # fmt: skip


def circle(times: Vector, start: Sequence[float], centre: Sequence[float], rate: float) -> Vector:
    """Points, one row per time, of a motion about a centre at a constant rate [rad/s]."""
    x, y = start[0] - centre[0], start[1] - centre[1]
    c, s = np.cos(rate * times), np.sin(rate * times)
    return np.column_stack([centre[0] + c * x - s * y, centre[1] + s * x + c * y])


def common_unit(units: Mapping[str, str], signals: Sequence[str]) -> str:
    """The unit of signals between which a distance is taken.

    Args:
        units: full scalar name -> unit.
        signals: full scalar names.

    Raises:
        UnitError: they have several.
    """
    found = list(dict.fromkeys(units.get(name, "") for name in signals))
    if len(found) > 1:
        raise UnitError(
            f"cannot take the distance of {', '.join(signals)}: their units are "
            f"{', '.join(found)}; take signals of one unit, or one by one"
        )
    return found[0] if found else ""


def _unit(recording: Recording, reference: Reference) -> str:
    return common_unit(recording.units, reference.signals)


def convert_reference(recording: Recording, reference: Reference) -> Vector:
    """The reference's values in the signals' unit, one column per signal.

    Raises:
        UnitError: the units do not convert.
    """
    unit = _unit(recording, reference)
    if not reference.unit or not unit:
        return reference.values
    found = []
    for name, values in zip(reference.signals, reference.values.T, strict=True):
        own = recording.unit(name)
        assert own is not None  # all have the same one
        try:
            gain, offset = change(reference.unit, own, difference=name in recording.relative)
        except UnitError as error:
            raise UnitError(f"cannot compare {name} with {reference.text}: {error}") from None
        found.append(values * gain + offset)
    return np.column_stack(found)


def within(times: Vector, first: float, last: float) -> NDArray[np.bool_]:
    """Which times lie between two, both of them taken in."""
    margin = ROUNDING + 4.0 * np.spacing(np.abs(times))
    return np.asarray((times >= first - margin) & (times <= last + margin))


def _span(times: Vector) -> str:
    known = times[np.isfinite(times)]
    return f"; they are at {known.min():.12g} s to {known.max():.12g} s" if known.size else ""


def _known(recording: Recording, name: str) -> Unit | None:
    try:
        return recording.unit(name)
    except UnitError:  # of a recording of somebody else
        return None


def compare(recording: Recording, reference: Reference) -> Comparison:
    """Compare a signal, or a path, with a reference.

    The recording is interpolated linearly to the reference's times; samples outside the recording
    and gaps (NaN) are left out.

    Raises:
        UnknownNameError: the signal was not recorded.
        UnitError: the units do not convert.
        ValueRangeError: no sample of the reference lies within the recording.
    """
    values = convert_reference(recording, reference)
    covered = within(reference.times, recording.time[0], recording.time[-1])
    inside = np.isfinite(values).all(axis=1) & covered
    times = reference.times[inside]
    if not times.size:
        raise ValueRangeError(
            f"{reference.text}: no sample lies within the recording of {reference.name} "
            f"({recording.time[0]:g} s to {recording.time[-1]:g} s){_span(reference.times)}"
        )
    apart = [
        np.interp(times, recording.time, recording[name]) - values[inside, column]
        for column, name in enumerate(reference.signals)
    ]
    differences = apart[0] if len(apart) == 1 else np.sqrt(np.sum(np.square(apart), axis=0))
    return Comparison(
        signals=reference.signals,
        unit=_unit(recording, reference),
        rms=float(np.sqrt(np.mean(differences**2))),
        max=float(np.max(np.abs(differences))),
        count=int(times.size),
        reference=reference.text,
        times=times,
        differences=differences,
        definition=_known(recording, reference.signals[0]),
    )
