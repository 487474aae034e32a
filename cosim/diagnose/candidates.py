"""What could be missing: every effect of the catalogue that fits a balance of the system.

Besides, fidelities of which a declared one is a limit, clocks of the log's columns that are late or
drift, and gains and zeros of columns for which the system has no sensor.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol, runtime_checkable

from ..calibrate.clocks import Shift, clocked
from ..calibrate.parts import DRIFT, Parameter
from ..calibrate.problem import Problem
from ..calibrate.recorder import Reading, recorded
from ..calibrate.refinement import Refinement
from ..system.variants import component

LOG, DELAY, SKEW = "log", "delay", "clock_skew"
"""Where columns of the log are wrong, and what that is called: as the effect in the system."""
PASSED = "load"
"""Signal of a balance: the torque that passes. It is another one on either end of a bond, since the
giver takes its own friction off before."""
SHOWS = "Late sensor or clock of what was logged."
FOLLOWS = "Late response to what was logged; negative: what was logged is late itself."
DRIFTS = "Clock that runs slow against that of the inputs; negative: fast."
READS: dict[Literal["gain", "bias", "zero_drift", "angle_ripple"], tuple[str, str]] = {
    "gain": ("gain", "Gain error of what was logged: nothing else reads it."),
    "bias": ("bias", "Constant error of what was logged: nothing else reads it."),
    "zero_drift": ("zero_drift", "Error of what was logged that grows steadily."),
    "angle_ripple": ("wave", "Error of a logged angle that repeats with it."),
}
"""Errors of columns: what targets call them, and what they are."""
POINTS = ("point", "scale")
"""Kinds of balances that are readings by what they are, of all that their component measures."""
_ELEMENT = re.compile(r"(.+)_(\d+)")


@runtime_checkable
class Catalogue(Protocol):
    """A provider that knows which effects fit a variant."""

    def candidates(self, variant: str) -> Sequence[tuple[str, str, str]]:
        """(effect, balance, one line about it) for all that could be added to the variant."""
        ...

    def refinements(self, variant: str) -> Sequence[Mapping[str, Any]]:
        """Fidelities of which the variant is a limit; keys as `Refinement`, `held` as mapping."""
        ...


@runtime_checkable
class Kinship(Protocol):
    """A provider that knows which laws are special cases of others, and what they read."""

    def contained(self, effect: str) -> Sequence[str]:
        """Effects that the law of an effect becomes for some values of its parameters."""
        ...

    def needs(self, effect: str) -> Sequence[str]:
        """Signals that an effect's law reads beyond those of every balance of its kind."""
        ...


@dataclass(frozen=True)
class Candidate:
    """An effect at a place of the system.

    Attributes:
        instance: of the system.
        component: what the instance is (`dc_motor`); what verdicts call component is the instance.
        effect: of the catalogue.
        port: balance of the instance, or group of balances, at which it acts.
        text: one line about the effect.
        refinement: the fidelity that it stands for, None for an effect.
        column: the delay, drift, gain or bias of columns of the log that it stands for, None for
            what is in the system.
        contains: effects that its law becomes for some values of its parameters.
    """

    instance: str
    component: str
    effect: str
    port: str
    text: str = ""
    refinement: Refinement | None = None
    column: Shift | Reading | None = None
    contains: tuple[str, ...] = field(default=(), compare=False)

    @property
    def label(self) -> str:
        """As shown and reported."""
        return f"{self.effect} at {self.place}"

    @property
    def place(self) -> str:
        """Instance and balance."""
        return f"{self.instance}.{self.port}" if self.port else self.instance

    @property
    def prefix(self) -> str:
        """Of the names of its parameters."""
        return f"{self.place}.{self.effect}."

    @property
    def change(self) -> dict[str, str]:
        """As of `cosim run --set`; nothing for columns of the log."""
        if self.column is not None:
            return {}
        if self.refinement is not None:
            return {self.instance: self.refinement.fidelity}
        return {self.instance: f"+{self.effect}@{self.port}"}

    def added_to(self, problem: Problem) -> Problem:
        """The problem on the system with this effect, which is absent at the nominal values."""
        if self.column is not None:
            return self.column.added_to(problem, self.prefix)
        if self.refinement is not None:
            return self.refinement.added_to(problem, self.instance)
        return problem.with_effects(self.change)


def candidates(problem: Problem) -> list[Candidate]:
    """All candidates for a system; none if its provider has no catalogue."""
    provider = problem.provider
    if not isinstance(provider, Catalogue):
        return []
    found: list[Candidate] = []
    at_givers: list[
        Candidate
    ] = []  # after all others: where there is no difference, they are twins
    others, kin = twins(problem), provider if isinstance(provider, Kinship) else None
    for instance, variant in problem.instances.items():
        kind = component(variant)
        if not kind:
            continue  # a file: nothing can be added to it
        for effect, port, text in provider.candidates(variant):
            twin = (instance, port) in others
            if twin and (kin is None or PASSED not in kin.needs(effect)):
                continue
            special = () if kin is None else tuple(kin.contained(effect))
            known = at_givers if twin else found
            known.append(Candidate(instance, kind, effect, port, text, contains=special))
        for entry in provider.refinements(variant):
            step = Refinement(**{**entry, "held": tuple(entry["held"].items())})
            found.append(Candidate(instance, kind, step.effect, step.port, step.text, step))
    return found + at_givers + delays(problem) + drifts(problem) + misread(problem)


