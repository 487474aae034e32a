"""FMUs of others in a system: adapters at their connections, so that effects find a place.

An FMU without sources has no balances. What passes between it and the rest is known, though: an
adapter that passes a value on takes effects as any component of ours does.

    output of the FMU    inside: friction, drag, ripple beside an effort that it gives
                         value: gain, offset, delay of what it gives
    input of the FMU     the same, on the way to it; `inside` where it takes an effort
    channel              value: what the sensor makes of it

What is measured at an output is measured behind the output's adapter. Adapters are relays, so that
the system with them gives the very numbers of the one without.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import Any

from ..calibrate.model import Model
from ..calibrate.parts import Channel, MeasuredRun
from ..calibrate.problem import Problem
from ..fmu.variables import Variable
from ..spec.units import ANY, Unit, conversion, parse
from ..system.system import Connection, System
from ..system.toml import DeclaredConnection
from .candidates import Catalogue

COMPONENT = "adapter"
EFFORTS = {"torque": ("N.m", "rad/s", "w"), "force": ("N", "m/s", "v")}
"""Fidelities with a motion: their unit, that of the motion, and the input for it."""
SIGNAL = "signal"
"""The fidelity for all others; it passes numbers on as they are."""


@dataclass(frozen=True)
class Adapter:
    """An adapter that was put into a system.

    Attributes:
        name: of the instance.
        fidelity: what passes through it.
        foreign: the instance without sources beside it.
        at: full name of the variable whose value passes.
        role: `output` or `input` of the foreign instance, or `sensor`.
        unit: of the value, as far as it is declared on either side.
    """

    name: str
    fidelity: str
    foreign: str
    at: str
    role: str
    unit: str = ""

    @property
    def where(self) -> str:
        """Where an effect at it acts, as part of a sentence."""
        if self.role == "sensor":
            return f"in what is measured of {self.at}"
        if self.role == "input" and self.fidelity not in EFFORTS:
            return f"on the way of {self.at} into {self.foreign}"
        return f"inside {self.foreign}, at {self.at}"

    @property
    def inside(self) -> bool:
        """Whether an effect at it acts inside the foreign instance."""
        return self.role == "output" or (self.role == "input" and self.fidelity in EFFORTS)


def foreigners(system: System) -> list[str]:
    """Instances whose FMUs say nothing of balances, which ours all do."""
    return [n for n, m in system.members.items() if "balances" not in m.description.extra]


def attached(problem: Problem) -> tuple[Problem, tuple[Adapter, ...]]:
    """The problem with adapters at the connections of foreign instances, and these.

    Without a catalogue of effects, or without such instances, it is the problem itself.

    Not treated: values that are no floating-point numbers, and inputs that a log drives in another
    unit than their FMU's; nothing is attached there.
    """
    system = problem.system()
    if not isinstance(problem.provider, Catalogue) or not foreigners(system):
        return problem, ()
    return _Attaching(problem, system).done()


@dataclass(frozen=True, eq=False)
class AdaptedProblem(Problem):
    """A problem with adapters, whose effects have the unit of what passes.

    Attributes:
        units: instance of an adapter -> unit.
    """

    units: Mapping[str, str] = field(default_factory=dict)

    def with_effects(self, changes: Mapping[str, str]) -> Problem:
        """See `Problem.with_effects`."""
        found = super().with_effects(changes)
        return found.changed(
            parameters=[
                replace(p, unit=self.units.get(p.targets[0][0].partition(".")[0], ""))
                if p.unit == ANY and p.role == "effect" else p
                for p in found.parameters
            ]
        )  # fmt: skip


class _Attaching:
    """Collects what changes in a system's file, its channels and its runs."""

    def __init__(self, problem: Problem, system: System) -> None:
        self.problem, self.system = problem, system
        self.foreign = foreigners(system)
        self.adapters: dict[str, Adapter] = {}
        self.before: dict[str, list[str]] = {}
        self.after: dict[str, list[str]] = {}
        self.wires: list[DeclaredConnection] = []
        self.signs: dict[str, float] = {}
        self.passed: dict[str, tuple[str, float, float]] = {}

    def done(self) -> tuple[Problem, tuple[Adapter, ...]]:
        """The problem with all adapters."""
        kept = self._connections()
        inputs = self._inputs()
        channels = [self._channel(c) for c in self.problem.channels]
        instances: dict[str, str] = {}
        given = self.problem.instances
        for name, reference in given.items():
            instances |= {n: self._variant(n) for n in self.before.get(name, ())}
            instances[name] = reference
            instances |= {n: self._variant(n) for n in self.after.get(name, ())}
        file = self.problem.file
        model = Model(
            replace(
                file,
                instances={n: file.instances.get(n, v) for n, v in instances.items()},
                connections=(*kept, *self.wires),
                parameters={**file.parameters, **self.signs},
            ),
            self.problem.provider,
            instances,
        )
        moved: dict[int, Any] = {}
        runs = [self._run(run, inputs, moved) for run in self.problem.runs]
        further = [partial(_further, read) for read in self.problem.further]
        changed = self.problem.changed(model=model, channels=channels, runs=runs, further=further)
        units = {a.name: a.unit for a in self.adapters.values()}
        own = {f.name: getattr(changed, f.name) for f in fields(Problem)}
        return AdaptedProblem(**own, units=units), tuple(self.adapters.values())

    # -- instances ---------------------------------------------------------------------------------

    def _variant(self, name: str) -> str:
        return f"{COMPONENT}/{self.adapters[name].fidelity}"

    def _name(self, at: str, end: str = "") -> str:
        """An identifier that no instance has."""
        stem = re.sub(r"\W+", "_", at).strip("_") + end
        name, number = stem, 2
        while name in self.system.members or name in self.adapters:
            name, number = f"{stem}_{number}", number + 1
        return name

    def _new(self, at: str, fidelity: str, foreign: str, role: str, unit: Unit | None) -> str:
        name = self._name(at, "_sensor" if role == "sensor" else "")
        symbol = unit.symbol if unit is not None else ""
        symbol = EFFORTS[fidelity][0] if fidelity in EFFORTS else symbol
        self.adapters[name] = Adapter(name, fidelity, foreign, at, role, symbol)
        beside = at.partition(".")[0]
        table = self.before if role == "input" else self.after
        table.setdefault(beside, []).append(name)
        return name

    # -- connections -------------------------------------------------------------------------------

    def _connections(self) -> list[DeclaredConnection]:
        """Connections that stay; those at foreign instances go through adapters."""
        by_target = {c.target: c for c in self.system.connections}
        kept: list[DeclaredConnection] = []
        for wire in self.problem.file.connections:
            ends = {wire.source.partition(".")[0], wire.target.partition(".")[0]}
            if not ends & set(self.foreign):
                kept.append(wire)
                continue
            for target in self.system.elements(wire.target):
                self._connect(by_target[self.system.first_name(target)])
        return kept

    def _connect(self, wire: Connection) -> None:
        """A scalar connection at a foreign instance, through an adapter where that can be."""
        system = self.system
        out, into = system.declaration(wire.source), system.declaration(wire.target)
        giver, taker = wire.source.partition(".")[0], wire.target.partition(".")[0]
        if not (_continuous(out) and _continuous(into)) or self._is_adapter(giver, taker):
            self.wires.append(_wired(wire.source, wire.target, wire.gain, wire.offset))
            return
        given = giver in self.foreign
        at = wire.source if given else wire.target
        if not given or at not in self.passed:
            plain = (wire.gain, wire.offset) == (1.0, 0.0)
            unit = out.unit or (into.unit if plain else None)
            fidelity, gain, offset = _passing(unit)
            motion = self._motion(wire, given, fidelity) if fidelity in EFFORTS else None
            if motion is None:
                fidelity, gain, offset = SIGNAL, 1.0, 0.0
            beside = (giver, "output") if given else (taker, "input")
            name = self._new(at, fidelity, *beside, unit)
            self.wires.append(_wired(wire.source, f"{name}.u", gain, offset))
            if motion is not None:
                self.wires.append(_wired(motion[0], f"{name}.{EFFORTS[fidelity][2]}", motion[1]))
                self.signs[f"{name}.sign"] = motion[2]
            self.passed[at] = name, gain, offset
        name, gain, offset = self.passed[at]
        slope = wire.gain / gain
        self.wires.append(_wired(f"{name}.y", wire.target, slope, wire.offset - slope * offset))

    def _is_adapter(self, *instances: str) -> bool:
        """Whether one of these is an adapter that the system has of its own."""
        found = (self.system.members[n].description.extra.get("component") for n in instances)
        return COMPONENT in found

    def _motion(
        self, wire: Connection, given: bool, fidelity: str
    ) -> tuple[str, float, float] | None:
        """Where the motion beside an effort is, a factor on it, and the sign of the effort.

        Ports of ours say it; else the only connection of such a unit that the foreign instance
        has, and positive efforts are taken to accelerate.
        """
        system = self.system
        full = wire.target if given else wire.source
        ours, _, variable = full.partition(".")
        drivers = {c.target: c for c in system.connections}
        for port in system.members[ours].description.ports:
            if variable not in port.effort:
                continue
            flow = f"{ours}.{port.flow[port.effort.index(variable)]}"
            if port.causality == "gives_motion":
                return flow, 1.0, math.copysign(1.0, port.sign * wire.gain if given else port.sign)
            if flow in drivers:
                return drivers[flow].source, drivers[flow].gain, float(-port.sign)
        foreign = (wire.source if given else wire.target).partition(".")[0]
        wanted, found = parse(EFFORTS[fidelity][1]), {}
        for c in system.connections:
            ends = system.declaration(c.source).unit, system.declaration(c.target).unit
            unit = ends[0] or (ends[1] if (c.gain, c.offset) == (1.0, 0.0) else None)
            beside = foreign in (c.source.partition(".")[0], c.target.partition(".")[0])
            if beside and unit is not None and unit.exponents == wanted.exponents:
                found[c.source] = conversion(unit, wanted)[0]
        return (*next(iter(found.items())), 1.0) if len(found) == 1 else None

    # -- logs --------------------------------------------------------------------------------------

    def _inputs(self) -> dict[str, str]:
        """Inputs of foreign instances that logs drive -> those of adapters."""
        found: dict[str, str] = {}
        for run in self.problem.runs:
            for full, signal in run.inputs.items():
                instance, variable = full.partition(".")[0], self.system.declaration(full)
                if instance not in self.foreign or full in found or not _continuous(variable):
                    continue
                own = parse(signal.unit) if signal.unit else None
                if own and variable.unit and conversion(own, variable.unit) != (1.0, 0.0):
                    continue
                name = self._new(full, SIGNAL, instance, "input", variable.unit or own)
                self.wires.append(_wired(f"{name}.y", full))
                found[full] = f"{name}.u"
        return found

    def _channel(self, channel: Channel) -> Channel:
        """The channel, read behind the adapter of an output, and through one for its sensor."""
        at = channel.signal
        instance, variable = at.partition(".")[0], self.system.declaration(at)
        near = {c.source for c in self.system.connections if self._beside(c)}
        if instance not in self.foreign and at not in near:
            return channel
        if variable.causality != "output" or not _continuous(variable):
            return channel
        behind, gain, offset = self.passed.get(at, ("", 1.0, 0.0))
        own = next((a.name for a in self.adapters.values() if (a.at, a.role) == (at, "sensor")), "")
        if not own:
            beside = instance if instance in self.foreign else ""
            unit = parse(self.adapters[behind].unit) if behind else variable.unit
            own = self._new(at, SIGNAL, beside, "sensor", unit)
            self.wires.append(_wired(f"{behind}.y" if behind else at, f"{own}.u"))
        slope = channel.gain / gain
        return replace(
            channel, signal=f"{own}.y", gain=slope, offset=channel.offset - slope * offset
        )

    def _beside(self, wire: Connection) -> bool:
        return wire.target.partition(".")[0] in self.foreign

    def _run(
        self, run: MeasuredRun, inputs: Mapping[str, str], moved: dict[int, Any]
    ) -> MeasuredRun:
        """The run with inputs that go to adapters; runs that shared inputs still do."""
        if not inputs:
            return run
        key = id(run.inputs)
        if key not in moved:
            moved[key] = {inputs.get(name, name): s for name, s in run.inputs.items()}
        return replace(run, inputs=moved[key])


def _further(read: Callable[[], Problem]) -> Problem:
    return attached(read())[0]


def _continuous(variable: Variable) -> bool:
    return variable.type in ("Float64", "Float32")


def _passing(unit: Unit | None) -> tuple[str, float, float]:
    """The fidelity for values of a unit, and what makes them values in the adapter's."""
    for fidelity, (symbol, _, _) in EFFORTS.items():
        own = parse(symbol)
        if unit is not None and own.exponents == unit.exponents:
            return fidelity, *conversion(unit, own)
    return SIGNAL, 1.0, 0.0


def _wired(source: str, target: str, gain: float = 1.0, offset: float = 0.0) -> DeclaredConnection:
    return DeclaredConnection(source, target, gain, offset, convert=False)
