"""One FMU for all the places of some effects, so that a system with hundreds of candidates takes
tens of FMUs; and which of these places one simulation shows apart.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..calibrate.parts import Parameter
from ..calibrate.problem import Problem
from ..errors import CosimError, UnbuiltError
from ..spec.hints import Mix
from .candidates import Candidate, balances, element_of, new_parameters

MOST = 8
"""Places of one effect in one FMU: what remembers a signal's past makes larger ones slow to
compile."""
ENTANGLED = 2
"""The same where the effect varies a coefficient: other equations contain it, and a friction
coefficient with four angles of its own compiles for most of a minute."""
EFFECTS, PLACES = 4, 24
"""Effects and places in one FMU at most. What is absent costs little time, and an FMU with four
effects compiles nearly as fast as one with one, but for those with states: in the order of the
catalogue these are more than four apart."""
_INDEX = re.compile(r"\[(\d+)\]$")


@dataclass(frozen=True)
class Probe:
    """A candidate in a system that may carry its siblings, too.

    Attributes:
        candidate: which.
        problem: system with all of them absent at the nominal values.
        strength: parameter of the candidate alone, as it is called where it is alone.
        names: parameters of `problem` that make up its strength: those of all elements for the
            effect on a whole vector.
        mixed: its second parameter, if two simulations tell one (see `SearchHints.mix`), called as
            where the candidate is alone.
        seconds: parameters of `problem` that make it up.
        others: its parameters besides the strength; of one on a whole vector none is tried.
    """

    candidate: Candidate
    problem: Problem
    strength: Parameter
    names: tuple[str, ...]
    mixed: Parameter | None = None
    seconds: tuple[str, ...] = ()
    others: tuple[Parameter, ...] = ()

    def values(
        self, strength: float, second: float, fixed: Mapping[str, float]
    ) -> dict[str, float]:
        """Parameter of `problem` -> value."""
        return {
            **dict.fromkeys(self.names, strength), **dict.fromkeys(self.seconds, second), **fixed
        }  # fmt: skip

    @property
    def scanned(self) -> bool:
        """Whether all usual values of its strength are tried: a spring, whose mass oscillates, or a
        delay, beyond which signals oscillate.
        """
        added = self.candidate.refinement or self.candidate.column
        return added is not None and bool(self.strength.hints.tries)

    @property
    def mix(self) -> Mix:
        """How two simulations tell its second parameter, "" without one."""
        return self.mixed.hints.mix if self.mixed else ""

    @property
    def second(self) -> str:
        """Name of its second parameter, "" without one."""
        return self.mixed.name if self.mixed else ""

    @property
    def reach(self) -> tuple[float, float]:
        """Bounds of its second parameter."""
        return (self.mixed.minimum, self.mixed.maximum) if self.mixed else (-math.inf, math.inf)

    @property
    def own(self) -> int:
        """Number of parameters of the effect, 0 of one on a whole vector."""
        prefix = self.candidate.prefix
        return sum(p.name.startswith(prefix) for p in self.problem.parameters)


@dataclass(frozen=True)
class Batch:
    """Candidates that are simulated together.

    Attributes:
        change: of the system, as of `cosim run --set`, for this batch and others in the same FMU;
            None for a fidelity.
        members: with channels that show the member apart from the others (None: all channels).
        whole: the effect on all elements of the vector at once.
    """

    change: dict[str, str] | None
    members: tuple[tuple[Candidate, NDArray[np.bool_] | None], ...]
    whole: Candidate | None = None

    @property
    def apart(self) -> bool:
        """Whether one simulation shows all members."""
        return len(self.members) > 1 and all(mask is not None for _, mask in self.members)

    @property
    def candidates(self) -> list[Candidate]:
        """All of them."""
        return [c for c, _ in self.members] + ([self.whole] if self.whole else [])

    def probes(self, base: Problem) -> list[Probe]:
        """With the systems they are simulated in; one each if there is none for all.

        Candidates that fit nothing are left out.
        """
        try:
            if self.change in (None, self.members[0][0].change):
                return single(base, self.candidates)
            assert self.change is not None
            problem = base.with_effects(self.change)
            problem.system()
        except UnbuiltError:
            raise
        except CosimError:
            return single(base, self.candidates)
        found = [p for c, _ in self.members for p in _of(c, base, problem)]
        if self.whole is not None and len(found) == len(self.members):
            first = found[0]

            def own(name: str) -> str:
                assert self.whole is not None
                return self.whole.prefix + name.removeprefix(first.candidate.prefix)

            found.append(
                Probe(
                    self.whole,
                    problem,
                    replace(first.strength, name=own(first.strength.name)),
                    tuple(n for probe in found for n in probe.names),
                    first.mixed and replace(first.mixed, name=own(first.mixed.name)),
                    tuple(n for probe in found for n in probe.seconds),
                )
            )
        return found


def _of(candidate: Candidate, base: Problem, problem: Problem) -> list[Probe]:
    """The candidate in a problem with its effect; nothing if it has not one strength."""
    strengths, others = new_parameters(base, problem)
    own = [p for p in strengths if p.name.startswith(candidate.prefix)]
    if len(own) != 1:
        return []
    mine = tuple(p for p in others if p.name.startswith(candidate.prefix))
    mixed = next((p for p in mine if p.hints.mix), None)
    seconds = (mixed.name,) if mixed else ()
    return [Probe(candidate, problem, own[0], (own[0].name,), mixed, seconds, mine)]


def single(base: Problem, candidates: Sequence[Candidate]) -> list[Probe]:
    """Each candidate in a system that has no other one more; those that fit nothing are left out.

    Raises:
        UnbuiltError: an FMU is missing and cannot be built.
    """
    found = []
    for candidate in candidates:
        try:
            problem = candidate.added_to(base)
            problem.system()
        except UnbuiltError:
            raise
        except CosimError:
            continue
        found += _of(candidate, base, problem)
    return found


def batches(candidates: Sequence[Candidate], problem: Problem) -> list[Batch]:
    """Candidates by effect and component, elements of a vector together."""
    ports = {(c.instance, c.effect, c.port): c for c in candidates}
    groups: dict[tuple[str, str, str], list[Candidate]] = {}
    wholes: dict[tuple[str, str, str], Candidate] = {}
    result = []
    known = balances(problem)
    for c in candidates:
        part = element_of(c.port)
        if c.refinement is not None or c.column is not None:
            result.append(Batch(None, ((c, None),)))
        elif part and (c.instance, c.effect, part[0]) in ports:
            key = (c.instance, c.effect, part[0])
            groups.setdefault(key, []).append(c)
            wholes[key] = ports[key]
        else:
            # an effect on a group of balances declares what those on its members would
            own = "" if (c.instance, c.port) in known else "group"
            groups.setdefault((c.instance, c.effect, own), []).append(c)
    held = set(wholes.values())
    shown = _shown(problem)
    for key, members in groups.items():
        members = [c for c in members if c not in held]
        masks = [shown.get(n) for n in _numbers(members)] if key in wholes else []
        if len(members) > MOST or any(m is None for m in masks):
            masks = []
        most = ENTANGLED if _entangled(members, known) else MOST
        for first in range(0, len(members), most):
            few = members[first : first + most]
            chosen = masks[first : first + most] or [None] * len(few)
            whole = wholes.get(key) if len(members) <= most else None
            change = {key[0]: "".join(f"+{c.effect}@{c.port}" for c in few)}
            result.append(Batch(change, tuple(zip(few, chosen, strict=True)), whole))
        if key in wholes and len(members) > most:  # no batch has all of them
            result.append(Batch(wholes[key].change, ((wholes[key], None),)))
    return _sharing(result, known)


def _entangled(members: Sequence[Candidate], known: Mapping[tuple[str, str], str]) -> bool:
    """Whether an effect varies coefficients, alone or as groups of balances."""
    kinds = {
        kind for (instance, name), kind in known.items()
        for c in members if instance == c.instance and name.endswith(c.port.rpartition(".")[2])
    }  # fmt: skip
    return kinds == {"coefficient"}


def _sharing(batches: Sequence[Batch], known: Mapping[tuple[str, str], str]) -> list[Batch]:
    """Batches with neighbours of the same component in one FMU.

    Args:
        batches: of one effect each.
        known: kinds of the balances by instance and name; others are groups, which share their
            declarations.
    """
    open_: dict[tuple[str, bool], list[int]] = {}
    shares: list[list[int]] = []
    for index, batch in enumerate(batches):
        first = batch.members[0][0]
        if batch.change is None:
            continue
        key = (first.instance, (first.instance, first.port) in known)
        share = open_.get(key, [])
        places = sum(len(batches[i].members) for i in (*share, index))
        split = any(batches[i].members[0][0].effect == first.effect for i in share) and (
            _entangled([first], known)
        )
        if not share or split or len(share) >= EFFECTS or places > PLACES:
            share = open_[key] = []
            shares.append(share)
        share.append(index)
    result = list(batches)
    for share in shares:
        instance = batches[share[0]].members[0][0].instance
        whole = "".join((batches[i].change or {})[instance] for i in share)
        for i in share:
            result[i] = replace(batches[i], change={instance: whole})
    return result


def _numbers(elements: Sequence[Candidate]) -> list[int]:
    """Of elements of a vector."""
    return [part[1] for part in (element_of(c.port) for c in elements) if part]


def _shown(problem: Problem) -> dict[int, NDArray[np.bool_]]:
    """Element -> channels that measure this element of a vector."""
    numbers = []
    for channel in problem.channels:
        match = _INDEX.search(channel.signal)
        numbers.append(int(match[1]) if match else 0)
    return {n: np.array(numbers) == n for n in sorted(set(numbers)) if n}
