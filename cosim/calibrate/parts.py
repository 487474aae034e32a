"""What a calibration problem consists of: parameters, channels, runs, derivatives."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..data.signals import Signal
from ..errors import ValueRangeError
from ..fmu.variables import Variable
from ..spec.hints import NO_HINTS, SearchHints
from ..spec.units import parse
from .whitening import InputNoise

Vector = NDArray[np.float64]
Role = Literal["declared", "nuisance", "effect"]
PURPOSE = "identification"
"""Of runs that are fitted."""
COINCIDENT = 1e-3
"""Fraction of a sample interval within which sample times and recorded times are the same (logs
keep times rounded, often to 32 bits)."""
ROOM, ROOM_OF_STRENGTHS = 100.0, 1e4
"""Bounds of what an effect has brought, over its start value, where its FMU says none. Strengths
start at those of a motor's shaft: behind a gear of a hundred, what damps is its square larger."""
SHIFTS = 32
"""Shifts whose places are kept; channels have two or three."""
CLOCK, DRIFT = "clock:", "drift:"
"""Begins the name of a target that is no variable of the system: `clock:CHANNEL` or `clock:INPUT`,
how late the clock of a channel, or of the column that drives an input, is [s]; and what follows
where it is how much later it becomes in a run, per time: `clock:drift:CHANNEL`."""
COLUMN, GAIN, BIAS = "column:", "gain:", "bias:"
ZERO_DRIFT = "zero_drift:"
WAVE, CYCLES, PHASE = "wave:", "cycles:", "phase:"
"""The same for what a recorder makes of a column: `column:gain:CHANNEL`, `column:bias:CHANNEL`."""
LOGGED = (CLOCK, COLUMN)
NO_ERRORS: Mapping[str, float] = {}


@dataclass(frozen=True)
class Coarse:
    """How a system is run where thousands of simulations count more than the last digit.

    Attributes:
        step: communication step [s].
        options: of the master's algorithm.
        parameters: full variable name -> value, e.g. longer internal steps and sample periods.
    """

    step: float
    options: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Parameter:
    """An uncertain value.

    Attributes:
        name, unit, text: for people.
        nominal, minimum, maximum: start value and bounds.
        targets: (full variable name, factor) that it sets, or `clock:CHANNEL`, `clock:INPUT`,
            `column:gain:CHANNEL`, `column:bias:CHANNEL`.
        role: `declared` (rig sheet), `nuisance` (nobody asks for it), `effect`.
        run: name of the only run that it concerns, "" for all.
        prior: standard deviation around the nominal value that is known beforehand, None if nothing
            but the bounds is.
        strength: whether 0 makes an effect absent exactly.
        span: size of a typical change; the distance of the bounds if not given.
        inverse: the targets get factor / value: a compliance that sets a stiffness.
        hints: what a search for it should know; variables are named with their instance.
        late: held, and estimated run by run once a model explains the data (`nuisance.released`).
    """

    name: str
    unit: str
    nominal: float
    minimum: float
    maximum: float
    targets: tuple[tuple[str, float], ...]
    role: Role = "declared"
    run: str = ""
    prior: float | None = None
    strength: bool = False
    span: float = 0.0
    text: str = ""
    inverse: bool = False
    hints: SearchHints = NO_HINTS
    late: bool = False

    def set(self, value: float) -> dict[str, float]:
        """Full variable name -> value."""
        if self.inverse:
            value = 1.0 / max(value, self.minimum)
        return {name: factor * value for name, factor in self.targets}

    @property
    def scale(self) -> float:
        """Size of a typical change."""
        return self.span or self.maximum - self.minimum

    @property
    def absent(self) -> float:
        """Value of a strength with which its effect does nothing."""
        return self.minimum if self.inverse else 0.0


