"""A system at an operating point as a linear one: poles, open loops and their margins.

Each FMU gives x' = A x + B u, y = C x + D u by its directional derivatives; connections u = K y + e
close them, loops of direct feedthrough included:

    y = (I - D K)^-1 (C x + D e),   u = K y + e,   x' = A x + B u

An FMU that declares neither derivatives of states nor directional derivatives counts as static, its
D by differences; that is noted. FMUs with sampled values are linearized through their samples
(`sampled`), where their periods are known; else their values are held, and that is noted.

Source: Åström and Murray, Feedback systems, 2008, sections 6.4 and 10.3 (margins).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import AlgebraicLoopError, InputError, UnknownNameError, ValueRangeError, listing
from ..files import atomic
from ..fmu.instance import Instance
from ..fmu.values import NUMBERS
from ..master.execution import Execution
from ..master.initialization import initialize
from ..master.master import Master
from ..master.plan import Op, decoded
from ..spec.distribution import way_out
from ..system.inputs import Driver
from ..system.system import Member
from .sampled import matrices, period

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
INCREMENT = 1e-6
"""Of differences, relative to max(1, |u|)."""


@dataclass(frozen=True)
class Linear:
    """x' = A x + B u, y = C x + D u around an operating point.

    Attributes:
        a, b, c, d: matrices.
        states, inputs, outputs: full names.
        time: of the operating point [s].
        notes: what was taken as static or held.
        wires: per connected input (source, gain).
    """

    a: Matrix
    b: Matrix
    c: Matrix
    d: Matrix
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    time: float = 0.0
    notes: tuple[str, ...] = ()
    wires: Mapping[str, tuple[str, float]] | None = None

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A, the slowest first [1/s]."""
        found = np.linalg.eigvals(self.a) if self.a.size else np.zeros(0)
        found = found.astype(np.complex128)
        return found[np.lexsort((found.imag, np.abs(found)))]

    def response(self, frequencies: Vector, input_: str, output: str) -> NDArray[np.complex128]:
        """Frequency response from an input to an output [Hz]."""
        row, column = self._index(self.outputs, output), self._index(self.inputs, input_)
        found = np.full(frequencies.size, self.d[row, column], dtype=np.complex128)
        if self.states:
            eye = np.eye(len(self.states))
            for part in np.array_split(np.arange(frequencies.size), 1 + frequencies.size // 256):
                s = 2j * np.pi * frequencies[part]
                inner = np.linalg.solve(
                    s[:, None, None] * eye - self.a, self.b[None, :, [column]].astype(complex)
                )
                found[part] += (self.c[row] @ inner)[:, 0]
        return found

    @staticmethod
    def _index(names: Sequence[str], name: str) -> int:
        if name not in names:
            raise UnknownNameError(f"{name!r} is not part of this; {listing(names, name)}")
        return names.index(name)

    def to_control(
        self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None
    ) -> Any:
        """A python-control StateSpace."""
        control = require_control()
        columns = [self._index(self.inputs, n) for n in inputs or self.inputs]
        rows = [self._index(self.outputs, n) for n in outputs or self.outputs]
        return control.ss(
            self.a, self.b[:, columns], self.c[rows], self.d[np.ix_(rows, columns)],
            inputs=[self.inputs[i].replace(".", "_") for i in columns],
            outputs=[self.outputs[i].replace(".", "_") for i in rows],
            states=[name.replace(".", "_") for name in self.states],
        )  # fmt: skip


def require_control() -> Any:
    """The package python-control.

    Raises:
        InputError: it is not installed.
    """
    try:
        import control
    except ImportError as error:
        raise InputError(
            f"this needs python-control; install the extra: {way_out('control')}"
        ) from error
    return control


# -- one FMU ---------------------------------------------------------------------------------------


def linearize_instance(instance: Instance, member: Member) -> tuple[Linear, list[str]]:
    """An instance at its present communication point, and notes."""
    known = instance.description.variables
    states = [name[4:-1] for name in known if name.startswith("der(") and name[4:-1] in known]
    inputs = [
        n for v in instance.description.of("input") if v.type in NUMBERS for n in v.elements()
    ]
    outputs = [
        n for v in instance.description.of("output") if v.type in NUMBERS for n in v.elements()
    ]
    n, m = len(states), len(inputs)
    notes = []
    sampled = [v.name for v in known.values() if v.variability == "discrete"
               and v.causality in ("local", "output")]  # fmt: skip
    interval = period(member) if sampled else None
    held = [
        v.name
        for v in known.values()
        if v.variability == "discrete" and v.causality == "local" and v.type.startswith("Float")
    ]
    found = None
    if interval is not None and held:
        every = [*states, *held]
        found = matrices(instance, member, every, inputs, outputs, interval)
    if found is not None:
        notes.append(
            f"{instance.name}: linearized through its samples, every {interval:g} s; right below "
            f"{0.1 / (interval or 1.0):.3g} Hz"
        )
        flat = ~np.any(np.hstack([found[2], found[3]]), axis=1)
        notes += [
            f"{instance.name}: {name} does not change with anything here (it may be rounded)"
            for name, still in zip(outputs, flat, strict=True)
            if still
        ]
        return _named(instance, found, every, inputs, outputs), notes
    if sampled:
        notes.append(f"{instance.name}: {len(sampled)} sampled values are held")
    if instance.description.can("providesDirectionalDerivatives"):
        rows = [*(f"der({name})" for name in states), *outputs]
        full = np.zeros((len(rows), n + m))
        for column, name in enumerate([*states, *inputs]):
            if rows:
                full[:, column] = instance.directional_derivative(rows, [name], [1.0])
        if not np.isfinite(full).all():
            raise InputError(f"{instance.label}: its directional derivatives are not finite")
    elif states:
        raise InputError(
            f"{instance.label}: has states but no directional derivatives, so it cannot be "
            "linearized"
        )
    else:
        notes.append(f"{instance.name}: declares no derivatives and counts as static")
        full = np.zeros((len(outputs), m))
        start = dict(zip(inputs, instance.get(*inputs).tolist(), strict=True)) if inputs else {}
        for column, name in enumerate(inputs):
            if not instance.description.whole(name).type.startswith("Float"):
                notes.append(f"{instance.name}: {name} is no real number and is held")
                continue
            step = INCREMENT * max(1.0, abs(start[name]))
            ends = []
            for value in (start[name] + step, start[name] - step):
                instance.set({name: value})
                ends.append(instance.get(*outputs))
            instance.set({name: start[name]})
            full[:, column] = (ends[0] - ends[1]) / (2.0 * step)
    found = full[:n, :n], full[:n, n:], full[n:, :n], full[n:, n:]
    return _named(instance, found, states, inputs, outputs), notes


def _named(
    instance: Instance, found: tuple[Matrix, Matrix, Matrix, Matrix], *names: Sequence[str]
) -> Linear:
    states, inputs, outputs = (tuple(f"{instance.name}.{n}" for n in group) for group in names)
    return Linear(*found, states, inputs, outputs, instance.time)


# -- a system --------------------------------------------------------------------------------------


def linearize(
    master: Master,
    at: float | None = None,
    inputs: Mapping[str, Driver] | None = None,
    opened: Sequence[str] = (),
    *,
    start: float = 0.0,
) -> Linear:
    """A system at time `at` of a run with these inputs.

    Args:
        master: system, algorithm and step that lead to the operating point.
        at: on the clock of the inputs [s]; at `start`, and by default, the state after
            initialization.
        inputs: as of `Master.run`.
        opened: connected inputs at which the system is cut open.
        start: where the run begins [s].

    Returns:
        From all inputs that nothing drives, and the opened ones, to all outputs.

    Raises:
        ValueRangeError: `at` is no time of a run from `start` on.
    """
    parts, notes = operating_point(master, at, inputs, start)
    return connect(master, parts, notes, opened)


def operating_point(
    master: Master, at: float | None, inputs: Mapping[str, Driver] | None, start: float = 0.0
) -> tuple[list[Linear], list[str]]:
    """The instances at time `at` of a run; arguments as of `linearize`."""
    after = 0.0 if at is None else at - start
    if not 0.0 <= after < np.inf:
        raise ValueRangeError(
            f"the operating point cannot be at t = {at:g} s: the run begins at {start:g} s; take "
            "that time or a later one (--at)"
        )
    outline = master.outline(after or master.step, inputs=inputs, record=[], start=start)
    count = outline.count if after else 0
    parts, notes = [], []
    with ExitStack() as stack:
        execution = Execution(outline, stack)
        run = execution.run
        members = list(master.system.members.values())
        initialize(run)
        if count:
            execution.prepare().advance(count)
        run.do(Op.EXTERNAL, 0, 0)
        for op, a, b in decoded(run.plan.solving):
            run.do(op, a, b)
        for index, instance in enumerate(run.instances):
            run.do(Op.COPY, *run.layout.copies[index].tolist())
            run.do(Op.SET, index, 0)
            instance.time = float(outline.times[count])
            part, said = linearize_instance(instance, members[index])
            parts.append(part)
            notes += said
    return parts, notes


def connect(
    master: Master, parts: Sequence[Linear], notes: Sequence[str], opened: Sequence[str] = ()
) -> Linear:
    """The instances as one system.

    Raises:
        UnknownNameError: an opened input is not connected.
        AlgebraicLoopError: direct feedthrough has no solution.
    """
    states, all_inputs, outputs = (
        tuple(name for part in parts for name in getattr(part, key))
        for key in ("states", "inputs", "outputs")
    )
    a, b, c, d = (_diagonal([getattr(part, key) for part in parts]) for key in "abcd")
    row = {name: index for index, name in enumerate(all_inputs)}
    column = {name: index for index, name in enumerate(outputs)}
    wires = {w.target: (w.source, w.gain) for w in master.system.connections}
    for name in opened:
        if name not in wires:
            raise UnknownNameError(f"input {name!r} is not connected; {listing(wires, name)}")
    gains = np.zeros((len(all_inputs), len(outputs)))
    for target, (source, gain) in wires.items():
        if target not in opened:
            gains[row[target], column[source]] = gain
    free = [name for name in all_inputs if name not in wires or name in opened]
    enter = np.zeros((len(all_inputs), len(free)))
    for index, name in enumerate(free):
        enter[row[name], index] = 1.0
    through = np.eye(len(outputs)) - d @ gains
    if outputs and np.linalg.cond(through) > 1e12:
        raise AlgebraicLoopError(
            f"{master.system.name}: direct feedthrough at this operating point has no solution "
            f"(condition {np.linalg.cond(through):.1e})"
        )
    c_all: Matrix = np.asarray(np.linalg.solve(through, c), dtype=np.float64)
    d_all: Matrix = np.asarray(np.linalg.solve(through, d @ enter), dtype=np.float64)
    return Linear(
        a + b @ gains @ c_all, b @ (gains @ d_all + enter), c_all, d_all,
        states, tuple(free), outputs, parts[0].time if parts else 0.0, tuple(notes), wires,
    )  # fmt: skip


def _diagonal(blocks: Sequence[Matrix]) -> Matrix:
    rows, columns = (sum(block.shape[axis] for block in blocks) for axis in (0, 1))
    found = np.zeros((rows, columns))
    i = j = 0
    for block in blocks:
        found[i : i + block.shape[0], j : j + block.shape[1]] = block
        i, j = i + block.shape[0], j + block.shape[1]
    return found


# -- open loops ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Margins:
    """Of an open loop L, cut at one connection, closed by u = -L u.

    Attributes:
        name: the input at which it is cut.
        crossover: frequency where |L| falls through 1, the last one; nan if it never does [Hz].
        phase: phase margin there [deg].
        gain: gain margin, the factor by which the loop's gain must change until |L| = 1 at a phase
            of -180 degrees, the nearest to 1 (below 1: by which it must fall); inf for none.
        frequencies, response: of L.
    """

    name: str
    crossover: float
    phase: float
    gain: float
    frequencies: Vector
    response: NDArray[np.complex128]


def margins(name: str, frequencies: Vector, response: NDArray[np.complex128]) -> Margins:
    """Margins of an open loop from its frequency response on a fine raster."""
    size, angle = np.abs(response), np.unwrap(np.angle(response))
    gain = _gain_margin(size, angle)
    down = np.flatnonzero((size[:-1] >= 1.0) & (size[1:] < 1.0))
    if not down.size:
        return Margins(name, np.nan, np.nan, gain, frequencies, response)
    k = int(down[-1])
    part = np.log(size[k]) / (np.log(size[k]) - np.log(size[k + 1]))
    crossover = float(frequencies[k] * (frequencies[k + 1] / frequencies[k]) ** part)
    at = float(angle[k] + part * (angle[k + 1] - angle[k]))
    phase = float((np.degrees(at) + 180.0 + 180.0) % 360.0 - 180.0)
    return Margins(name, crossover, phase, gain, frequencies, response)


def _gain_margin(size: Vector, angle: Vector) -> float:
    """Gain margin; interpolated as the crossover is."""
    turned = (angle + np.pi) / (2.0 * np.pi)  # whole numbers at -180 degrees
    told = np.flatnonzero((np.abs(turned - np.round(turned)) > TOUCHED) & (size > 0.0))
    turned, log = turned[told], np.log(size[told])
    k = np.flatnonzero(np.floor(turned[:-1]) != np.floor(turned[1:]))
    if not k.size:
        return np.inf
    whole = np.maximum(np.floor(turned[k]), np.floor(turned[k + 1]))
    part = (whole - turned[k]) / (turned[k + 1] - turned[k])
    there = log[k] + part * (log[k + 1] - log[k])
    return float(np.exp(-there[np.argmin(np.abs(there))]))


TOUCHED = 1e-6
"""Turns from -180 degrees below which a loop that only tends to them has rounding for a phase."""
RASTER: Vector = np.logspace(-3, 5, 8001)
"""Frequencies of margins [Hz]."""


def loop_margins(
    master: Master, parts: Sequence[Linear], names: Sequence[str], delay: float = 0.0
) -> list[Margins]:
    """Margins of the loops through these connected inputs, each opened with the others closed.

    Args:
        master: the system.
        parts: from `operating_point`.
        names: connected inputs.
        delay: added to the loop, such as that of sampling [s].
    """
    found = []
    for name in names:
        opened = connect(master, parts, (), [name])
        source, gain = (opened.wires or {})[name]
        back = -gain * opened.response(RASTER, name, source)
        back = back * np.exp(-2j * np.pi * RASTER * delay)
        if np.any(np.abs(back) > 0.0):
            found.append(margins(name, RASTER, back))
    return found


def tune_pi(
    plant: Any, crossover: float, phase_margin: float, delay: float = 0.0
) -> tuple[float, float]:
    """Gains (Kp, Ki) of Kp + Ki / s for a crossover [Hz] and a phase margin [deg].

    Args:
        plant: a python-control system with one input and one output.
        crossover, phase_margin: wanted.
        delay: in the loop [s].

    Raises:
        InputError: a PI controller cannot do this.
    """
    wanted = _controller(plant, crossover, phase_margin, delay)
    kp, ki = wanted.real, -wanted.imag * 2.0 * np.pi * crossover
    if kp <= 0.0 or ki < 0.0:
        raise InputError(
            f"a PI controller cannot give {phase_margin:g} degrees at {crossover:g} Hz: it would "
            f"need Kp = {kp:.4g}, Ki = {ki:.4g}; lower the crossover or take a PID controller"
        )
    return float(kp), float(ki)


def tune_pid(
    plant: Any,
    crossover: float,
    phase_margin: float,
    integral_time: float,
    filter_time: float = 0.0,
    delay: float = 0.0,
) -> tuple[float, float, float]:
    """Gains (Kp, Ki, Kd) of Kp + Ki / s + Kd s / (1 + s T_f), with Ki = Kp / integral_time.

    Args:
        plant, crossover, phase_margin, delay: as of `tune_pi`.
        integral_time: [s].
        filter_time: T_f of the derivative [s].

    Raises:
        InputError: these gains would not be positive.
    """
    wanted = _controller(plant, crossover, phase_margin, delay)
    s = 2j * np.pi * crossover
    columns = np.array([1.0 + 1.0 / (s * integral_time), s / (1.0 + s * filter_time)])
    kp, kd = np.linalg.solve(np.array([columns.real, columns.imag]), [wanted.real, wanted.imag])
    if kp <= 0.0 or kd < 0.0:
        raise InputError(
            f"a PID controller cannot give {phase_margin:g} degrees at {crossover:g} Hz: it would "
            f"need Kp = {kp:.4g}, Kd = {kd:.4g}; "
            + ("take a PI controller" if kd < 0.0 else "lower the crossover")
        )
    return float(kp), float(kp / integral_time), float(kd)


def _controller(plant: Any, crossover: float, phase_margin: float, delay: float) -> complex:
    require_control()
    s = 2j * np.pi * crossover
    there = complex(np.squeeze(plant(s))) * np.exp(-s * delay)
    return complex(np.exp(1j * np.radians(phase_margin - 180.0)) / there)


def plot_bode(loops: Sequence[Margins], path: Path) -> Path:
    """Bode plot of open loops."""
    from matplotlib.figure import Figure

    picture = Figure(figsize=(8.0, 6.0), layout="constrained")
    upper, lower = picture.subplots(2, 1, sharex=True)
    for loop in loops:
        shown = np.abs(loop.response) > 1e-6
        f = loop.frequencies[shown]
        upper.loglog(f, np.abs(loop.response[shown]), label=f"cut at {loop.name}")
        lower.semilogx(f, np.degrees(np.unwrap(np.angle(loop.response[shown]))))
    upper.axhline(1.0, color="0.6", lw=0.8)
    lower.axhline(-180.0, color="0.6", lw=0.8)
    upper.set_ylabel("gain [1]")
    lower.set_ylabel("phase [deg]")
    lower.set_xlabel("frequency [Hz]")
    upper.legend()
    with atomic(path) as temporary:
        picture.savefig(temporary)
    return path
