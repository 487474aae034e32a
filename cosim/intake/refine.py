"""What only simulating tells of a mapping: start values, the communication step, parameters.

All of it at the system's own values, over the beginning of the runs that are fitted.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..calibrate.clocks import clocked
from ..calibrate.differences import jacobian
from ..calibrate.parts import MeasuredRun, Parameter, adjustable, natural
from ..calibrate.problem import Problem
from ..calibrate.simulator import Simulator
from ..errors import CosimError, InputError
from ..spec.units import parse
from ..system.system import System
from .draft import Draft, Entry

Vector = NDArray[np.float64]
LENGTH = 20.0
"""[s] of a run that is looked at."""
DIVISIONS = (1, 2, 4, 5, 8, 10, 20, 40, 50, 100)
"""Parts of a sample interval that are tried as communication step, from the coarsest on."""
ENOUGH, FINE = 0.1, 0.03
"""Change by a finer step, over the noise, below which a step is fine enough; the second one adds
less than a nat to 2000 samples, which nobody can take for physics."""
SEARCHED = 1.0
"""What a search's step may change, over the noise: a diagnosis takes it from the data, where the
parameters of its fits hardly change it (`calibrate.deferred`)."""
PART = 0.37
"""Of a sample, by which a clock is late when steps are tried: no simple fraction."""
FIRST = 5
"""Samples at the beginning that count together."""
OFF = 10.0
"""Deviations from which a beginning is another one than the model's (`calibrate.checks.starts`)."""
AROUND = 20.0
"""Deviations within which a start value is sought, besides what a late clock moves it by."""
KNOWN = 0.3
"""Share of its value to which a parameter must be told by the logs to be estimated."""
WIDE = 5.0
"""Bounds of a parameter are its value over this, and times this."""
APART = 1e-3
"""Share of what the logs tell of a parameter that must be left beside the others: differences with
a step of 5e-3 leave 2.5e-5 of two that do the same."""
TOLERANCE, ASSUMED = 0.1, 3
"""How well values are known that the logs do not tell apart from what is estimated, as a share of
them: a tenth, as data sheets are; and how many such values are estimated at most."""
PARALLEL = 0.9
"""Cosine of what two such values do to the others, from which the second one adds nothing."""
NEARER = 2.0
"""What a parameter counts more that belongs to what is measured, where another does the same."""
BUILT = ("ratio", "teeth", "poles", "counts", "gravity")
"""Words in names of parameters that are known from how a machine is built; all but the first also
in what is said of them, where a ratio may be one of damping."""


@dataclass(frozen=True)
class Start:
    """A start value that moves the first sample of a channel.

    Attributes:
        channel: name of it.
        target: full name of the variable.
        factor: variable = factor * channel, in the channel's unit.
        apart: first samples less what the model has, in the channel's unit.
    """

    channel: str
    target: str
    factor: float
    apart: float


def short(problem: Problem) -> Problem:
    """The problem on the beginning of its identification runs."""
    runs = []
    for run in problem.chosen("identification"):
        count = max(int(np.searchsorted(run.times, run.times[0] + LENGTH)), 2)
        runs.append(replace(run, times=run.times[:count], data=run.data[:count]))
    kept = [p for p in problem.parameters if not p.run or p.run in {run.name for run in runs}]
    return problem.changed(runs=runs, parameters=kept)


# -- step ------------------------------------------------------------------------------------------


class Steps(NamedTuple):
    """Communication steps.

    Attributes:
        step: that is right.
        change: what the next finer one changes, over the noise; None if that is not known.
        search: a coarser one for thousands of simulations, the same if none will do.
    """

    step: float
    change: float | None
    search: float