@dataclass(frozen=True)
class Channel:
    """A measured quantity and what it is in the model.

    Attributes:
        name: of the column.
        unit: of the column.
        sigma: standard deviation of its noise, rounding included.
        signal: full variable name.
        gain, offset: column = gain * signal + offset.
        transform: `sample`; `mean` or `difference` over the `window` before the sample.
        window: [s].
        shift: the column's value at t is the signal's at t + shift [s], where the exchange delays
            the signal.
        by: sensor of the system that takes part in it though the signal is not its own; what is
            wrong with that sensor shows in the channel, and not in the model of it.
    """

    name: str
    unit: str
    sigma: float
    signal: str
    gain: float = 1.0
    offset: float = 0.0
    transform: str = "sample"
    window: float = 0.0
    shift: float = 0.0
    by: str = ""

    def of(
        self, sampler: Sampler, values: Vector, errors: Mapping[str, float] = NO_ERRORS
    ) -> Vector:
        """What the channel would read, of a signal that was recorded at the sampler's times.

        Args:
            sampler: of the run.
            values: of the signal.
            errors: of the log, see `Problem.log_errors`.
        """
        shift = self.shift - errors.get(self.name, 0.0)
        drift = errors.get(DRIFT + self.name, 0.0)
        if self.transform == "sample":
            result = sampler.at(shift, values, drift)
        elif self.transform == "difference":
            before = sampler.at(shift - self.window, values, drift)
            result = (sampler.at(shift, values, drift) - before) / self.window
        else:
            times, recorded = sampler.drifted(shift, drift), sampler.recorded
            steps = np.diff(recorded) * 0.5 * (values[1:] + values[:-1])
            integral = np.concatenate([[0.0], np.cumsum(steps)])
            first = np.maximum(times - self.window, recorded[0])
            width = np.maximum(times - first, 1e-12)
            mean = np.interp(times, recorded, integral) - np.interp(first, recorded, integral)
            result = np.where(times > first, mean / width, values[0])
        gain = self.gain * (1.0 + errors.get(GAIN + self.name, 0.0))
        reading = gain * result + self._zero(sampler, errors)
        return np.asarray(reading + self._wave(reading, errors), dtype=np.float64)

    @property
    def angle(self) -> float:
        """One of its unit, where that is one of angles [rad]; 1 where nobody says it."""
        return parse(self.unit).factor if self.unit else 1.0

    def _zero(self, sampler: Sampler, errors: Mapping[str, float]) -> Vector | float:
        """What is read where there is nothing."""
        zero = self.offset + errors.get(BIAS + self.name, 0.0)
        rate = errors.get(ZERO_DRIFT + self.name, 0.0)
        return zero + rate * (sampler.times - sampler.begin) if rate else zero

    def _wave(self, reading: Vector, errors: Mapping[str, float]) -> Vector | float:
        """What repeats with the reading of an angle."""
        if not (size := errors.get(WAVE + self.name, 0.0)):
            return 0.0
        turns, phase = errors.get(CYCLES + self.name, 1.0), errors.get(PHASE + self.name, 0.0)
        return np.asarray(size * np.sin(turns * self.angle * reading + phase), dtype=np.float64)

    def meant(
        self, sampler: Sampler, data: Vector, errors: Mapping[str, float] = NO_ERRORS
    ) -> Vector:
        """Values of the signal for which the channel reads this; of `sample` channels.

        Args:
            sampler: of the run.
            data: as logged.
            errors: of the log, see `Problem.log_errors`; a wave is taken where the reading is, so
                what it misses is of second order in its size.
        """
        gain = self.gain * (1.0 + errors.get(GAIN + self.name, 0.0))
        read = data - self._wave(data, errors) - self._zero(sampler, errors)
        return np.asarray(read / gain, dtype=np.float64)


