"""Runs that begin a little beside where they are said to: a machine that was placed by hand.

No first sample shows a heading that is off by a few deviations of its noise, but whole runs do: the
path turns with it, parameters make up for what they can, and intervals know nothing of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from ...errors import CosimError
from ...spec.units import BASE
from ..fit import Effort, fit
from ..parts import Parameter
from .finding import Finding, quantity

if TYPE_CHECKING:
    from ..estimate import Estimate
    from ..problem import Problem
    from ..simulator import Simulator

Vector = NDArray[np.float64]
STEP = 1e-3
"""By which positions and angles are moved [m, rad]: to which machines are placed with care."""
CHANCE = 1e-6
"""Of a gain in data where nothing is wrong: data sets are many, and so are what each is asked."""
SLOW, LIKELY = 10, 1e-3
"""Parts of a run whose means show a wrong start and most laws that are missing, which act as slowly
as a machine moves; and their chance from which they are those of noise."""
LEAVES = 0.2
"""Share of the excess over the noise's that starts may leave, to first order, to be fitted."""
SPREAD = 2.0
"""Deviations that the sum of squares of noise may be off."""
OFF = 1.5
"""Mean square over the noise's from which nothing but starts leaves noise: nine starts of three
runs leave a sixth of what unequal wheels do, and less is seen. Below it, a law may do as well."""
SAME = 1e-9
"""Share of what a start does from which parameters do not do the same."""
CONSTANT = 0.01
"""Share of what a start does up to which it is the same at all times."""
AGAIN = Effort("near", "intervals", iterations=8)
"""Of the fit with starts: these move paths nearly as a straight line does."""
WIDE = 20.0
"""Bounds of a start over what it is off, or its deviation: that they are none."""


def check_begun(estimate: Estimate) -> Iterator[Finding]:
    """Start values, another one in each run, that explain all that a fit leaves.

    With J the derivatives of the residuals r by the parameters and S those by what runs begin
    with, starts gain, parameters being free to follow,

        g' M^-1 g,    M = S' S - S' J (J' J)^-1 J' S,    g = S' r - S' J (J' J)^-1 J' r

    A gain that noise does not make (`CHANCE`) and that leaves no more than `LEAVES` of the excess
    over the noise is tried in a fit, with as few kinds of starts as make it. If that leaves noise,
    white over time, this is what is wrong: of a law that the model lacks, starts make up for a
    part. Where there is little to explain (`OFF`), that part may be all that shows, and it is a
    warning; so it is of one value for all runs that only adds a constant to channels, as the zero
    of a sensor does. One that does more (a heading) is a frame that is turned, which is mended in
    the same way.
    """
    problem = estimate.problem
    if problem.unstable or not estimate.jacobian or not _slow(estimate):
        return
    asked = _Asked(estimate)
    names = asked.chosen()
    if not names:
        return
    try:
        again = fit(*asked.opened(names), effort=AGAIN)
    except CosimError:  # what cannot be fitted explains nothing
        return
    squares = 2.0 * again.cost
    if squares - again.count > asked.noise or _slow(again):
        return
    alike = asked.alike(names)
    zero, little = alike and asked.constant(names), 2.0 * estimate.cost < OFF * estimate.count
    told = "; ".join(filter(None, (_told(again, name) for name in names)))
    moved = ", ".join(
        f"{p.name} from {quantity(before, '')} to {quantity(again.values[p.name], p.unit)}"
        for p, before, low, high in zip(
            problem.parameters, estimate.theta.tolist(), estimate.low.tolist(),
            estimate.high.tolist(), strict=True,
        )
        if p.role == "declared" and not low <= again.values[p.name] <= high
    )  # fmt: skip
    count = max(estimate.count, 1)
    text = (
        f"runs do not begin quite where they are said to: {told}. With that the mean square over "
        f"the noise's falls from {2.0 * estimate.cost / count:.3g} to {squares / count:.3g}"
        + (f", and it moves {moved}, out of the intervals" if moved else "")
        + ". Estimate it: a [[nuisance]] with "
        + " and one with ".join(
            f'targets = "{name}", nominal = {asked.nominal(name):.4g}, span = '
            f"{4.0 * asked.size(again, name):.1g}"
            for name in names
        )
        + ", each with per_run = true"
    )
    if zero:
        text += "; or it is the zero of a sensor, as all runs are off alike"
    else:
        text += "; or their frame is turned or moved, as all runs are off alike" * alike
        text += "; or a law is missing that does as much" * little
    yield Finding("warning" if zero or little else "error", "start", "", "", text)


