"""Models of small discs as a diagnosis makes them, for tests of what it decides about models.

The plants are those of `disc.py`. Everything else is the diagnosis' own: its search, its fits and
their judgement.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosim.calibrate.mapping import read_problem
from cosim.calibrate.problem import Problem
from cosim.diagnose.candidates import Candidate, candidates
from cosim.diagnose.models import Fitted, compare
from cosim.diagnose.probes import single
from cosim.diagnose.search import Search
from cosim.diagnose.signature import Signature, unscored
from tests.diagnose import disc
from tests.problems import simulator

FEW = ("sweep", "steps", "check")
FLANGE = "load.flange"
LATE = """
[[nuisance]]
name = "angle"
unit = "rad"
nominal = 0.0
span = 0.5
prior = 0.2
targets = "load.angle"
per_run = true
late = true
"""
"""Where the disc stands when a run begins: not looked at before an effect explains the data."""
Laws = Mapping[str, disc.Law]
NOTHING: Mapping[str, float] = {}


def problem(
    folder: Path,
    law: disc.Law | Laws,
    seconds: float = 1.6,
    *,
    unstable: bool = False,
    angle: float = 0.0,
    late: Mapping[str, float] = NOTHING,
    names: Sequence[str] = FEW,
    mapped: Callable[[str], str] = str,
) -> Problem:
    """A disc in a few runs, one of them unused.

    Args:
        folder: to write to.
        law: what the model lacks, or that by run.
        seconds: that each run lasts.
        unstable: whether start angles may decide what comes of a run.
        angle: at which the disc stands when runs begin, which no mapping says [rad].
        late: `delay` [s] or `clock_skew` of the clock by which runs were logged.
        names: of the runs.
        mapped: the mapping as it is to be, from the usual one.
    """
    laws = law if isinstance(law, Mapping) else dict.fromkeys(names, law)
    disc.write(folder, lambda w, theta, t: 0.0, seconds=seconds, names=names)
    for seed, name in enumerate(names):
        disc.write(folder / name, laws[name], seed=seed, seconds=seconds, names=[name])
        table = np.loadtxt(folder / name / f"{name}.csv", delimiter=",", skiprows=1)
        table[:, 3] += angle
        t, _, *logged = disc.run(name, laws[name], seconds)
        seen = t - late.get("delay", 0.0) - late.get("clock_skew", 0.0) * t
        table[:, 2:] += np.array([np.interp(seen, t, values) - values for values in logged]).T
        np.savetxt(folder / f"{name}.csv", table, delimiter=",", fmt="%.7g",
                   header="time,tau,w,theta", comments="")  # fmt: skip
    mapping = folder / "dataset.toml"
    mapping.write_text(mapped(mapping.read_text(encoding="utf-8")), encoding="utf-8")
    if unstable:
        with mapping.open("a", encoding="utf-8") as file:
            file.write(LATE)
    return read_problem(folder)


@dataclass(frozen=True)
class Rig:
    """A search on a problem, and the calibrated model.

    Attributes:
        search: of no candidates but those that a test names.
        base: without effects.
        said: what the search has said.
    """

    search: Search
    base: Fitted
    said: list[str]

    def candidate(self, effect: str, place: str = FLANGE) -> Candidate:
        """An effect of the catalogue that fits the problem."""
        known = candidates(self.search.raw)
        return next(c for c in known if (c.effect, c.place) == (effect, place))

    def trace(
        self, base: Fitted, effect: str, place: str = FLANGE, fixed: Mapping[str, float] = NOTHING
    ) -> Signature:
        """An effect of which only fits are judged, with some of its parameters at other values."""
        (probe,) = single(base.problem, [self.candidate(effect, place)])
        found = unscored(probe)
        found.fixed.update({probe.candidate.prefix + n: v for n, v in fixed.items()})
        return found

    def added(
        self,
        base: Fitted,
        effect: str,
        values: Mapping[str, float],
        *,
        place: str = FLANGE,
        held: Mapping[str, float] = NOTHING,
        fit: bool = True,
    ) -> Fitted:
        """A model with a further effect.

        Args:
            base: the model without.
            effect, place: what is added.
            values: its parameters that are fitted, with the values to begin with; all others are
                held where they are usual.
            held: its parameters that were tried at other values than usual, where they stay unless
                they are fitted.
            fit: whether parameters are fitted until that brings nothing more, or by one step.
        """
        item = self.trace(base, effect, place, held)
        prefix = item.candidate.prefix
        whole = item.candidate.added_to(base.problem)
        fixed = {
            p.name: item.fixed.get(p.name, p.nominal)
            for p in item.probe.others if p.name.removeprefix(prefix) not in values
        }  # fmt: skip
        less = whole.hold(fixed)
        start = {**base.estimate.values, **{prefix + n: v for n, v in values.items()}}
        theta = np.array([start[name] for name in less.names])
        of = self.search.simulator.of(less)
        found = self.search.fitted(of, theta, share=0.0 if fit else 1e9)
        found.effects, found.signature = (*base.effects, item.candidate), item
        found.gate = compare(self.search.check_data, base.check, found.check, self.search.checking)
        self.search.note(found)
        return found


@contextmanager
def rig(
    folder: Path,
    law: disc.Law | Laws,
    seconds: float = 1.6,
    *,
    unstable: bool = False,
    angle: float = 0.0,
    late: Mapping[str, float] = NOTHING,
    mapped: Callable[[str], str] = str,
) -> Iterator[Rig]:
    """See `problem`; the search ends with the context."""
    said: list[str] = []
    plant = problem(folder, law, seconds, unstable=unstable, angle=angle, late=late, mapped=mapped)
    search = Search(simulator(plant), said.append, only=[])
    try:
        base = search.calibrated()
        search.note(base)
        yield Rig(search, base, said)
    finally:
        search.close()


SEARCH_STEP, ANCHOR, WEIGHT = 0.02, 0.5, 0.6


@contextmanager
def hanging(folder: Path) -> Iterator[Rig]:
    """A disc with a weight beside its axis, run coarsely in a search."""

    def write(text: str) -> str:
        return text.replace("step =", f"search_step = {SEARCH_STEP}\nstep =", 1)

    def law(w: float, theta: float, t: float) -> float:
        return WEIGHT * math.sin(theta + ANCHOR)

    with rig(folder, law, mapped=write) as found:
        yield found