class Sampler:
    """Reads recorded signals at the sample times of a run.

    Places are sought once for all channels that are read at the same shift.

    Args:
        times: at which sensors sample [s].
        recorded: at which the signals were recorded [s], rising.
        begin: since when clocks drift [s]; the first of `times` if not given.
    """

    def __init__(self, times: Vector, recorded: Vector, begin: float | None = None) -> None:
        self.times, self.recorded = times, recorded
        self.begin = times[0] if begin is None else begin
        self._places: dict[tuple[float, float], tuple[NDArray[np.intp], Vector | None]] = {}

    def drifted(self, shift: float, drift: float) -> Vector:
        """Sample times plus a shift [s], less what a clock has lost since the begin."""
        times = self.times + shift
        return times - drift * (self.times - self.begin) if drift else times

    def at(self, shift: float, values: Vector, drift: float = 0.0) -> Vector:
        """Values at `drifted` sample times, between recorded ones on straight lines."""
        place, past = self._places.get((shift, drift)) or self._sought(shift, drift)
        if past is None:
            return np.asarray(values[place], dtype=np.float64)
        first = values[place]
        slope = (values[place + 1] - first) / (self.recorded[place + 1] - self.recorded[place])
        return np.asarray(slope * past + first, dtype=np.float64)

    def _sought(self, shift: float, drift: float) -> tuple[NDArray[np.intp], Vector | None]:
        """Recorded times at or before the sample times, and how far behind these are.

        Where all coincide, None is behind.
        """
        times, recorded = self.drifted(shift, drift), self.recorded
        last = recorded.size - 1
        interval = recorded[1] - recorded[0] if last else 1.0
        found: tuple[NDArray[np.intp], Vector | None]
        nearest = np.rint((times - recorded[0]) / interval).astype(np.intp).clip(0, last)
        if not last or np.max(np.abs(times - recorded[nearest])) <= COINCIDENT * interval:
            found = nearest, None
        else:
            held = times.clip(recorded[0], recorded[-1])
            before = (np.searchsorted(recorded, held, "right") - 1).clip(0, last - 1)
            found = before, held - recorded[before]
        if len(self._places) >= SHIFTS:  # a clock that is being estimated has ever new ones
            self._places.clear()
        self._places[shift, drift] = found
        return found


@dataclass(frozen=True)
class MeasuredRun:
    """A measured run.

    Attributes:
        name: of the run.
        purpose: `identification` or `validation`.
        times: sample times [s].
        data: one row per sample, one column per channel of the problem; gaps are NaN.
        inputs: what drives the system's open inputs.
        starts: full variable name -> start value that is known for this run.
        values: entries of the run in its description.
        lead: the simulation begins this much before the first sample [s].
        anchor: sample in whose frame relative poses are given.
        noisy: driven input -> standard deviation of the noise with which it was logged, in the
            input's unit; negative where the input is its column turned round.
        noise: what that adds to residuals, None if nothing (`input_noise.propagated`).
        unsure: start value that was read off a column -> deviation of that column's noise.
    """

    name: str
    purpose: str
    times: Vector
    data: Vector
    inputs: Mapping[str, Signal]
    starts: Mapping[str, float] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)
    lead: float = 0.0
    anchor: int = 0
    noisy: Mapping[str, float] = field(default_factory=dict)
    noise: InputNoise | None = None
    unsure: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def interval(self) -> float:
        """The usual time between samples [s]."""
        return float(np.median(np.diff(self.times)))

    @property
    def logged(self) -> Vector:
        """Times of the samples in the log, before which the model may have begun [s]."""
        return self.times - self.lead

    def white(self, rows: Vector) -> Vector:
        """Residuals, or derivatives of model values, over their noise, made white."""
        return rows if self.noise is None else self.noise.white(rows)


class Target(NamedTuple):
    """What one parameter sets.

    Attributes:
        name: full variable name, or an error of the log.
        place: of the parameter.
        factor: on its value.
        least: of a value whose inverse counts; None where the value itself does.
    """

    name: str
    place: int
    factor: float
    least: float | None


class Targets:
    """Several targets, whose values are computed together.

    Attributes:
        names: theirs, in order.
    """

    def __init__(self, targets: Sequence[Target]) -> None:
        self.names = tuple(target.name for target in targets)
        self._places = np.array([target.place for target in targets], dtype=np.intp)
        self._factors = np.array([target.factor for target in targets])
        inverse = [(k, t.least) for k, t in enumerate(targets) if t.least is not None]
        self._inverse = np.array([k for k, _ in inverse], dtype=np.intp)
        self._least = np.array([least for _, least in inverse])

    def of(self, theta: Vector) -> Vector:
        """Their values, where the parameters have these."""
        values = np.asarray(theta, dtype=float)[self._places]
        if self._inverse.size:
            values[self._inverse] = 1.0 / np.maximum(values[self._inverse], self._least)
        return np.asarray(self._factors * values)


def targets_of(parameters: Sequence[Parameter], run: str | None = None) -> list[Target]:
    """What parameters set, those of all runs and of this one; of any run if none is given."""
    return [
        Target(name, index, factor, p.minimum if p.inverse else None)
        for index, p in enumerate(parameters)
        if run is None or p.run in ("", run)
        for name, factor in p.targets
    ]


