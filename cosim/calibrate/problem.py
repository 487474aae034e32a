"""A calibration problem: a system, its uncertain parameters, measured channels and runs.

    problem = read_problem("data/MB-12")
    theta = problem.nominal
    for name, residual in problem.residuals(theta, "identification"):
        ...

Residuals are (measured - model) / sigma, one row per sample and one column per channel, NaN where
nothing was measured. Simulations run in threads, each with sessions of its own.
"""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..data.segments import relative_pose
from ..errors import FmuCallError, UnknownNameError, listing
from ..master.master import Master
from ..master.session import Session
from ..system.provider import Provider
from ..system.system import System
from ..system.toml import SystemFile
from ..system.variants import apply
from .checks.finding import Source
from .differences import STEP, directional, jacobian
from .parts import (
    COINCIDENT,
    Channel,
    Coarse,
    Parameter,
    Run,
    Sampler,
    Sensitivity,
    adjustable,
    free_parameter,
)
from .pool import Key, Pool, Ran

Vector = NDArray[np.float64]


class Problem:
    """A system with parameters, channels and runs.

    Args:
        name: of the data set.
        file: the system.
        provider: where variants come from.
        parameters, channels, runs: see there.
        constants: full variable name -> value for all runs.
        step: communication step [s].
        algorithm: of the master.
        period: time between recorded points [s]; the sample interval if not given.
        instances: name -> variant, the system's own if not given.
        workers: threads.
        ticks: the rig itself exchanges once per `step`, so no finer exchange is more exact.
        search: coarser way for thousands of simulations; it holds where `step` is its step.
        relative: channels x, y, yaw of planar poses in the frame of the run's anchor.
        late: parameters of single runs that are held until `nuisance.released` estimates them.
        far: whether all residuals count in full, since nearly all are large (see `unstable`).
        further: give runs of the data set that need another system; read when they are asked for.
        pool: sessions shared with problems that this one was made from.

    Attributes:
        evaluations: simulated runs so far, without those known from before.
        costs: processor time that a run took, the last time [s].
        limits: processor time that it may take, no limit if not given [s].
        source: where the data come from; set by who reads them.
    """

    source: Source = Source()

    def __init__(
        self,
        name: str,
        file: SystemFile,
        provider: Provider | None,
        parameters: Sequence[Parameter],
        channels: Sequence[Channel],
        runs: Sequence[Run],
        *,
        constants: Mapping[str, float] | None = None,
        step: float,
        algorithm: str = "jacobi",
        period: float | None = None,
        instances: Mapping[str, str] | None = None,
        workers: int | None = None,
        ticks: bool = False,
        search: Coarse | None = None,
        relative: Sequence[Sequence[str]] = (),
        late: Sequence[Parameter] = (),
        far: bool = False,
        further: Sequence[Callable[[], Problem]] = (),
        pool: Pool | None = None,
    ) -> None:
        self.ticks, self.search = ticks, search or Coarse(step)
        self.search_step = self.search.step
        self.name, self.file, self.provider = name, file, provider
        self.parameters, self.channels = tuple(parameters), tuple(channels)
        self.runs = tuple(runs)
        self.relative, self.late, self.far = tuple(relative), tuple(late), far
        self.further = tuple(further)
        self.constants = dict(constants or {})
        self.step, self.algorithm, self.period = step, algorithm, period
        self.instances = dict(instances or file.instances)
        self.workers = workers or os.cpu_count() or 1
        self.evaluations = 0
        self.costs: dict[str, float] = {}
        self.limits: dict[str, float] = {}
        self._by_name = {run.name: run for run in self.runs}
        self._pool = pool or Pool()
        self._lock = threading.Lock()
        self._system: System | None = None
        self._fixed: dict[str, float] | None = None
        self._keys: dict[str, Key] = {}
        self._known = {p.name: index for index, p in enumerate(self.parameters)}

    @property
    def unstable(self) -> bool:
        """Whether what is far off says little: late values decide when something turns over.

        Not where the declared system is so far off that moments hardly count.
        """
        return bool(self.late) and not self.far

    # -- values ------------------------------------------------------------------------------------

    def _column(self, of: str) -> Vector:
        return np.array([getattr(p, of) for p in self.parameters], dtype=np.float64)

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
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, `name@run` where they concern one run."""
        return tuple(p.name for p in self.parameters)

    def index(self, name: str) -> int:
        """Position of a parameter.

        Raises:
            UnknownNameError: there is none.
        """
        if name not in self._known:
            raise UnknownNameError(f"{self.name}: {listing(self._known, name)} as parameter")
        return self._known[name]

    def run(self, name: str) -> Run:
        """A run by its name.

        Raises:
            UnknownNameError: there is none.
        """
        if name not in self._by_name:
            raise UnknownNameError(f"{self.name}: {listing(self._by_name, name)} as run")
        return self._by_name[name]

    def chosen(self, purpose: str | Iterable[str] | None) -> list[Run]:
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

    # -- simulation --------------------------------------------------------------------------------

    @property
    def _coarse(self) -> Mapping[str, float]:
        return self.search.parameters if self._coarse_step else {}

    def system(self) -> System:
        """The system with the constants set; parameters that a variant lacks are left out."""
        if self._system is None:
            system = self._built({**self.file.parameters, **self.constants, **self._coarse})
            self._system = system
        return self._system

    def _built(self, values: Mapping[str, float]) -> System:
        system = replace(self.file, instances=self.instances, parameters={}).build(self.provider)
        for name, value in values.items():
            if name.partition(".")[0] in self.instances:
                try:
                    system.set(name, value)
                except UnknownNameError:
                    if self.instances == self.file.instances:
                        raise
        return system

    def _plain(self) -> System:
        """The system as sessions run it: they get the constants with the other values."""
        kind = self._kind
        system = self._pool.system(kind)
        if system is None:
            values = {**self.file.parameters, **self._coarse}
            system = self._pool.keep(kind, self._built(values))
        return system

    @cached_property
    def _kind(self) -> Hashable:
        options = self.search.options if self._coarse_step else {}
        return (
            *(tuple(sorted(items.items())) for items in (self.instances, self._coarse, options)),
            self.step, self.algorithm, self.period,
            tuple((c.signal, c.shift) for c in self.channels),
        )  # fmt: skip

    @property
    def _coarse_step(self) -> bool:
        return self.step == self.search.step

    def _key(self, run: Run) -> Key:
        if run.name not in self._keys:
            times = run.times
            interval = float(np.median(np.diff(times)))
            spans = (float(times[0]), float(times[-1]), interval, run.lead)
            self._keys[run.name] = Key(self._kind, (run.name, spans, id(run.inputs)))
        return self._keys[run.name]

    def _has(self, name: str) -> bool:
        try:
            self._plain().variables(name)
        except UnknownNameError:
            return False
        return True

    def session(self, run: Run) -> Session:
        """A new prepared run."""
        system = self._plain()
        options = self.search.options if self._coarse_step else {}
        master = Master(system, self.algorithm, self.step, options=options)
        interval = self.period or float(np.median(np.diff(run.times)))
        every = max(round(interval / self.step), 1)
        size = every * self.step
        first = float(run.times[0]) - run.lead
        last = float(run.times[-1]) + max(channel.shift for channel in self.channels)
        count = math.ceil((last - first) / size - COINCIDENT)
        return Session(
            master,
            count * size,
            inputs=run.inputs,
            record=list(dict.fromkeys(channel.signal for channel in self.channels)),
            every=every,
            start=first if abs(first) > COINCIDENT * interval else 0.0,
        )

    def values(self, theta: Vector, run: Run | str) -> dict[str, float]:
        """Full variable name -> value for a run."""
        run = self.run(run) if isinstance(run, str) else run
        if self._fixed is None:
            known = {n: v for n, v in self.constants.items() if self._has(n)}
            if len(known) < len(self.constants):
                self.system()  # says which one it does not know
            self._fixed = {n: v for n, v in known.items() if n not in self._coarse}
        found = dict(self._fixed)
        found.update((name, value) for name, value in run.starts.items() if self._has(name))
        for parameter, value in zip(self.parameters, theta.tolist(), strict=True):
            if parameter.run in ("", run.name):
                found.update(parameter.set(value))
        return found

    def simulate(self, theta: Vector, run: Run | str) -> Vector:
        """What the channels would read: one row per sample.

        Raises:
            StepError: an FMU failed, or the run exceeded its limit.
            ValueRangeError: a value outside the bounds that its FMU declares.
        """
        run = self.run(run) if isinstance(run, str) else run
        ran = self._ran(self.values(theta, run), run)
        with self._lock:
            self.costs[run.name] = ran.cost
        place = {name: column for column, name in enumerate(ran.names)}
        sampler = Sampler(run.times, ran.times)
        read = np.column_stack([c.of(sampler, ran.rows[:, place[c.signal]]) for c in self.channels])
        for names in self.relative:
            pose = [[c.name for c in self.channels].index(name) for name in names]
            read[:, pose] = relative_pose(read[:, pose], run.anchor)
        return read

    def _ran(self, values: dict[str, float], run: Run) -> Ran:
        key, limit = self._key(run), self.limits.get(run.name, math.inf)
        if (known := self._pool.ran(key, values, limit)) is not None:
            return known
        with self._lock:
            self.evaluations += 1
            session = self._pool.take(key) or self.session(run)
        begun = time.thread_time()
        try:
            times, rows = session.run(values, limit=limit)
        except FmuCallError:
            session.close()
            raise
        ran = Ran(session.names, times, rows, time.thread_time() - begun, run.inputs)
        self._pool.give(key, session, run.inputs)
        self._pool.remember(key, values, ran)
        return ran

    def spread(self, function: Any, items: Sequence[Any]) -> list[Any]:
        """Apply a function that simulates to items, in threads."""
        self._plain()  # FMUs are built once, before threads ask for them
        if self.workers == 1 or len(items) < 2:
            return [function(item) for item in items]
        with ThreadPoolExecutor(self.workers) as pool:
            return list(pool.map(function, items))

    @property
    def sigma(self) -> Vector:
        """Noise of the channels."""
        return np.array([channel.sigma for channel in self.channels])

    def residuals(
        self, theta: Vector, purpose: str | Iterable[str] | None = "identification"
    ) -> list[tuple[str, Vector]]:
        """(run, (measured - model) / sigma) for the runs of a purpose (or named, or all)."""
        runs = self.chosen(purpose)
        models = self.spread(lambda run: self.simulate(theta, run), runs)
        return [
            (run.name, (run.data - model) / self.sigma)
            for run, model in zip(runs, models, strict=True)
        ]

    def jacobian(
        self,
        theta: Vector,
        purpose: str | Iterable[str] | None = "identification",
        *,
        columns: Sequence[int] | None = None,
        central: bool = True,
        relative: float = STEP,
    ) -> list[Sensitivity]:
        """Derivatives of the model values over sigma (see `differences.jacobian`)."""
        return jacobian(self, theta, purpose, columns=columns, central=central, relative=relative)

    def directional(
        self, theta: Vector, run: Run | str, directions: Vector, *, relative: float = STEP
    ) -> Sensitivity:
        """Derivatives of one run along directions (see `differences.directional`)."""
        return directional(self, theta, run, directions, relative=relative)

    # -- changes -----------------------------------------------------------------------------------

    def _with(self, **changes: Any) -> Problem:
        arguments = {
            "name": self.name, "file": self.file, "provider": self.provider,
            "parameters": self.parameters, "channels": self.channels, "runs": self.runs,
            "constants": self.constants, "step": self.step, "algorithm": self.algorithm,
            "period": self.period, "instances": self.instances, "workers": self.workers,
            "ticks": self.ticks, "search": self.search, "relative": self.relative,
            "late": self.late, "far": self.far, "further": self.further, "pool": self._pool,
            **changes,
        }  # fmt: skip
        return Problem(**arguments)

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
        return self._with(parameters=kept, constants=constants, runs=list(runs.values()))

    def only(self, runs: Iterable[str]) -> Problem:
        """The problem with some of its runs."""
        names = set(runs)
        return self._with(
            runs=[run for run in self.runs if run.name in names],
            parameters=[p for p in self.parameters if not p.run or p.run in names],
            late=[p for p in self.late if p.run in names],
        )

    def with_parameters(self, parameters: Sequence[Parameter]) -> Problem:
        """The problem with other parameters."""
        return self._with(parameters=parameters)

    def with_data(self, data: Mapping[str, Vector]) -> Problem:
        """The problem with other measured values, by run."""
        runs = [replace(run, data=data.get(run.name, run.data)) for run in self.runs]
        return self._with(runs=runs)

    def with_effects(self, changes: Mapping[str, str]) -> Problem:
        """The problem on a system with changed variants.

        Parameters that only the new variants have become parameters of the problem: strengths start
        at 0, which reproduces this problem, the others at the FMU's values.

        Args:
            changes: instance (component, slot) -> short form as of `cosim run --set`, e.g.
                `{"load": "+coulomb"}`.

        Raises:
            VariantError, UnknownNameError: it does not fit.
        """
        instances = apply(self.instances, changes, self.provider)
        changed = self._with(instances=instances)
        old, new = self._plain(), changed._plain()
        added: list[Parameter] = []
        for name, member in new.members.items():
            if instances[name] == self.instances[name]:
                continue
            before = old.members[name].description.variables
            strengths = set(member.description.extra.get("strengths", ()))
            stated = {n for run in self.runs for n in run.starts}
            mixes, tries, lattices, visits = (
                member.description.extra.get(hints, {})
                for hints in ("mixes", "tries", "lattices", "visits")
            )
            for variable in member.description.variables.values():
                full = f"{name}.{variable.name}"
                if (
                    adjustable(variable)
                    and variable.name not in before
                    and full not in changed.constants
                    and full not in stated
                ):
                    parameter = free_parameter(
                        variable, full, full, strength=variable.name in strengths
                    )
                    added.append(
                        replace(
                            parameter,
                            mix=mixes.get(variable.name, ""),
                            tries=tuple(map(float, tries.get(variable.name, ()))),
                            lattice=lattices.get(variable.name, 0.0),
                            visits=f"{name}.{place}"
                            if (place := visits.get(variable.name))
                            else "",
                        )
                    )
        return changed._with(parameters=[*self.parameters, *added])

    def close(self) -> None:
        """Free the idle sessions of this kind of problem; it can still be used."""
        self._pool.close(self._kind)