def choose_steps(problem: Problem, shortest: float) -> Steps:
    """The coarsest communication step whose next finer one changes less than `ENOUGH`, and the
    coarsest that changes less than `SEARCHED` from there.

    Clocks that are estimated are tried late by a part of a sample: what is recorded is interpolated
    then, and must change less than `FINE`, and a search takes the same steps. (Errors of the
    exchange of several FMUs are measured and removed by a diagnosis.)

    Args:
        problem: with `period`, the interval of samples.
        shortest: interval [s] of what drives the system; steps are at most half of it.
    """
    period = problem.period or problem.step
    clocks = bool(clocked(problem.parameters))
    theta = problem.nominal
    for index, parameter in enumerate(problem.parameters):
        if clocked([parameter]):
            theta[index] += PART * period
    enough = FINE if clocks else ENOUGH
    known: dict[int, Vector | None] = {}

    def at(division: int) -> Vector | None:
        if division not in known:
            step = period / division
            trial = problem.changed(
                step=step, search=replace(problem.search, step=step),
                period=step if clocks else period,
            )  # fmt: skip
            try:
                known[division] = Simulator(trial).simulate(theta, trial.runs[0])
            except CosimError:  # too coarse for it
                known[division] = None
        return known[division]

    allowed = [n for n in DIVISIONS if period / n <= 0.5 * shortest]
    allowed = allowed or [DIVISIONS[-1]]

    def changed(division: int, finer: int) -> float:
        coarse, fine = at(division), at(finer)
        if coarse is None or fine is None:
            return math.inf
        apart = np.nanmean(((coarse - fine) / problem.sigma) ** 2, axis=0)
        return float(np.sqrt(np.nanmax(apart)))

    right, change = allowed[-1], None
    for division, finer in itertools.pairwise(allowed):
        if (found := changed(division, finer)) < enough:
            right, change = division, found
            break
    search = right
    if not clocks:  # whole multiples of the right one
        coarser = (n for n in allowed if n < right and right % n == 0)
        search = next((n for n in coarser if changed(n, right) < SEARCHED), right)
    return Steps(period / right, change, period / search)


# -- start values ----------------------------------------------------------------------------------


def starts_of(problem: Problem) -> list[Start]:
    """Start values that move the first samples of channels, one per channel at most."""
    run = problem.runs[0]
    simulator = Simulator(problem)
    session = simulator.session(run)
    try:
        values = problem.values(problem.nominal, run)
        _, rows = session.run(values)
        place = {name: k for k, name in enumerate(session.names)}
        moved: dict[str, Vector] = {}
        for name, start in _states(problem.plain()).items():
            try:
                _, other = session.run({**values, name: start + 1.0})
            except CosimError:  # outside of what it may be
                continue
            moved[name] = other[0] - rows[0]
    finally:
        session.close()
    model = {r.name: simulator.simulate(problem.nominal, r) for r in problem.runs}
    found = []
    for index, channel in enumerate(problem.channels):
        own = {n: m[place[channel.signal]] * channel.gain for n, m in moved.items()}
        own = {n: gain for n, gain in own.items() if abs(gain) > 1e-6}
        if not own:
            continue
        # what moves fewest others, and turns by one
        target = min(
            own, key=lambda n: (np.count_nonzero(np.abs(moved[n]) > 1e-6), abs(abs(own[n]) - 1.0))
        )
        apart = max((_apart(problem, r, model[r.name], index) for r in problem.runs), key=abs)
        found.append(Start(channel.name, target, 1.0 / own[target], apart))
    return found


def _states(system: System) -> dict[str, float]:
    """Continuous variables whose start value can be given, with it."""
    found = {}
    for name, member in system.members.items():
        for v in member.description.variables.values():
            if (
                v.type == "Float64" and v.size == 1 and v.variability == "continuous"
                and v.causality in ("local", "output") and v.initial == "exact"
            ):  # fmt: skip
                found[f"{name}.{v.name}"] = float(v.start[0] or 0.0) if v.start else 0.0
    return found


def _apart(problem: Problem, run: MeasuredRun, model: Vector, index: int) -> float:
    good = np.flatnonzero(np.isfinite(run.data[:, index]))[:FIRST]
    return float(np.mean(run.data[good, index] - model[good, index])) if good.size else 0.0


def add_starts(draft: Draft, problem: Problem, late: float) -> None:
    """Write start values as nuisances: of places always, of other quantities where they are off."""
    for start in starts_of(problem):
        channel = next(c for c in problem.channels if c.name == start.channel)
        unit = parse(channel.unit or "1")
        place = unit.exponents in (parse("m").exponents, parse("rad").exponents)
        if not place and abs(start.apart) < OFF * channel.sigma:
            continue
        column = next(c for c in draft.columns if c.name == start.channel)
        index = [c.name for c in problem.channels].index(start.channel)
        speeds = [_speed(run, index) for run in problem.runs]
        timed = any(f"clock:{start.channel}" in e.keys["targets"] for e in draft.nuisances)
        span = AROUND * channel.sigma + (late * max(speeds) if timed else 0.0)
        target: object = start.target
        if abs(start.factor - 1.0) > 1e-6:
            target = {start.target: start.factor}
        draft.nuisances.append(
            Entry(
                {"name": f"start of {start.channel}", "unit": channel.unit, "per_run": True,
                 "nominal": f"first:{column.name}", "span": float(f"{span:.2g}"),
                 "targets": target},
                f"Where {start.channel} begins, run by run: its first sample has noise on it"
                + (", and the clock may be late." if timed else "."),
            )
        )  # fmt: skip