class Assigned(NamedTuple):
    """What is set in one run, sorted once for thousands of simulations.

    Attributes:
        run: which.
        known: full variable name -> value that no parameter changes.
        errors: the same of the log: `CHANNEL` or `INPUT` of a clock, `drift:CHANNEL`, and so on.
        variables, log: what parameters set.
        size: how many parameters there are.
    """

    run: MeasuredRun
    known: Mapping[str, float]
    errors: Mapping[str, float]
    variables: Targets
    log: Targets
    size: int

    @classmethod
    def among(
        cls,
        parameters: Sequence[Parameter],
        run: MeasuredRun,
        known: Mapping[str, float],
        given: Mapping[str, float],
    ) -> Assigned:
        """What these parameters set, over what is known of variables and given of the log."""
        targets = targets_of(parameters, run.name)
        return cls(
            run,
            {name: value for name, value in known.items() if not name.startswith(LOGGED)},
            {_bare(n): v for n, v in given.items() if n.startswith(LOGGED)},
            Targets([t for t in targets if not t.name.startswith(LOGGED)]),
            Targets([t._replace(name=_bare(t.name)) for t in targets if t.name.startswith(LOGGED)]),
            len(parameters),
        )

    def of(self, theta: Vector, targets: Targets) -> dict[str, float]:
        """Targets of the parameters with these values -> values."""
        if theta.size != self.size:
            raise ValueError(f"{theta.size} values for {self.size} parameters")
        if not targets.names:
            return {}
        return dict(zip(targets.names, targets.of(theta).tolist(), strict=True))


def _bare(target: str) -> str:
    """Target of the log without what says that it is one."""
    return target.removeprefix(CLOCK).removeprefix(COLUMN)


class Sensitivity(NamedTuple):
    """Derivatives of a run's model values over sigma.

    Attributes:
        run: its name.
        columns: indices of the parameters that concern it.
        values: (samples, channels, columns); NaN where nothing was measured.
        roughness: half the difference between the derivatives on both sides, zeros where one was
            taken, None where all are such; large where the model jumps.
    """

    run: str
    columns: NDArray[np.intp]
    values: Vector
    roughness: Vector | None


def free_parameter(
    variable: Variable, name: str, target: str, *, strength: bool, hints: SearchHints = NO_HINTS
) -> Parameter:
    """A parameter that a variant has brought, at its FMU's value; a strength begins at 0.

    Args:
        variable: of the FMU.
        name: of the parameter.
        target: full variable name.
        strength: whether 0 is exact absence.
        hints: of the FMU, as they are in the system.
    """
    start = float(variable.start[0] or 0.0) if variable.start else 0.0
    span = abs(start) or variable.nominal or 1.0
    room = (ROOM_OF_STRENGTHS if strength else ROOM) * span
    low = -room if variable.minimum is None else variable.minimum
    high = room if variable.maximum is None else variable.maximum
    return Parameter(
        name, variable.symbol, 0.0 if strength else start, low, high, ((target, 1.0),), "effect",
        strength=strength, span=span, text=variable.text, hints=hints,
    )  # fmt: skip


def adjustable(variable: Variable) -> bool:
    """Whether a variable is a scalar parameter of the model, and not of its solver."""
    return (
        variable.causality == "parameter"
        and variable.type == "Float64"
        and variable.size == 1
        and not variable.name.startswith("solver.")
    )


def natural(variable: Variable, strengths: Collection[str]) -> bool:
    """Whether a parameter of an effect is one of nature's, for which data may be asked.

    What can only be set beforehand and is no strength says how a law is computed: grids, how far
    back a memory reaches, seeds. Data prefer one by what it makes of rounding.
    """
    return adjustable(variable) and (variable.variability != "fixed" or variable.name in strengths)


def check_parameters(parameters: Iterable[Parameter]) -> None:
    """Refuse bounds that are empty or do not hold the nominal value.

    Raises:
        ValueRangeError: with the parameter.
    """
    for p in parameters:
        if not p.minimum <= p.nominal <= p.maximum or not p.minimum < p.maximum:
            raise ValueRangeError(
                f"parameter {p.name}: nominal {p.nominal:g} is not within {p.minimum:g} to "
                f"{p.maximum:g} {p.unit}"
            )
