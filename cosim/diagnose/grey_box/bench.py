"""A system with the effect `fitted_law` at one place: its signals, its responses, its fits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...calibrate.parts import Channel, MeasuredRun, Parameter, Sensitivity, Targets, targets_of
from ...calibrate.problem import Problem
from ...calibrate.simulator import Simulator
from ...errors import CosimError, UnknownNameError, VariantError, listing
from ..candidates import balances
from ..models import Fitted
from ..search import Search
from ..secant import patience
from .basis import ALONG_X, ALONG_Y, Axis, Shape
from .regression import Gram

Vector = NDArray[np.float64]
EFFECT = "fitted_law"
COUNT = (ALONG_X + 1) * ALONG_Y
AIM = 1.0
"""Largest change that one coefficient makes, in units of the largest residual: the law is asked
about where it is about as large as what is missing. Never below the noise."""
TRIALS = 6
"""Sizes that are tried until one changes the model by as much."""
ANGLES = ("angle",)
"""Signals whose laws repeat with every turn."""
TURN = 2.0 * np.pi
FARTHEST = 1e4
"""Bound on a direction in its prior standard deviations: none."""
DENSE, CROSSED = 0.1, 0.05
"""Share of the largest size of a signal around which knots are dense at 0 where it crosses that,
and the share of it that it must reach on both sides for that: friction rises and falls near 0."""
JUMP = 1e-3
"""Share of the largest x over which the jump at 0 is smoothed."""


@dataclass(frozen=True)
class Site:
    """Where a law acts.

    Attributes:
        instance, port: of the system.
        element: number of a vector balance's element, "" for all of it.
        unit: of what it adds.
    """

    instance: str
    port: str
    element: str = ""
    unit: str = ""

    @property
    def label(self) -> str:
        """As shown."""
        return f"{self.instance}.{self.port}" + (f"[{self.element}]" if self.element else "")

    @property
    def shaft(self) -> str:
        """As candidates name it, whose shafts of a vector have names of their own."""
        return f"{self.instance}.{self.port}" + (f"_{self.element}" if self.element else "")

    @property
    def prefix(self) -> str:
        """Of the law's variables."""
        return f"{self.instance}.{self.port}.{EFFECT}."

    @property
    def change(self) -> dict[str, str]:
        """As of `cosim run --set`."""
        return {self.instance: f"+{EFFECT}@{self.port}"}


def site(problem: Problem, label: str) -> Site:
    """A place by its name, `load.flange` or `arm.joint[2]`.

    Raises:
        UnknownNameError: the system has no such balance.
    """
    name, _, element = label.removesuffix("]").partition("[")
    instance, _, port = name.partition(".")
    known = sorted(f"{a}.{b}" for a, b in balances(problem))
    if name not in known:
        raise UnknownNameError(f"{problem.name}: {listing(known, name)} as place of a law")
    extra = problem.system().members[instance].description.extra
    unit = next((str(b.get("unit", "")) for b in extra["balances"] if b["name"] == port), "")
    return Site(instance, port, element, unit)


@dataclass(frozen=True, eq=False)
class LawProblem(Problem):
    """A problem of which a coefficient that several parameters set gets the sum of all.

    Attributes:
        coefficient: how names of coefficients begin; those that are 0 are left as they are.
    """

    coefficient: str = ""

    @classmethod
    def of(cls, problem: Problem, coefficient: str) -> LawProblem:
        """The same problem."""
        return cls(
            **{f.name: getattr(problem, f.name) for f in fields(Problem)}, coefficient=coefficient
        )

    @cached_property
    def _coefficients(self) -> tuple[Targets, list[str], NDArray[np.intp]]:
        """What sets them, in order; their names, and the place of each target's among those."""
        targets = Targets(
            [
                target
                for target in targets_of(self.parameters)
                if self.parameters[target.place].targets[0][0].startswith(self.coefficient)
            ]
        )
        place = {name: k for k, name in enumerate(dict.fromkeys(targets.names))}
        return targets, list(place), np.array([place[n] for n in targets.names], dtype=np.intp)

    def values(self, theta: Vector, run: MeasuredRun | str) -> dict[str, float]:
        """See `Problem.values`."""
        run = self.run(run) if isinstance(run, str) else run
        found = super().values(theta, run)
        targets, names, places = self._coefficients
        if not names:
            return found
        sums = np.bincount(places, weights=targets.of(theta)).tolist()
        for name, value in zip(names, sums, strict=True):
            if value == 0.0 and name not in self.constants:  # as the FMU has it
                del found[name]
            else:
                found[name] = value
        return found