def delays(problem: Problem) -> list[Candidate]:
    """Delays of columns of the log: of each alone, and of all that one instance gives or takes.

    What a mapping declares is not asked again. Elements of a vector come in one message. All inputs
    that act late are all channels that are late, but for what the inputs were before the log began,
    which no log says: both are one model, under two names.
    """
    declared = clocked(problem.parameters)
    gives: dict[str, list[str]] = {}
    takes: dict[str, list[str]] = {}
    single: dict[str, Shift] = {}
    for channel in problem.channels:
        if channel.name not in declared:
            gives.setdefault(channel.signal.partition(".")[0], []).append(channel.name)
            if not channel.signal.endswith("]"):
                single[channel.name] = Shift(channels=(channel.name,))
    for target in dict.fromkeys(name for run in problem.runs for name in run.inputs):
        if target not in declared:
            takes.setdefault(target.partition(".")[0], []).append(target)
            if not target.endswith("]"):
                single[target] = Shift(inputs=(target,))
    groups = {
        f"{name}.outputs": Shift(channels=tuple(few)) for name, few in gives.items() if few[1:]
    } | {f"{name}.inputs": Shift(inputs=tuple(few)) for name, few in takes.items() if few[1:]}
    if len(gives) == len(takes) == 1 and not declared and problem.tick is None:
        (giver,), (taker,) = gives, takes
        if {f"{giver}.outputs", f"{taker}.inputs"} <= groups.keys():
            groups[f"{taker}.inputs"] = groups[f"{giver}.outputs"]
    return [
        Candidate(
            LOG, LOG, DELAY, place,
            FOLLOWS if shift.inputs or place.endswith(".inputs") else SHOWS, column=shift,
        )
        for place, shift in (single | groups).items()
    ]  # fmt: skip


def drifts(problem: Problem) -> list[Candidate]:
    """Clocks of columns of the log that drift: of all that one instance gives.

    They are taken to come from one recorder. What a mapping declares is not asked again.
    """
    declared = clocked(problem.parameters)
    gives: dict[str, list[str]] = {}
    for channel in problem.channels:
        if DRIFT + channel.name not in declared:
            gives.setdefault(channel.signal.partition(".")[0], []).append(channel.name)
    return [
        Candidate(
            LOG, LOG, SKEW, f"{giver}.outputs" if few[1:] else few[0], DRIFTS,
            column=Shift(channels=tuple(few), grows=True),
        )
        for giver, few in gives.items()
    ]  # fmt: skip


def misread(problem: Problem) -> list[Candidate]:
    """Gains and zeros of columns that show what no sensor of the system gives, waves of angles.

    Sensors of the system may be wrong themselves, for the log and for what reads them. What a
    mapping declares is not asked again.
    """
    declared, system = recorded(problem.parameters), problem.system()
    given: set[str] = set()
    for name, member in system.members.items():
        for balance in member.description.extra.get("balances", ()):
            if balance["kind"] in POINTS:
                given.add(name)
            elif "sensor" in balance:
                given.add(f"{name}.{balance['sensor']}")
    found = []
    for channel in problem.channels:
        instance, shown = channel.signal.partition(".")[0], channel.signal.partition("[")[0]
        if {instance, shown} & given or channel.by:
            continue
        angle = system.variables(channel.signal)[1][0].symbol == "rad"
        for effect, (kind, text) in READS.items():
            if f"{kind}:{channel.name}" in declared or (effect == "angle_ripple" and not angle):
                continue
            reading = Reading(channel.name, effect)
            found.append(Candidate(LOG, LOG, effect, channel.name, text, column=reading))
    return found


def balances(problem: Problem) -> dict[tuple[str, str], str]:
    """(instance, balance) -> kind, for all that the system's FMUs declare.

    Groups of balances, at which effects fit too, are not among them.
    """
    return {
        (name, str(balance["name"])): str(balance["kind"])
        for name, member in problem.system().members.items()
        for balance in member.description.extra.get("balances", ())
    }


def element_of(port: str) -> tuple[str, int] | None:
    """Vector and number of a balance that is one of its elements (`joint_3`), None for others."""
    match = _ELEMENT.fullmatch(port)
    return (match[1], int(match[2])) if match else None


def twins(problem: Problem) -> set[tuple[str, str]]:
    """Balances that stand for the same shaft as one on the other end of a power bond.

    (Not the twins of a `Signature`, which do the same to first order.)

    What acts on a shaft is left to the end that gives the motion: there it enters the equation of
    motion itself, and not a tick later through the exchange. Not so what reads `PASSED`.
    """
    kinds = balances(problem)
    twins = set()
    for bond in problem.system().bonds():
        giver, _, port = bond.first.partition(".")
        taker, _, other = bond.second.partition(".")
        kind = kinds.get((giver, port))
        if kind is not None and kinds.get((taker, other)) == kind:
            twins |= {
                (giver, name)
                for (instance, name), its in kinds.items()
                if instance == giver and its == kind and _of(name, port)
            }
    return twins


def _of(balance: str, port: str) -> bool:
    """Whether it is the port's balance, or that of one of its shafts (`joint_3` of `joint`)."""
    part = element_of(balance)
    return balance == port or (part is not None and part[0] == port)


def new_parameters(before: Problem, after: Problem) -> tuple[list[Parameter], list[Parameter]]:
    """Strengths, and the other parameters, that an effect has brought."""
    known = set(before.names)
    added = [p for p in after.parameters if p.name not in known]
    return [p for p in added if p.strength], [p for p in added if not p.strength]
