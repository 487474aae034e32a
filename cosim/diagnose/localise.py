"""Where must a disturbance enter to explain all channels, and what does it look like?

At each place a probe adds an unknown curve u(s) of hat functions, s the time of one run or a signal
of the balance (speed, angle, load, ...). The system's responses to the hats, less what calibration
absorbs, are regressed on the residual with a ridge prior whose size maximizes the evidence

    2 log E = b^T (I / t^2 + A)^-1 b - log det(I + t^2 A),   A = S^T S,  b = S^T r

so a place with many degrees of freedom is not preferred for that alone. No law of the catalogue
takes part. Responses are taken at one size of u: the answer is a first approximation where the
system is far from linear.

Source: Bayesian linear regression (MacKay, Neural Computation 4, 1992: evidence).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..calibrate.parts import Channel, MeasuredRun, Parameter
from ..calibrate.problem import Problem
from ..errors import CosimError, VariantError
from .candidates import Candidate, Catalogue, balances, element_of, twins
from .judge import Judge
from .linear import Absorber, SampleStack
from .models import Fitted
from .search import Search

Vector = NDArray[np.float64]
PROBE, TIME = "unknown_input", "time"
RUNS = 1
"""Runs that are looked at: those with the largest residual over noise."""
PLACES = 4
"""Places that are probed, those with the best candidates first."""
AIM = 3.0
"""Largest change by the probe, in units of the largest residual: where the system is asked. More
than 1, since what sticks or is limited answers little, and not much more, to stay near."""
ELEMENTS = 6
"""Elements of a vector balance that are probed one by one; of more, all together."""
SIZES = np.logspace(-3.0, 3.0, 25)
"""Of a curve, over the size at which it shows as much as the noise: factors of 1.8 between them, to
which the evidence is flat."""


@dataclass(frozen=True)
class Curve:
    """What the unknown input looks like against one driver.

    Attributes:
        driver: `time` or a signal of the balance.
        run: of a curve against time, else "".
        at, value, deviation: knots, u there, and its standard deviation.
        evidence: log evidence against "no input" [nats].
        explained: share of the runs' excess over the noise that it takes away.
    """

    driver: str
    run: str
    at: Vector
    value: Vector
    deviation: Vector
    evidence: float
    explained: float

    def to_dict(self) -> dict[str, Any]:
        """As in the JSON."""
        return {
            "driver": self.driver, "run": self.run, "at": self.at.tolist(),
            "value": self.value.tolist(), "deviation": self.deviation.tolist(),
            "evidence_nats": self.evidence, "explained": self.explained,
        }  # fmt: skip


@dataclass
class Place:
    """One place of the system.

    Attributes:
        instance, port: where.
        element: of a vector balance, "" for a scalar one.
        unit: of the input.
        curves: the best first.
    """

    instance: str
    port: str
    element: str
    unit: str
    curves: list[Curve] = field(default_factory=list)

    @property
    def label(self) -> str:
        """As shown."""
        return f"{self.instance}.{self.port}" + (f"[{self.element}]" if self.element else "")

    @property
    def evidence(self) -> float:
        """Of the best kind of curve; curves against time of several runs count together."""
        over_time = sum(c.evidence for c in self.curves if c.driver == TIME)
        return max([over_time, *(c.evidence for c in self.curves if c.driver != TIME)])

    def to_dict(self) -> dict[str, Any]:
        """As in the JSON."""
        return {
            "component": self.instance, "port": self.port, "element": self.element,
            "unit": self.unit, "evidence_nats": self.evidence,
            "curves": [c.to_dict() for c in self.curves],
        }  # fmt: skip


def localise(search: Search, base: Fitted, ranked: Sequence[Candidate]) -> list[Place]:
    """Places with promising candidates by evidence, the best first.

    Args:
        search: the data.
        base: calibrated model whose residual is asked about.
        ranked: candidates of the catalogue, the best first: they tell which places are probed.
    """
    known = _balances(base.problem)
    places = dict.fromkeys(p for c in ranked if (p := (c.instance, c.port)) in known)
    return _probed(search, base, places, PLACES)


def everywhere(search: Search, base: Fitted) -> list[Place]:
    """Places by evidence, the best first; all are asked, whatever the catalogue has there.

    Where no law fits, the catalogue's scores say little of the place: what is missing may be the
    only law there that moves the model much.
    """
    return _probed(search, base, _balances(base.problem), None)


def _probed(
    search: Search,
    base: Fitted,
    places: Iterable[tuple[str, str]],
    most: int | None,
) -> list[Place]:
    """The first places that can be probed, by evidence."""
    runs = worst(search, base, RUNS)
    found: list[Place] = []
    probed = 0
    for instance, port in places:
        if probed == most:
            break
        try:
            found += UnknownInput(search, base, runs, instance, port).places()
            probed += 1
        except VariantError:
            continue  # a mass centre or the direction of gravity: nothing can enter there
        except CosimError as error:
            search.say(f"{instance}.{port} could not be probed: {error}")
    found.sort(key=lambda p: -p.evidence)
    return found


def worst(judge: Judge, base: Fitted, most: int) -> list[MeasuredRun]:
    """The runs that a model leaves farthest from their noise."""
    rows = judge.fitting.by_run(judge.fit_data - base.fit)
    sizes = [float(np.nanmean(r**2)) for r in rows]
    order = np.argsort(sizes)[::-1][:most]
    return [judge.fitting.runs[int(i)] for i in sorted(order)]


def _balances(problem: Problem) -> list[tuple[str, str]]:
    """Where an input may enter: elements of shafts one by one, each shaft at one of its ends."""
    if not isinstance(problem.provider, Catalogue):
        return []
    names = balances(problem)
    parts = [(name, element_of(port)) for name, port in names]
    not_asked = {(name, part[0]) for name, part in parts if part} | twins(problem)
    return [place for place in names if place not in not_asked]


class UnknownInput:
    """Responses of a system to the probe at one balance."""

    def __init__(
        self, search: Search, base: Fitted, runs: list[MeasuredRun], instance: str, port: str
    ) -> None:
        self.instance, self.port = instance, port
        self.names = [run.name for run in runs]
        probed = base.problem.with_effects({instance: f"+{PROBE}@{port}"})
        self.prefix = f"{instance}.{port}.{PROBE}."
        variables = probed.system().members[instance].description.variables
        own = [n for n in variables if n.startswith(self.prefix.removeprefix(f"{instance}."))]
        inner = {n.rpartition(".")[2]: n for n in own}
        balances = probed.system().members[instance].description.extra.get("balances", ())
        self.unit = next((str(b.get("unit", "")) for b in balances if b["name"] == port), "")
        self.knots = sum(1 for n in inner if n.startswith("c["))
        self.drivers = [n[2:] for n in inner if n.startswith("w_")]
        self.elements = [n[6:-1] for n in inner if n.startswith("share[")]
        if len(self.elements) > ELEMENTS:  # they keep their shares of 1
            self.elements = []
        self.theta = base.estimate.theta
        kept = [p for p in probed.parameters if p.role != "effect" or p.name in base.problem.names]
        free = [f"c[{k + 1}]" for k in range(self.knots)] + ["g", "s_first", "s_last"]
        free += [f"w_{d}" for d in self.drivers] + [f"share[{e}]" for e in self.elements]
        self.free = {name: len(kept) + i for i, name in enumerate(free)}
        extra = [
            Parameter(
                self.prefix + name, "", 0.0, -np.inf, np.inf, ((self.prefix + name, 1.0),),
                "effect", span=1.0,
            )
            for name in free
        ]  # fmt: skip
        spy = Channel("driver", "", 1.0, self.prefix + "s")
        known = {run.name: run for run in base.problem.runs}  # with the start values of the model
        runs = [
            replace(run, data=np.column_stack([run.data, np.zeros(run.times.size)]))
            for run in (known[n] for n in self.names)
        ]
        problem = probed.changed(
            parameters=[*kept, *extra], channels=[*probed.channels, spy], runs=runs
        )
        self.simulator = search.simulator.of(problem)
        declared = search.declared.only(self.names)
        self.stacks = {
            names: SampleStack(declared, [declared.run(n) for n in names])
            for names in [tuple(self.names), *((n,) for n in self.names)]
        }
        self.residual: dict[tuple[str, ...], Vector] = {}
        self.absorber: dict[tuple[str, ...], Absorber] = {}
        self.base: dict[tuple[str, ...], Vector] = {}
        rows = dict(
            zip(search.fitting.names, search.fitting.by_run(search.fit_data - base.fit),
                strict=True)
        )  # fmt: skip
        missed = dict(base.simulator.residuals(base.estimate.theta, self.names))
        for names, stack in self.stacks.items():
            self.absorber[names] = search.absorber(base, stack)
            self.residual[names] = self.absorber[names].rest(stack.vector([rows[n] for n in names]))
            self.base[names] = stack.vector([missed[n] for n in names])

    def at(self, names: tuple[str, ...], **values: float) -> tuple[Vector, Vector]:
        """Change of the model values, and the driver's values."""
        problem = self.simulator.problem
        theta = np.zeros(len(problem.parameters))
        theta[: self.theta.size] = self.theta
        for name, index in self.free.items():
            theta[index] = values.get(name, 0.0)
        theta[self.free["g"]] = 1.0
        # of the same data, so what the exchange adds to the model falls out
        rows = [rows for _, rows in self.simulator.residuals(theta, names)]
        change = self.base[names] - self.stacks[names].vector([r[:, :-1] for r in rows])
        return change, np.concatenate([-r[:, -1] for r in rows])

    def places(self) -> list[Place]:
        """With a curve per driver, and one against time per run."""
        found = []
        for element in self.elements or [""]:
            place = Place(self.instance, self.port, element, self.unit)
            share = {f"share[{element}]": 1.0} if element else {}
            size = self._size(share)
            if size is None:
                continue
            for driver in self.drivers:
                every: list[tuple[str, ...]] = [tuple(self.names)]
                if driver == TIME:
                    every = [(n,) for n in self.names]
                for names in every:
                    curve = self._curve(driver, names, share, size)
                    if curve is not None:
                        place.curves.append(curve)
            if place.curves:
                place.curves.sort(key=lambda c: -c.evidence)
                found.append(place)
        self.simulator.close()
        return found

    def _size(self, share: dict[str, float]) -> float | None:
        """Constant input that changes the model about as much as the residual is large."""
        names = tuple(self.names)
        aim = AIM * max(float(np.max(np.abs(self.residual[names]))), 1.0)
        size, largest = 1e-3, np.inf
        for _ in range(6):
            curve = {f"c[{k + 1}]": size for k in range(self.knots)}
            try:
                change, _ = self.at(names, s_last=1.0, **curve, **share)
            except CosimError:
                size *= 0.1
                continue
            largest = float(np.max(np.abs(change)))
            if not np.isfinite(largest):
                size *= 0.1
            elif largest == 0.0:
                size *= 1e3
            elif 0.1 * aim <= largest <= aim:
                return size
            else:
                size *= float(np.clip(0.3 * aim / largest, 1e-3, 1e3))
        return size if 0.0 < largest < np.inf else None

    def _curve(
        self, driver: str, names: tuple[str, ...], share: dict[str, float], size: float
    ) -> Curve | None:
        weight = {f"w_{driver}": 1.0}
        _, seen = self.at(names, s_last=1.0, **weight, **share)
        low, high = float(np.min(seen)), float(np.max(seen))
        if not high - low > 1e-9 * max(abs(low), abs(high), 1e-9):
            return None
        columns = []
        for k in range(self.knots):
            values = {**weight, **share, "s_first": low, "s_last": high, f"c[{k + 1}]": size}
            change, _ = self.at(names, **values)
            columns.append(self.absorber[names].rest(change) / size)
        return regressed(
            np.column_stack(columns), self.residual[names], driver,
            names[0] if driver == TIME else "", np.linspace(low, high, self.knots),
        )  # fmt: skip