class LawBench:
    """Simulates a model with a law at a place.

    Args:
        search: the data.
        base: fitted model without the law.
        place: where.
        names: runs that tell what is visited, all if not given.

    Attributes:
        signals: on which a law there may depend.
        ranges: what all runs visit of each; where those that are fitted do not go, a law goes on
            as smoothly as it came.

    Raises:
        VariantError: no law can enter there.
    """

    def __init__(
        self, search: Search, base: Fitted, place: Site, names: Sequence[str] = ()
    ) -> None:
        self.search, self.base, self.site = search, base, place
        with_law = base.problem.with_effects(place.change)
        own_names = set(base.problem.names)
        kept = [p for p in with_law.parameters if p.name in own_names]
        variables = with_law.system().members[place.instance].description.variables
        inner = place.prefix.removeprefix(f"{place.instance}.")
        own = [n.removeprefix(inner) for n in variables if n.startswith(inner)]
        self.signals = [n[3:] for n in own if n.startswith("wx_")]
        self.fixed = {place.prefix + f"c[{i + 1}]": 0.0 for i in range(COUNT - ALONG_Y, COUNT)}
        self.fixed |= {place.prefix + f"w{a}_{s}": 0.0 for a in "xy" for s in self.signals}
        shares = [n[6:-1] for n in own if n.startswith("share[")]
        if place.element:
            if place.element not in shares:
                raise UnknownNameError(
                    f"{place.instance}.{place.port}: {listing(shares, place.element)} as element"
                )
            self.fixed |= {f"{place.prefix}share[{n}]": float(n == place.element) for n in shares}
        self.problem = with_law.changed(parameters=kept)
        self.names, checked = search.fitting.names, search.checking.names
        self.limits = patience(base.simulator)
        self.ranges = self._visited(names or tuple(dict.fromkeys((*self.names, *checked))))

    # -- problems ----------------------------------------------------------------------------------

    def constants(self, shape: Shape | None) -> dict[str, float]:
        """Variables of the law that are no coefficients."""
        found, prefix = dict(self.fixed), self.site.prefix
        found[prefix + "g"] = float(shape is not None)
        if shape is None:
            return found
        if (x := shape.x) is not None:
            found |= {prefix + "wx_" + x.signal: 1.0, prefix + "x_first": x.first,
                      prefix + "x_last": x.last, prefix + "x_scale": x.scale,
                      prefix + "x_0": x.jump}  # fmt: skip
        if (y := shape.y) is not None:
            found |= {prefix + "wy_" + y.signal: 1.0, prefix + "y_first": y.first,
                      prefix + "y_last": y.last, prefix + "turn": float(y.turn),
                      prefix + "fold": float(y.fold)}  # fmt: skip
        return found

    def shaped(self, shape: Shape | None, parameters: Sequence[Parameter] = ()) -> Problem:
        """The problem with a law of a shape, and with these parameters for it."""
        constants = {**self.problem.constants, **self.constants(shape)}
        return LawProblem.of(
            self.problem.changed(
                constants=constants, parameters=[*self.problem.parameters, *parameters]
            ),
            self.site.prefix + "c[",
        )

    def coefficients(self) -> list[Parameter]:
        """All 13 x 8 coefficients as parameters."""
        return [
            Parameter(f"{self.site.prefix}c[{i + 1}]", "", 0.0, -np.inf, np.inf,
                      ((f"{self.site.prefix}c[{i + 1}]", 1.0),), "effect", span=1.0)
            for i in range(COUNT)
        ]  # fmt: skip

    def directed(self, targets: Vector, spans: Vector) -> list[Parameter]:
        """Parameters of a law, each setting the coefficients as a column says."""
        prefix = self.site.prefix
        return [
            Parameter(
                f"{prefix}a[{i + 1}]", "", 0.0, -FARTHEST, FARTHEST,
                tuple((f"{prefix}c[{k + 1}]", float(v)) for k, v in enumerate(column)),
                "effect", prior=1.0, span=float(min(spans[i], 1.0)),
            )
            for i, column in enumerate(targets.T)
        ]  # fmt: skip

    # -- what the runs visit -----------------------------------------------------------------------

    def _visited(self, names: Sequence[str]) -> dict[str, tuple[float, float]]:
        found = {}
        for signal in self.signals:
            weight = {f"{self.site.prefix}wy_{signal}": 1.0}
            (values,) = self.recorded(None, self.base.estimate.theta, None, ("y",), weight, names)
            found[signal] = float(np.min(values)), float(np.max(values))
        return found

    def recorded(
        self, shape: Shape | None, theta: Vector, coefficients: Vector | None,
        outputs: Sequence[str] = ("x", "y"), constants: Mapping[str, float] | None = None,
        names: Sequence[str] = (),
    ) -> list[Vector]:  # fmt: skip
        """Outputs of the law along runs, all identification runs if not given, one by one."""
        names = names or self.names
        law = [] if coefficients is None else self.coefficients()
        problem = self.shaped(shape, law)
        spies = [Channel(name, "", 1.0, self.site.prefix + name) for name in outputs]
        runs = [
            replace(
                problem.run(n), data=np.zeros((problem.run(n).times.size, len(spies))), noise=None
            )
            for n in names
        ]
        problem = problem.changed(
            constants={**problem.constants, **(constants or {})}, channels=spies, runs=runs,
            relative=(), parameters=[p for p in problem.parameters if p.run in ("", *names)],
        )  # fmt: skip
        kept = [p.run in ("", *names) for p in self.problem.parameters]
        theta = theta[kept] if coefficients is None else np.append(theta[kept], coefficients)
        rows = self.search.simulator.of(problem).residuals(theta, names)
        together = -np.concatenate([rest for _, rest in rows])
        return list(together.T)

    # -- responses ---------------------------------------------------------------------------------

    def model(
        self, simulator: Simulator, theta: Vector, names: Sequence[str] = ()
    ) -> dict[str, Vector]:
        """Model values over sigma, by run."""
        problem = simulator.problem
        return {
            name: problem.run(name).data / problem.sigma - rest
            for name, rest in simulator.residuals(theta, names or self.names)
        }

    def grams(
        self, shape: Shape, directions: Vector, theta: Vector, coefficients: Vector,
        residual: Mapping[str, Vector], slopes: Sequence[Sensitivity], held: Sequence[str] = (),
    ) -> list[Gram]:  # fmt: skip
        """Inner products of responses, derivatives and residuals, by run.

        Args:
            shape: of the law.
            directions: of the coefficients (columns) that are asked about.
            theta: declared parameters.
            coefficients: of the law that is at work.
            residual: there, over sigma, by run.
            slopes: derivatives by the declared parameters there.
            held: declared parameters that a fit left at a bound: they absorb nothing.

        Raises:
            CosimError: the law cannot be simulated at any size.
        """
        simulator = self.search.simulator.of(self.shaped(shape, self.coefficients()))
        simulator = simulator.limited(self.limits)
        whole = np.concatenate([theta, coefficients])
        start = self.model(simulator, whole)
        largest = max(float(np.nanmax(np.abs(residual[name]))) for name in start)
        size = self._size(simulator, whole, start, AIM * max(largest, 1.0))
        columns: dict[str, list[Vector]] = {name: [] for name in start}
        for direction in directions.T:
            moved = whole.copy()
            moved[theta.size :] += size * direction
            for name, values in self.model(simulator, moved).items():
                columns[name].append(((values - start[name]) / size).astype(np.float32))
        problem = self.base.problem
        scale = problem.scale * ~np.isin(problem.names, list(held))
        found = []
        for item in slopes:
            if item.run not in columns:
                continue
            rest = residual[item.run]
            law = np.stack(columns[item.run], axis=2)
            declared = np.zeros((*rest.shape, scale.size))
            declared[:, :, item.columns] = item.values * scale[item.columns]
            table = np.concatenate([law, declared, rest[:, :, None]], axis=2)
            table = table.reshape(-1, table.shape[2])
            table = table[np.isfinite(table).all(axis=1)]
            own = np.array([p.run == item.run for p in problem.parameters])
            found.append(Gram(item.run, table.T @ table, own, table.shape[0]))
        return found

    def _size(
        self, simulator: Simulator, whole: Vector, start: Mapping[str, Vector], aim: float
    ) -> float:
        """Constant law that changes the model by about as much as is missing."""
        size, largest = 1e-3, 0.0
        for _ in range(TRIALS):
            moved = whole.copy()
            moved[-COUNT:-ALONG_Y] += size
            try:
                values = self.model(simulator, moved, list(start))
            except CosimError:
                size *= 0.1
                continue
            largest = max(float(np.nanmax(np.abs(values[n] - start[n]))) for n in start)
            if not np.isfinite(largest):
                size *= 0.1
            elif largest == 0.0:
                size *= 1e3
            elif 0.1 * aim <= largest <= aim:
                return size
            else:
                size *= float(np.clip(0.3 * aim / largest, 1e-3, 1e3))
        if not 0.0 < largest < np.inf:
            raise VariantError(f"{self.site.label}: a law there changes nothing that is measured")
        return size

    @property
    def varying(self) -> list[str]:
        """Signals that move in the identification runs."""
        return [
            signal for signal in self.signals
            if np.ptp(self.ranges[signal]) > 1e-9 * max(*map(abs, self.ranges[signal]), 1e-9)
        ]  # fmt: skip

    def crosses(self, signal: str) -> bool:
        """Whether a signal has its 0 well within what runs visit."""
        low, high = self.ranges[signal]
        return min(-low, high) > CROSSED * max(-low, high)

    def axis_x(self, signal: str, dense: float = DENSE) -> Axis:
        """A signal as first one.

        Args:
            signal: its name.
            dense: share of its largest size around which knots are dense at 0 if it crosses that.
        """
        low, high = self.ranges[signal]
        most = max(abs(low), abs(high))
        wide = dense if self.crosses(signal) and signal not in ANGLES else 1e3
        return Axis(signal, low, high, wide * most, JUMP * most)

    def axis_y(self, signal: str, order: int = 1) -> Axis:
        """A signal as second one; an angle with so many cycles per turn, 0 for as it is."""
        if signal in ANGLES and order:
            return Axis(signal, 0.0, TURN / order, turn=True)
        return Axis(signal, *self.ranges[signal])

    def folded(self, signal: str) -> Axis:
        """A signal as second one that counts without its sign."""
        low, high = self.ranges[signal]
        return Axis(signal, 0.0, max(-low, high), fold=True)
