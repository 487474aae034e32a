"""What single runs may have of their own: where they begin, and what is wrong with their columns.

With J the derivatives of the residuals r by the parameters and S those by errors of single runs,
errors gain, parameters being free to follow,

    g' M^-1 g,    M = S' S - S' J (J' J)^-1 J' S,    g = S' r - S' J (J' J)^-1 J' r
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from ...errors import CosimError
from ...spec.units import BASE, per_second
from ..parts import BIAS, CLOCK, COLUMN, GAIN, ZERO_DRIFT, Parameter

if TYPE_CHECKING:
    from ..parts import Sensitivity
    from ..problem import Problem
    from ..simulator import Simulator

Vector = NDArray[np.float64]
PLACED = 1e-3
"""By which positions and angles are moved [m, rad]: to which machines are placed with care; and
their speeds [m/s, rad/s], which such a place hides over a second."""
SCALED = 1e-2
"""By which gains are changed."""
ROWS = 3000
"""Samples of a run that are looked at, at least, where it has many more: what is worth a word shows
in so many."""
LATE, LATE_INPUTS = (1, 2, 4, 8, 16, 32), (2, 8)
"""Samples by which columns are shifted, either way; fewer of inputs, which are simulated."""
CHANCE = 1e-6
"""Of a gain in data where nothing is wrong: data sets are many, and so are what each is asked."""
LEAVES = 0.2
"""Share of the excess over the noise's that errors may leave, to first order, to be fitted."""
SPREAD = 2.0
"""Deviations that the sum of squares of noise may be off."""
SAME = 1e-9
"""Share of what an error does from which parameters do not do the same."""
WIDE = 20.0
"""Bounds of an error over its size, or its deviation: that they are none."""
PARTS, LIKELY = 10, 1e-3
"""Parts of a run whose means show wrong starts and most laws that are missing, which act as slowly
as a machine moves; and their chance from which they are those of noise."""
CONSTANT = 0.01
"""Share of what an error does up to which it is the same at all times."""


@dataclass(frozen=True)
class Rest:
    """What is left: sum of squares over the noise, and how many."""

    squares: float
    count: int

    @classmethod
    def of(cls, parts: Iterable[Vector]) -> Rest:
        """Of residuals over the noise; gaps are nan."""
        known = [rows[np.isfinite(rows)] for rows in parts]
        return cls(sum(float(rows @ rows) for rows in known), sum(rows.size for rows in known))

    @property
    def excess(self) -> float:
        """Beyond that of noise."""
        return self.squares - self.count

    @property
    def mean(self) -> float:
        """Mean square over the noise's."""
        return self.squares / max(self.count, 1)

    @property
    def chance(self) -> float:
        """What noise may leave beyond itself."""
        return SPREAD * float(np.sqrt(2.0 * self.count))


@dataclass(frozen=True)
class Kind:
    """An error that a run may have.

    Attributes:
        target: of a nuisance that sets it.
        what: it is, for people.
        unit: of it.
        step: change of it with which its derivative is taken.
    """

    target: str
    what: str
    unit: str
    step: float

    @property
    def starts(self) -> bool:
        """Whether it is where a run begins."""
        return not self.target.startswith((CLOCK, COLUMN))


def starts_of(problem: Problem) -> Iterator[Kind]:
    """Positions, angles and their speeds that the system integrates."""
    for name, member in problem.plain().members.items():
        variables = member.description.variables
        for variable in variables.values():
            if f"der({variable.name})" not in variables or variable.unit is None:
                continue
            parts = {k: n for k, n in zip(BASE, variable.unit.exponents, strict=True) if n}
            rate = parts.pop("s", 0)
            if parts in ({"m": 1}, {"rad": 1}) and rate in (0, -1):
                for element in variable.elements():
                    yield Kind(f"{name}.{element}", f"{name}.{element}", variable.symbol, PLACED)


def exact_starts(problem: Problem) -> str:
    """A sentence on where a machine that drives about is taken to begin exactly, "" if nowhere."""
    free = {t for p in (*problem.parameters, *problem.late) for t, _ in p.targets}
    starts = [k for k in starts_of(problem) if k.target not in free]
    drives = {k.target.partition(".")[0] for k in starts if k.unit == "m"}
    taken = [k.target for k in starts
             if k.target.partition(".")[0] in drives and k.unit in ("m", "rad")]  # fmt: skip
    if not taken or problem.relative:
        return ""
    return (
        f"runs are taken to begin exactly where they are said to ({', '.join(taken)}): if the "
        "machine was placed by hand, let that be estimated, by a [[nuisance]] for each with "
        "per_run = true"
    )


