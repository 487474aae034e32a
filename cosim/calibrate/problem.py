"""What is to be estimated: a model with uncertain parameters, and data with their noise.

    problem = read_problem("data/MB-12")
    simulator = Simulator(problem)
    for name, residual in simulator.residuals(problem.nominal, "identification"):
        ...

A problem says nothing of how it is simulated; `simulator.Simulator` does that.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import UnknownNameError, listing
from ..spec.hints import NO_HINTS, from_json
from ..system.provider import Provider
from ..system.system import System
from ..system.toml import SystemFile
from .checks.finding import NO_SOURCE, Source
from .model import Model
from .parts import (
    LOGGED,
    Assigned,
    Channel,
    Coarse,
    MeasuredRun,
    Parameter,
    free_parameter,
    natural,
)

Vector = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Problem:
    """A model with uncertain parameters, measured channels and runs.

    Attributes:
        name: of the data set.
        model: the system.
        parameters, channels, runs: see there.
        step: communication step [s].
        search: coarser way for thousands of simulations; it holds where `step` is its step.
        constants: full variable name -> value for all runs.
        held: name of what was a parameter -> value at which it is held (`constants` have it, too).
        algorithm, options: of the master; a search may have further options.
        period: time between recorded points [s]; the sample interval if not given.
        tick: period of the rig's own fastest loop [s], which `step` divides: no finer exchange than
            `step` is more exact. Unknown if None, and what `step` adds is measured.
        relative: channels x, y, yaw of planar poses in the frame of the run's anchor.
        late: parameters of single runs that are held until `nuisance.released` estimates them.
        far: whether all residuals count in full, since nearly all are large (see `unstable`).
        further: give runs of the data set that need another system; read when they are asked for.
        source: where the data come from, for their checks.
        shafts: angle of an effect (see `shaft`) -> what it is in proportion with, and the ratio.
        turns: angle of a periodic effect (see `shaft`) -> how far it turns in a run at most [rad].
        readings: error that an effect adds to a sensor -> starts of runs that it has read, with
            factors: a run begins there less the error.
        read_off: the same of a column's zero (`bias:CHANNEL`), and of starts that are estimated
            about its first value, too: they are what it would have read without noise.
    """

    name: str
    model: Model
    parameters: Sequence[Parameter]
    channels: Sequence[Channel]
    runs: Sequence[MeasuredRun]
    step: float
    search: Coarse
    constants: Mapping[str, float] = field(default_factory=dict)
    held: Mapping[str, float] = field(default_factory=dict)
    algorithm: str = "jacobi"
    options: Mapping[str, Any] = field(default_factory=dict)
    period: float | None = None
    tick: float | None = None
    relative: Sequence[Sequence[str]] = ()
    late: Sequence[Parameter] = ()
    far: bool = False
    further: Sequence[Callable[[], Problem]] = ()
    source: Source = NO_SOURCE
    shafts: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    turns: Mapping[str, float] = field(default_factory=dict)
    readings: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    read_off: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("parameters", "channels", "runs", "relative", "late", "further"):
            object.__setattr__(self, name, tuple(getattr(self, name)))

    @property
    def unstable(self) -> bool:
        """Whether what is far off says little: late values decide when something turns over.

        Not where the declared system is so far off that moments hardly count.
        """
        return bool(self.late) and not self.far

    # -- values ------------------------------------------------------------------------------------

    @cached_property
    def _columns(self) -> dict[str, Vector]:
        return {
            of: np.array([getattr(p, of) for p in self.parameters], dtype=np.float64)
            for of in ("nominal", "minimum", "maximum", "scale")
        }

    def _column(self, of: str) -> Vector:
        return self._columns[of].copy()

    @property
    def nominal(self) -> Vector:
        """Start values of the parameters."""
        return self._column("nominal")

    @property
    def lower(self) -> Vector:
        """Lower bounds."""
        return self._column("minimum")

    @property
    def upper(self) -> Vector:
        """Upper bounds."""
        return self._column("maximum")

    @property
    def scale(self) -> Vector:
        """Typical changes."""
        return self._column("scale")

    @property
    def sigma(self) -> Vector:
        """Noise of the channels."""
        return np.array([channel.sigma for channel in self.channels])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, `name@run` where they concern one run."""
        return tuple(p.name for p in self.parameters)

    @cached_property
    def _places(self) -> dict[str, int]:
        return {p.name: index for index, p in enumerate(self.parameters)}

    @cached_property
    def _by_name(self) -> dict[str, MeasuredRun]:
        return {run.name: run for run in self.runs}

    def index(self, name: str) -> int:
        """Position of a parameter.

        Raises:
            UnknownNameError: there is none.
        """
        if name not in self._places:
            raise UnknownNameError(f"{self.name}: {listing(self._places, name)} as parameter")
        return self._places[name]

    def run(self, name: str) -> MeasuredRun:
        """A run by its name.

        Raises:
            UnknownNameError: there is none.
        """
        if name not in self._by_name:
            raise UnknownNameError(f"{self.name}: {listing(self._by_name, name)} as run")
        return self._by_name[name]

    def chosen(self, purpose: str | Iterable[str] | None) -> list[MeasuredRun]:
        """Runs of a purpose, runs by name, or all."""
        if purpose is None:
            return list(self.runs)
        if isinstance(purpose, str):
            return [run for run in self.runs if run.purpose == purpose]
        return [self.run(name) for name in purpose]

    def columns(self, run: str) -> NDArray[np.intp]:
        """Indices of the parameters that concern a run."""
        return np.array(
            [i for i, p in enumerate(self.parameters) if p.run in ("", run)], dtype=np.intp
        )

    # -- the model ---------------------------------------------------------------------------------

    @property
    def file(self) -> SystemFile:
        """The system's."""
        return self.model.file

    @property
    def provider(self) -> Provider | None:
        """Where variants come from."""
        return self.model.provider

    @property
    def instances(self) -> Mapping[str, str]:
        """Name -> variant."""
        return self.model.instances

    @property
    def chosen_options(self) -> Mapping[str, Any]:
        """Of the master's algorithm at this step."""
        own = self.search.options if self.step == self.search.step else {}
        return {**self.options, **own}

    @property
    def _coarse(self) -> Mapping[str, float]:
        return self.search.parameters if self.step == self.search.step else {}

    @cached_property
    def kind(self) -> Hashable:
        """What problems have in common that the same prepared simulations serve."""
        return (
            *(tuple(sorted(i.items())) for i in (self.instances, self._coarse)),
            repr(sorted(self.chosen_options.items())),  # values may be tables
            self.step, self.algorithm, self.period,
            tuple((c.signal, c.shift) for c in self.channels),
        )  # fmt: skip

    @cached_property
    def _assignments(self) -> dict[str, Assigned]:
        return {}

    @cached_property
    def _system(self) -> System:
        return self.model.system({**self.constants, **self._coarse})

    def system(self) -> System:
        """The system with the constants set; parameters that a variant lacks are left out."""
        return self._system

    def plain(self) -> System:
        """The system as simulations have it, who get the constants with the other values."""
        return self.model.plain(self._coarse)

    def _has(self, name: str) -> bool:
        try:
            self.plain().variables(name)
        except UnknownNameError:
            return False
        return True

    @cached_property
    def _fixed(self) -> dict[str, float]:
        known = {n: v for n, v in self.constants.items() if self._has(n)}
        if len(known) < sum(not n.startswith(LOGGED) for n in self.constants):
            self.system()  # says which one it does not know
        return {n: v for n, v in known.items() if n not in self._coarse}

    def values(self, theta: Vector, run: MeasuredRun | str) -> dict[str, float]:
        """Full variable name -> value for a run."""
        run = self.run(run) if isinstance(run, str) else run
        assigned = self._assigned(run)
        set_here = assigned.of(theta, assigned.variables)
        values = {**assigned.known, **set_here}
        for error, starts in self.readings.items():
            if off := values.get(error, 0.0):
                # an estimated start is the true one
                for name in starts.keys() & values.keys() - set_here.keys():
                    values[name] -= starts[name] * off
        errors = self.log_errors(theta, run) if self.read_off else {}
        for error, starts in self.read_off.items():
            if off := errors.get(error, 0.0):
                for name in starts.keys() & values.keys():
                    values[name] -= starts[name] * off
        return values

    def log_errors(self, theta: Vector, run: MeasuredRun | str) -> dict[str, float]:
        """What is wrong with columns of a run's log, where that is estimated or held.

        By CHANNEL or INPUT how late its clock is [s]; what `drift:CHANNEL` is late comes on top,
        per time since the run's first sample. `gain:CHANNEL` and `bias:CHANNEL`: see `recorder`.
        """
        run = self.run(run) if isinstance(run, str) else run
        assigned = self._assigned(run)
        return {**assigned.errors, **assigned.of(theta, assigned.log)}

    def _assigned(self, run: MeasuredRun) -> Assigned:
        """What is set in a run; made once, since thousands of simulations ask for it."""
        found = self._assignments.get(run.name)
        if found is None or found.run is not run:
            starts = {name: value for name, value in run.starts.items() if self._has(name)}
            given = {**self.constants, **run.starts}
            found = self._assignments[run.name] = Assigned.among(
                self.parameters, run, {**self._fixed, **starts}, given
            )
        return found

    # -- changes -----------------------------------------------------------------------------------

    def changed(self, **changes: Any) -> Problem:
        """The problem with other attributes."""
        return replace(self, **changes)

    def hold(self, values: Mapping[str, float]) -> Problem:
        """The problem with these parameters held at these values, no longer parameters."""
        constants, runs = dict(self.constants), {run.name: run for run in self.runs}
        for name, value in values.items():
            parameter = self.parameters[self.index(name)]
            items = parameter.set(value)
            if parameter.run:
                run = runs[parameter.run]
                runs[run.name] = replace(run, starts={**run.starts, **items})
            else:
                constants.update(items)
        kept = [p for p in self.parameters if p.name not in values]
        return self.changed(
            parameters=kept, constants=constants, runs=list(runs.values()),
            held={**self.held, **values},
        )  # fmt: skip

    def only(self, runs: Iterable[str]) -> Problem:
        """The problem with some of its runs."""
        names = set(runs)
        return self.changed(
            runs=[run for run in self.runs if run.name in names],
            parameters=[p for p in self.parameters if not p.run or p.run in names],
            late=[p for p in self.late if p.run in names],
        )

    def with_parameters(self, parameters: Sequence[Parameter]) -> Problem:
        """The problem with other parameters."""
        return self.changed(parameters=parameters)

    def with_data(self, data: Mapping[str, Vector]) -> Problem:
        """The problem with other measured values, by run."""
        runs = [replace(run, data=data.get(run.name, run.data)) for run in self.runs]
        return self.changed(runs=runs)

    def with_effects(self, changes: Mapping[str, str]) -> Problem:
        """The problem on a system with changed variants.

        Parameters that only the new variants have become parameters of the problem, where they are
        `natural`: strengths start at 0, which reproduces this problem, the others at the FMU's
        values.

        Args:
            changes: see `Model.changed`.

        Raises:
            VariantError, UnknownNameError: it does not fit.
        """
        changed = self.changed(model=self.model.changed(changes))
        old, new = self.plain(), changed.plain()
        added: list[Parameter] = []
        for name, member in new.members.items():
            if changed.instances[name] == self.instances[name]:
                continue
            before = old.members[name].description.variables
            strengths = set(member.description.extra.get("strengths", ()))
            stated = {n for run in self.runs for n in run.starts}
            hints = from_json(member.description.extra)
            for variable in member.description.variables.values():
                full = f"{name}.{variable.name}"
                if (
                    natural(variable, strengths)
                    and variable.name not in before
                    and full not in changed.constants
                    and full not in stated
                ):
                    added.append(
                        free_parameter(
                            variable, full, full, strength=variable.name in strengths,
                            hints=hints.get(variable.name, NO_HINTS).within(name, variable.name),
                        )
                    )  # fmt: skip
        return changed.changed(
            parameters=[*self.parameters, *added], runs=[changed.standing(run) for run in self.runs]
        )

    def counting(self) -> Problem:
        """The problem with parameters that count cycles per turn spanned by one more in a run."""
        turned = [self.turns.get(shaft(p.hints.cycles), 0.0) for p in self.parameters]
        return self.with_parameters(
            [
                replace(p, span=2.0 * math.pi / angle) if angle else p
                for p, angle in zip(self.parameters, turned, strict=True)
            ]
        )

    def standing(self, run: MeasuredRun) -> MeasuredRun:
        """The run with where the shafts of effects stand when it begins, as `shafts` says."""
        if not self.shafts:
            return run
        starts = dict(run.starts)
        for name, member in self.plain().members.items():
            for variable in member.description.variables.values():
                if f"der({variable.name})" not in member.description.variables:
                    continue
                for element in variable.elements():
                    other, ratio = self.shafts.get(shaft(f"{name}.{element}"), ("", 0.0))
                    if other in run.starts:
                        starts[f"{name}.{element}"] = ratio * run.starts[other]
        return run if starts == run.starts else replace(run, starts=starts)


def shaft(name: str) -> str:
    """What an effect's angle is called apart from the effect: `load.flange.cogging.theta` is
    `load.flange.theta`, for all effects there integrate one shaft's speed.
    """
    place, _, leaf = name.rpartition(".")
    return f"{place.rpartition('.')[0]}.{leaf}"