def _slow(estimate: Estimate) -> bool:
    """Whether means of parts of the runs are more than noise."""
    total, count = 0.0, 0
    for _, residual in estimate.residuals:
        for part in np.array_split(residual, SLOW):
            known = np.isfinite(part).sum(axis=0)
            total += float(np.sum(np.nansum(part, axis=0)[known > 0] ** 2 / known[known > 0]))
            count += int(np.count_nonzero(known))
    return bool(count) and total > chdtri(count, LIKELY)


def _places(problem: Problem) -> list[str]:
    """Positions and angles that the system integrates."""
    found = []
    for name, member in problem.plain().members.items():
        variables = member.description.variables
        for variable in variables.values():
            if f"der({variable.name})" not in variables or variable.unit is None:
                continue
            kinds = {k: n for k, n in zip(BASE, variable.unit.exponents, strict=True) if n}
            if kinds in ({"m": 1}, {"rad": 1}):
                found += [f"{name}.{element}" for element in variable.elements()]
    return found


@dataclass(frozen=True)
class _Column:
    """What a start does to the residuals of its run."""

    place: str
    run: str
    values: Vector


class _Asked:
    """What the starts of the fitted runs would gain, to first order."""

    def __init__(self, estimate: Estimate) -> None:
        problem = self.problem = estimate.problem
        self.estimate = estimate
        self.excess = 2.0 * estimate.cost - (estimate.count - len(problem.parameters))
        self.noise = SPREAD * float(np.sqrt(2.0 * estimate.count))
        self.columns = self._columns()
        size, scale = len(problem.parameters), problem.scale
        own, across, fallen = np.zeros((size, size)), [], np.zeros(size)
        rows = {}
        for item, (name, residual) in zip(estimate.jacobian, estimate.residuals, strict=True):
            good = np.isfinite(residual) & np.isfinite(item.values).all(axis=2)
            slopes = np.zeros((int(good.sum()), size))
            slopes[:, item.columns] = item.values[good] * scale[item.columns]
            rows[name] = good, slopes, residual[good]
            own += slopes.T @ slopes
            fallen += slopes.T @ residual[good]
        for k, p in enumerate(problem.parameters):
            own[k, k] += (scale[k] / p.prior) ** 2 if p.prior else 0.0
        inverse = np.linalg.pinv(own, rcond=SAME, hermitian=True)
        count = len(self.columns)
        self.matrix, self.gradient = np.zeros((count, count)), np.zeros(count)
        for i, column in enumerate(self.columns):
            good, slopes, residual = rows[column.run]
            mine = np.nan_to_num(column.values[good])
            across.append(slopes.T @ mine)
            self.gradient[i] = mine @ residual
            for k in range(i + 1):
                if self.columns[k].run == column.run:
                    both = float(mine @ np.nan_to_num(self.columns[k].values[good]))
                    self.matrix[i, k] = self.matrix[k, i] = both
        if count:
            shared = np.stack(across)
            self.alone = np.diag(self.matrix).copy()
            self.matrix -= shared @ inverse @ shared.T
            self.gradient -= shared @ inverse @ fallen

    def _columns(self) -> list[_Column]:
        """Derivatives by all starts that no parameter sets, of runs that they are felt in."""
        problem, estimate = self.problem, self.estimate
        names = [name for name, _ in estimate.residuals]
        set_in = {
            (target, run) for p in (*problem.parameters, *problem.late) for target, _ in p.targets
            for run in ([p.run] if p.run else names)
        }  # fmt: skip
        found = []
        for place in _places(problem):
            runs = [name for name in names if (place, name) not in set_in]
            moved = problem.changed(
                runs=[
                    replace(r, starts={**r.starts, place: self._begins(place, r.name) + STEP})
                    if r.name in runs else r
                    for r in problem.runs
                ]
            )  # fmt: skip
            try:
                others = dict(estimate.simulator.of(moved).residuals(estimate.theta, runs))
            except CosimError:  # what cannot be simulated there says nothing
                continue
            for name, residual in estimate.residuals:
                if name in runs:
                    change = (others[name] - residual) / STEP
                    if np.nansum(change**2) > 0.0:
                        found.append(_Column(place, name, change))
        return found

    def _begins(self, place: str, run: str) -> float:
        """Where a run is said to begin."""
        values = self.problem.values(self.estimate.theta, run)
        if place in values:
            return values[place]
        member, (variable, *_) = self.problem.system().variables(place)
        declared = [value for value in variable.start if value is not None]
        given = member.parameters.get(variable.name)
        return float((declared or [0.0])[0] if given is None else str(given))

    def nominal(self, place: str) -> float:
        """Where the first run is said to begin."""
        return self._begins(place, self.estimate.residuals[0][0])

    def gain(self, names: Sequence[str], *, alike: bool = False) -> tuple[float, int]:
        """What some kinds of starts gain, and how many values that takes.

        Args:
            names: of the kinds.
            alike: one value for all runs.
        """
        index = [i for i, c in enumerate(self.columns) if c.place in names]
        groups = [(self.columns[i].place, "" if alike else self.columns[i].run) for i in index]
        kinds = list(dict.fromkeys(groups))
        if not kinds:
            return 0.0, 0
        sums = np.array([[float(group == kind) for kind in kinds] for group in groups])
        matrix = sums.T @ self.matrix[np.ix_(index, index)] @ sums
        gradient = sums.T @ self.gradient[index]
        alone = np.sqrt(sums.T @ self.alone[index])
        even = matrix / np.outer(alone, alone)
        inverse = np.linalg.pinv(even, rcond=SAME, hermitian=True)
        told = gradient / alone
        return float(told @ inverse @ told), int(np.linalg.matrix_rank(even, SAME, hermitian=True))

    def explained(self, gain: float) -> bool:
        """Whether what is left is noise, or little beside what was."""
        return self.excess - gain <= max(LEAVES * self.excess, self.noise)

    def chosen(self) -> list[str]:
        """As few kinds of starts as explain what is left; none if they do not."""
        kinds = list(dict.fromkeys(c.place for c in self.columns))
        whole, values = self.gain(kinds)
        if not values or whole < chdtri(values, CHANCE) or not self.explained(whole):
            return []
        taken: list[str] = []
        gained, values = 0.0, 0
        while rest := [kind for kind in kinds if kind not in taken]:
            best = max(rest, key=lambda kind: self.gain([*taken, kind])[0])
            more, wider = self.gain([*taken, best])
            if wider == values or more - gained < chdtri(wider - values, CHANCE):
                break
            taken, gained, values = [*taken, best], more, wider
        return taken if self.explained(gained) else []

    def alike(self, names: Sequence[str]) -> bool:
        """Whether one value for all runs does as well."""
        (whole, values), (one, fewer) = self.gain(names), self.gain(names, alike=True)
        return values == fewer or bool(whole - one < chdtri(values - fewer, CHANCE))

    def constant(self, names: Sequence[str]) -> bool:
        """Whether these starts only add a constant to channels."""
        for column in self.columns:
            if column.place in names:
                shown = column.values[:, np.isfinite(column.values).any(axis=0)]
                changes = shown - np.nanmean(shown, axis=0)
                if np.nansum(changes**2) > CONSTANT**2 * np.nansum(shown**2):
                    return False
        return True

    def size(self, again: Estimate, place: str) -> float:
        """How far starts of a kind are off at most, or the largest deviation."""
        off = [
            max(abs(value - p.nominal), deviation)
            for p, value, deviation in zip(
                again.problem.parameters, again.theta.tolist(), again.deviation.tolist(),
                strict=True,
            )
            if (place, 1.0) in p.targets and p.run
        ]  # fmt: skip
        return float(max(off))

    def opened(self, names: Sequence[str]) -> tuple[Simulator, Vector]:
        """The problem with these starts as parameters, and where a fit of it begins."""
        estimate, problem = self.estimate, self.problem
        index = [i for i, c in enumerate(self.columns) if c.place in names]
        even = self.matrix[np.ix_(index, index)]
        inverse = np.linalg.pinv(even, rcond=SAME, hermitian=True)
        # residuals are what was measured less the model
        off = -inverse @ self.gradient[index]
        added, values = [], []
        for i, value, variance in zip(index, off.tolist(), np.diag(inverse), strict=True):
            place, run = self.columns[i].place, self.columns[i].run
            begins = self._begins(place, run)
            wide = WIDE * max(abs(value), float(variance) ** 0.5, STEP)
            added.append(
                Parameter(f"{place}@{run}", problem.system().unit(place), begins, begins - wide,
                          begins + wide, ((place, 1.0),), "nuisance", run)
            )  # fmt: skip
            values.append(begins + value)
        free = problem.with_parameters([*problem.parameters, *added])
        return estimate.simulator.of(free), np.concatenate([estimate.theta, values])


def _told(again: Estimate, place: str) -> str:
    """Where the run begins that is farthest off, and how many others are off, too."""
    found = [
        (abs(value - p.nominal), quantity(value, p.unit), low, high, p)
        for p, value, low, high in zip(
            again.problem.parameters, again.theta.tolist(), again.low.tolist(),
            again.high.tolist(), strict=True,
        )
        if p.targets == ((place, 1.0),) and p.run and not low <= p.nominal <= high
    ]  # fmt: skip
    if not found:
        return ""
    _, value, low, high, p = max(found, key=lambda item: item[0])
    others = f", and less so in {len(found) - 1} more" * (len(found) > 1)
    return f"{place} {value} [{low:.4g}, {high:.4g}] instead of {p.nominal:.4g} in {p.run}{others}"