def columns_of(problem: Problem, measured: Collection[str]) -> Iterator[Kind]:
    """Clocks of columns, and zero, gain and drift of those that are measured.

    Args:
        problem: with inputs.
        measured: channels that are asked.
    """
    run = problem.runs[0]
    interval, duration = run.interval, max(float(r.times[-1] - r.times[0]) for r in problem.runs)
    channels = [c for c in problem.channels if c.name in measured]
    clocks = [(c.name, LATE) for c in channels] + [(n, LATE_INPUTS) for n in run.inputs]
    for name, shifts in clocks:
        for samples in (sign * n for n in shifts for sign in (1, -1)):
            yield Kind(CLOCK + name, f"how late {name} is", "s", samples * interval)
    for c in channels:
        rate = per_second(c.unit) if c.unit else ""
        for kind, what, unit, step in (
            (BIAS, "the zero of", c.unit, c.sigma),
            (GAIN, "the error of the gain of", "1", SCALED),
            (ZERO_DRIFT, "the drift of the zero of", rate, c.sigma / duration),
        ):
            yield Kind(f"{COLUMN}{kind}{c.name}", f"{what} {c.name}", unit, step)


@dataclass(frozen=True)
class _Rows:
    """What is left in a run, one sample after the other, and what the parameters do there.

    Attributes:
        good: known ones of all that is asked, every `stride`-th sample.
        channel: of each.
        columns: of the parameters.
        slopes: derivatives by these.
    """

    stride: int
    good: NDArray[np.bool_]
    channel: NDArray[np.intp]
    residual: Vector
    columns: NDArray[np.intp]
    slopes: Vector

    @classmethod
    def of(cls, rows: Vector, item: Sensitivity | None, problem: Problem) -> _Rows:
        stride = max(len(rows) // ROWS, 1)
        rows = rows[::stride]
        good = np.isfinite(rows)
        columns = np.zeros(0, np.intp) if item is None else item.columns
        slopes = np.zeros((*rows.shape, 0)) if item is None else item.values[::stride]
        good &= np.isfinite(slopes).all(axis=2)
        return cls(stride, good, np.nonzero(good)[1], rows[good], columns,
                   slopes[good] * problem.scale[columns])  # fmt: skip

    def of_all(self, rows: Vector) -> Vector:
        """The same samples of others."""
        return np.nan_to_num(rows[:: self.stride][self.good])

    def by_channel(self, values: Vector) -> Vector:
        """Of such samples one row at a time with a column per channel, 0 where nothing is known."""
        found = np.zeros(self.good.shape)
        found[self.good] = values
        return found


@dataclass(frozen=True)
class _Column:
    """What an error of a kind does to the residuals of a run, per change of it."""

    kind: Kind
    run: str
    values: Vector


class OwnErrors:
    """What errors of single runs would gain, to first order.

    Args:
        simulator: of the problem.
        theta: its parameters.
        residuals: by run, of the runs that are asked.
        jacobian: of these runs; none where parameters are held.
    """

    def __init__(
        self,
        simulator: Simulator,
        theta: Vector,
        residuals: Sequence[tuple[str, Vector]],
        jacobian: Sequence[Sensitivity],
    ) -> None:
        problem = self.problem = simulator.problem
        self.simulator, self.theta = simulator, theta
        self.residuals, self.fitted, self._jacobian = residuals, bool(jacobian), jacobian
        self.columns: list[_Column] = []
        self.matrix, self.gradient, self._sizes = np.zeros((0, 0)), np.zeros(0), np.zeros(0)
        slopes_of = {item.run: item for item in jacobian}
        self._rows = {
            name: _Rows.of(rows, slopes_of.get(name), problem) for name, rows in residuals
        }
        self.rest = Rest.of(part.residual for part in self._rows.values())
        self.excess = self.rest.excess + (len(problem.parameters) if jacobian else 0)
        priors = [(k / p.prior) ** 2 if p.prior else 0.0
                  for k, p in zip(problem.scale, problem.parameters, strict=True)]  # fmt: skip
        self._priors = np.diag(priors)
        self._own, self._fallen = self._normal()
        self._inverse = self._inverted(self._own)

    def _inverted(self, own: Vector) -> Vector:
        return np.asarray(np.linalg.pinv(own + self._priors, rcond=SAME, hermitian=True))

    def _normal(self, channel: int | None = None) -> tuple[Vector, Vector]:
        """J' J and J' r, of one channel if given."""
        own, fallen = np.zeros((self.theta.size, self.theta.size)), np.zeros(self.theta.size)
        for part in self._rows.values():
            kept = slice(None) if channel is None else part.channel == channel
            slopes = part.slopes[kept]
            own[np.ix_(part.columns, part.columns)] += slopes.T @ slopes
            fallen[part.columns] += slopes.T @ part.residual[kept]
        return own, fallen

    def ask(self, kinds: Sequence[Kind]) -> None:
        """Simulate errors of these kinds, those that no parameter sets already."""
        names = list(self._rows)
        set_in = {
            (target, run) for p in (*self.problem.parameters, *self.problem.late)
            for target, _ in p.targets for run in ([p.run] if p.run else names)
        }  # fmt: skip
        self.columns = []
        for kind in kinds:
            runs = [name for name in names if (kind.target, name) not in set_in]
            begins = [self.begins(kind, name) for name in runs]
            added = [free(kind, r, b, abs(kind.step)) for r, b in zip(runs, begins, strict=True)]
            moved = self.problem.with_parameters([*self.problem.parameters, *added])
            theta = np.concatenate([self.theta, np.array(begins) + kind.step])
            other = self.simulator.of(moved)
            try:
                others = dict(other.residuals(theta, runs))
            except CosimError:  # what cannot be simulated there says nothing
                continue
            finally:
                if kind.target.removeprefix(CLOCK) in self.problem.runs[0].inputs:
                    other.close()  # its sessions have inputs that no other kind has
            for name, residual in self.residuals:
                if name in others:
                    change = self._rows[name].of_all((others[name] - residual) / kind.step)
                    if np.any(change):
                        self.columns.append(_Column(kind, name, change))
        self._summed()

    def by_channel(self, column: _Column) -> Vector:
        """What an error does to each channel of its run, over time."""
        return self._rows[column.run].by_channel(column.values)

    def _summed(self) -> None:
        count = len(self.columns)
        self.matrix, self.gradient = np.zeros((count, count)), np.zeros(count)
        shared = np.zeros((count, self.theta.size))
        for i, column in enumerate(self.columns):
            part = self._rows[column.run]
            self.gradient[i] = column.values @ part.residual
            shared[i, part.columns] = part.slopes.T @ column.values
            for k in range(i + 1):
                if self.columns[k].run == column.run:
                    both = float(column.values @ self.columns[k].values)
                    self.matrix[i, k] = self.matrix[k, i] = both
        self._sizes = np.maximum(np.diag(self.matrix), 1e-300)
        self.matrix -= shared @ self._inverse @ shared.T
        self.gradient -= shared @ self._inverse @ self._fallen

    def begins(self, kind: Kind, run: str) -> float:
        """What is said of it in a run."""
        if not kind.starts:
            return 0.0
        values = self.problem.values(self.theta, run)
        if kind.target in values:
            return values[kind.target]
        member, (variable, *_) = self.problem.system().variables(kind.target)
        declared = [value for value in variable.start if value is not None]
        given = member.parameters.get(variable.name)
        return float((declared or [0.0])[0] if given is None else str(given))

    def gain(self, kinds: Sequence[Kind], *, alike: bool = False) -> tuple[float, int]:
        """What errors of some kinds gain, and how many values that takes.

        Args:
            kinds: of them.
            alike: one value for all runs.
        """
        index = [i for i, c in enumerate(self.columns) if c.kind in kinds]
        groups = [(self.columns[i].kind, "" if alike else self.columns[i].run) for i in index]
        known = list(dict.fromkeys(groups))
        if not known:
            return 0.0, 0
        sums = np.array([[float(group == one) for one in known] for group in groups])
        matrix = sums.T @ self.matrix[np.ix_(index, index)] @ sums
        alone = np.sqrt(sums.T @ self._sizes[index])
        even, told = matrix / np.outer(alone, alone), sums.T @ self.gradient[index] / alone
        inverse = np.linalg.pinv(even, rcond=SAME, hermitian=True)
        return float(told @ inverse @ told), int(np.linalg.matrix_rank(even, SAME, hermitian=True))

    def explained(self, gain: float) -> bool:
        """Whether what is left is noise, or little beside what was."""
        return self.excess - gain <= max(LEAVES * self.excess, self.rest.chance)

    def worst(self) -> OwnErrors:
        """The same of the run that leaves most alone: what does not explain it explains nothing."""
        name = max(self._rows, key=lambda n: float(np.sum(self._rows[n].residual ** 2 - 1.0)))
        return OwnErrors(
            self.simulator, self.theta, [item for item in self.residuals if item[0] == name],
            [item for item in self._jacobian if item.run == name],
        )  # fmt: skip

    def possible(self, *, singly: bool) -> bool:
        """Whether all kinds together explain what is left, or one of them does.

        Of one run of several its parameters are not at their minimum, and go there, too.
        """
        kinds = list(dict.fromkeys(c.kind for c in self.columns))
        sets = [[kind] for kind in kinds] if singly else [kinds]
        own = float(self._fallen @ self._inverse @ self._fallen)
        return any(self.explained(self.gain(some)[0] + own) for some in sets)

    def together(self) -> list[Kind]:
        """As few kinds as explain what is left, each beside the others; none if they do not."""
        kinds = list(dict.fromkeys(c.kind for c in self.columns))
        whole, values = self.gain(kinds)
        if not values or whole < chdtri(values, CHANCE) or not self.explained(whole):
            return []
        taken: list[Kind] = []
        gained, values = 0.0, 0
        while rest := [kind for kind in kinds if kind not in taken]:
            best = max(rest, key=lambda kind: self.gain([*taken, kind])[0])
            more, wider = self.gain([*taken, best])
            if wider == values or more - gained < chdtri(wider - values, CHANCE):
                break
            taken, gained, values = [*taken, best], more, wider
        return taken if self.explained(gained) else []

    def single(self) -> list[Kind]:
        """The kind that explains most of what is left, by itself; none if it does not."""
        kinds = list(dict.fromkeys(c.kind for c in self.columns))
        if not kinds:
            return []
        best = max(kinds, key=lambda kind: self.gain([kind])[0])
        gained, values = self.gain([best])
        sure = gained > chdtri(values, CHANCE / len(kinds)) if values else False
        return [best] if sure and self.explained(gained) else []

    def alone(self) -> list[str]:
        """Channels without which, parameters free to follow, little is left.

        Whatever is wrong with any other one by itself, more than it can take up stays.
        """
        found = []
        for i, channel in enumerate(self.problem.channels):
            own, fallen = (a - b for a, b in zip(
                (self._own, self._fallen), self._normal(i), strict=True
            ))  # fmt: skip
            left = sum(
                float(np.sum(part.residual[part.channel != i] ** 2 - 1.0))
                for part in self._rows.values()
            )
            if self.explained(self.excess - left + float(fallen @ self._inverted(own) @ fallen)):
                found.append(channel.name)
        return found

    def alike(self, kinds: Sequence[Kind]) -> bool:
        """Whether one value for all runs does as well."""
        (whole, values), (one, fewer) = self.gain(kinds), self.gain(kinds, alike=True)
        return values == fewer or bool(whole - one < chdtri(values - fewer, CHANCE))

    def constant(self, kinds: Sequence[Kind]) -> bool:
        """Whether these errors only add a constant to channels."""
        for column in self.columns:
            if column.kind in kinds:
                channel, values = self._rows[column.run].channel, column.values
                means = np.bincount(channel, values) / np.maximum(np.bincount(channel), 1)
                if np.sum((values - means[channel]) ** 2) > CONSTANT**2 * np.sum(values**2):
                    return False
        return True

    def opened(self, kinds: Sequence[Kind]) -> tuple[Simulator, Vector]:
        """The problem with these errors as parameters, and where a fit of it begins."""
        index = [i for i, c in enumerate(self.columns) if c.kind in kinds]
        inverse = np.linalg.pinv(self.matrix[np.ix_(index, index)], rcond=SAME, hermitian=True)
        # residuals are what was measured less the model
        off = -inverse @ self.gradient[index]
        added, values = [], []
        for i, value, variance in zip(index, off.tolist(), np.diag(inverse), strict=True):
            kind, run = self.columns[i].kind, self.columns[i].run
            begins, size = self.begins(kind, run), max(abs(value), float(variance) ** 0.5)
            added.append(free(kind, run, begins, WIDE * max(size, abs(kind.step))))
            values.append(begins + value)
        wider = self.problem.with_parameters([*self.problem.parameters, *added])
        return self.simulator.of(wider), np.concatenate([self.theta, values])


def free(kind: Kind, run: str, begins: float, wide: float) -> Parameter:
    """An error of a run as a parameter."""
    return Parameter(f"{kind.target}@{run}", kind.unit, begins, begins - wide, begins + wide,
                     ((kind.target, 1.0),), "nuisance", run)  # fmt: skip


def is_slow(residuals: Sequence[tuple[str, Vector]]) -> bool:
    """Whether means of parts of the runs are more than noise."""
    total, count = 0.0, 0
    for _, residual in residuals:
        for part in np.array_split(residual, PARTS):
            known = np.isfinite(part).sum(axis=0)
            total += float(np.sum(np.nansum(part, axis=0)[known > 0] ** 2 / known[known > 0]))
            count += int(np.count_nonzero(known))
    return bool(count) and total > float(chdtri(count, LIKELY))