def _speed(run: MeasuredRun, index: int) -> float:
    """Size of the change per second of a channel that it seldom passes."""
    values, times = run.data[:, index], run.times
    good = np.isfinite(values)
    wide = max(good.sum() // 200, 1)  # so that noise does not count
    values, times = values[good][::wide], times[good][::wide]
    if values.size < 3:
        return 0.0
    return float(np.quantile(np.abs(np.diff(values) / np.diff(times)), 0.95))


# -- parameters ------------------------------------------------------------------------------------


def candidates(problem: Problem) -> tuple[list[Parameter], list[Parameter], list[str]]:
    """Parameters of the system that may be estimated, those that are known from how the machine is
    built (ratios, counts per turn, periods of loops and all else that can only be set beforehand),
    and those that are 0 and so have no size.
    """
    found: list[Parameter] = []
    built: list[Parameter] = []
    zero: list[str] = []
    set_ = {n for p in problem.parameters for n, _ in p.targets} | set(problem.constants)
    for name, member in problem.plain().members.items():
        for variable in member.description.variables.values():
            full = f"{name}.{variable.name}"
            if not adjustable(variable) or full in set_:
                continue
            value = float(
                member.parameters.get(variable.name, (variable.start or (0.0,))[0]) or 0.0
            )
            if value == 0.0:
                zero.append(full)
                continue
            bounded = _bounded(
                full, variable.symbol, value, variable.minimum, variable.maximum, variable.text
            )
            said = set(re.findall("[a-z]+", variable.text.lower())) & set(BUILT[1:])
            known = said or any(word in variable.name.lower() for word in BUILT)
            known = known or not natural(variable, ())
            (built if known else found).append(bounded)
    return found, built, zero


def _bounded(
    name: str, unit: str, value: float, least: float | None, most: float | None, text: str
) -> Parameter:
    low, high = sorted((value / WIDE, value * WIDE))
    low, high = (
        max(low, -np.inf if least is None else least),
        min(high, np.inf if most is None else most),
    )
    return Parameter(name, unit, value, low, high, ((name, 1.0),), span=abs(value), text=text)


def told(problem: Problem, tried: Sequence[Parameter]) -> tuple[list[str], list[str]]:
    """Those of some parameters that the logs tell together, the best first; and those that decide
    what these come out as, which the logs show but do not tell apart from them.

    One after the other the parameter is taken that is told best beside those taken before, in
    spans and white noise; then those that are not told to `KNOWN` beside all others are left out.
    What is left out and would move those taken by more than their deviations, if it was off by
    `TOLERANCE`, decides, unless one that moves them more does so in the same way.
    """
    own = list(problem.parameters)
    both = problem.with_parameters([*own, *tried])
    found = jacobian(Simulator(both), both.nominal, "identification", central=False, relative=5e-3)
    measured = {c.signal.partition(".")[0] for c in problem.channels}
    size = len(both.parameters)
    information = np.zeros((size, size))
    for item in found:
        slopes = (
            np.nan_to_num(item.values.reshape(-1, item.columns.size)) * both.scale[item.columns]
        )
        information[np.ix_(item.columns, item.columns)] += slopes.T @ slopes
    kept = list(range(len(own)))
    left = list(range(len(own), size))

    def conditional(index: int, others: Sequence[int]) -> float:
        """Information on a parameter beside others."""
        if not others:
            return float(information[index, index])
        block = information[np.ix_(others, others)]
        cross = information[np.ix_(others, [index])][:, 0]
        return float(
            information[index, index] - cross @ np.linalg.lstsq(block, cross, rcond=1e-12)[0]
        )

    def enough(index: int, others: Sequence[int]) -> bool:
        rest = conditional(index, others)
        return bool(rest >= max(1.0 / KNOWN**2, APART * information[index, index]))

    def worth(index: int) -> float:
        near = both.parameters[index].name.partition(".")[0] in measured
        return conditional(index, kept) * (NEARER if near else 1.0)

    while left:
        best = max(left, key=worth)
        left.remove(best)
        if enough(best, kept):
            kept.append(best)
    chosen = kept[len(own) :]

    def others(index: int) -> list[int]:
        return [k for k in [*range(len(own)), *chosen] if k != index]

    while lacking := [i for i in chosen if not enough(i, others(i))]:
        chosen.remove(min(lacking, key=lambda i: conditional(i, others(i))))

    taken = [*range(len(own)), *chosen]
    block = information[np.ix_(taken, taken)]
    deviations = np.sqrt(np.diag(np.linalg.pinv(block, rcond=1e-12, hermitian=True)))
    moves: dict[int, Vector] = {}
    for index in range(len(own), size) if chosen else ():
        cross = information[np.ix_(taken, [index])][:, 0]
        moved = TOLERANCE * np.linalg.lstsq(block, cross, rcond=1e-12)[0] / deviations
        if index not in chosen and float(np.max(np.abs(moved[len(own) :]))) > 1.0:
            moves[index] = moved
    deciding: list[int] = []
    for index in sorted(moves, key=lambda i: -float(np.linalg.norm(moves[i]))):
        if all(_cosine(moves[index], moves[k]) < PARALLEL for k in deciding):
            deciding.append(index)
    names = [p.name for p in both.parameters]
    return [names[i] for i in chosen], [names[i] for i in deciding[:ASSUMED]]


def _cosine(first: Vector, second: Vector) -> float:
    """Of the angle between two directions, whatever their signs."""
    return abs(float(first @ second)) / float(np.linalg.norm(first) * np.linalg.norm(second))


def add_parameters(
    draft: Draft, problem: Problem, given: Mapping[str, tuple[float, ...]]
) -> list[str]:
    """Write the parameters that are estimated: those given, or those that the logs tell.

    Values that decide what these come out as are estimated, too, within the tolerance of a data
    sheet: held, they would make confident intervals around wrong values.

    Returns:
        Those that the logs do not tell apart from these.
    """
    free, built, zero = candidates(problem)
    if given:
        known = {p.name: p for p in (*free, *built)}
        for name, numbers in given.items():
            draft.parameters.append(_entry(_stated(problem, name, numbers, known.get(name))))
        return []
    chosen, deciding = told(problem, free) if free else ([], [])
    draft.parameters += [_entry(p) for p in free if p.name in chosen]
    draft.parameters += [_assumed(p) for p in free if p.name in deciding]
    kept = [p for p in free if p.name not in (*chosen, *deciding)]
    for what, names in (
        ("The logs do not tell these apart from the others, so they keep the system's values",
         [f"{p.name} = {p.nominal:.6g} {p.unit}" for p in kept]),
        ("Known from how the machine is built", [f"{p.name} = {p.nominal:.6g}" for p in built]),
        ("0 in the system, and left so; --parameter NAME=NOMINAL:MIN:MAX estimates one", zero),
    ):  # fmt: skip
        if names:
            draft.held.append(f"{what}: {', '.join(names)}.")
    return [p.name for p in free if p.name not in chosen] if chosen else []


def _stated(
    problem: Problem, name: str, numbers: tuple[float, ...], known: Parameter | None
) -> Parameter:
    """A parameter that the command line names."""
    variable = problem.plain().variables(name)[1][0]
    if len(numbers) == 3:
        return Parameter(name, variable.symbol, *numbers, ((name, 1.0),), text=variable.text)
    value = numbers[0] if numbers else known.nominal if known else 0.0
    if value == 0.0:
        raise InputError(
            f"--parameter {name}: it is 0 in the system, so bounds must be given: "
            f"--parameter {name}=NOMINAL:MIN:MAX"
        )
    return _bounded(name, variable.symbol, value, variable.minimum, variable.maximum, variable.text)


def _entry(p: Parameter) -> Entry:
    return Entry(
        {"name": p.name, "unit": p.unit, "nominal": float(f"{p.nominal:.6g}"),
         "min": float(f"{p.minimum:.4g}"), "max": float(f"{p.maximum:.4g}"), "targets": p.name},
        f"{p.text}." if p.text else "",
    )  # fmt: skip


def _assumed(p: Parameter) -> Entry:
    """An entry with what is known beforehand."""
    far = 3.0 * TOLERANCE * abs(p.nominal)  # nor does a model that lacks something drive it away
    low, high = max(p.minimum, p.nominal - far), min(p.maximum, p.nominal + far)
    entry = _entry(replace(p, minimum=low, maximum=high))
    prior = float(f"{TOLERANCE * abs(p.nominal):.3g}")
    text = (
        f"The logs do not tell it apart from the others: taken as known to {TOLERANCE:.0%}, "
        "and the intervals of all others contain that. Correct `prior` (a standard deviation, in "
        "the unit) if you know it better; weigh it, say."
    )
    return Entry({**entry.keys, "prior": prior}, f"{entry.comment} {text}".strip())