def regressed(responses: Vector, residual: Vector, driver: str, run: str, at: Vector) -> Curve:
    """Curve of greatest evidence.

    Args:
        responses: of the residual to u = 1 at each knot, without what calibration absorbs.
        residual: likewise.
        driver, run, at: see `Curve`.
    """
    matrix, vector = responses.T @ responses, responses.T @ residual
    values, vectors = np.linalg.eigh(matrix)
    values = np.maximum(values, 0.0)
    turned = vectors.T @ vector
    typical = 1.0 / np.sqrt(max(float(np.mean(values)), 1e-300))
    best, evidence = 0.0, 0.0
    for size in SIZES * typical:
        one = 0.5 * float(
            np.sum(turned**2 * size**2 / (1.0 + size**2 * values))
            - np.sum(np.log1p(size**2 * values))
        )
        if one > evidence:
            best, evidence = float(size), one
    spread = best**2 / (1.0 + best**2 * values)
    curve = vectors @ (spread * turned)
    left = residual - responses @ curve
    excess = float(residual @ residual) - residual.size
    taken = float(residual @ residual - left @ left)
    return Curve(
        driver, run, at, curve, np.sqrt((vectors**2) @ spread), evidence,
        float(np.clip(taken / excess, 0.0, 1.0)) if excess > 0.0 else 0.0,
    )  # fmt: skip
