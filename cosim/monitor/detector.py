"""What changed, since when: one change after the other, all dates and names weighed anew each time.

Whether there is one is asked of numbers per log that need no model of their scatter (`profiles`).
What it is and since when is asked of the likelihood of all residuals, in which the noise is white
and declared parameters scatter between logs as they do from log to log; gains of other names and
dates count over the scatter that is left.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from ..diagnose.linear import MATERIAL
from ..diagnose.models import GATE
from .amounts import UNEVEN, Sums
from .change import Change, Found
from .evidence import Evidence, Moments
from .gains import Gains, Scored
from .patterns import Direction
from .profiles import (
    PARTS,
    Profile,
    chances,
    constants,
    paired,
    profiles,
    reached,
    regress,
    shares,
    successive,
    weights,
)

Vector = NDArray[np.float64]
MOST = 6
"""Changes that are looked for; with more, the machine is another one."""
SHARE = 0.1
"""A further change that is smaller than this share of the largest one is not told from what that
one leaves: patterns are of first order, and laws have their usual shapes."""
EXACT = 0.01
"""The same where patterns are taken at the very size, of parameters and sensors."""
FINALISTS = 4
"""Likeliest names, and likeliest declared parameters, whose patterns are taken at their full size
before one of them is chosen."""
RIVAL = 0.5
"""So are all names that explain this share of what the likeliest one does: the first order of a
large change (a heading that goes astray) may be off by a third."""
NEAR = 0.1
"""Share by which a size may differ from that at which its pattern was taken: sizes are good to so
much (`SHARE`)."""
PASSES = 4
"""Times that names and dates of all changes, or sizes of patterns, are weighed anew at most."""
DATES = 1.92
"""Fall of the log likelihood at the ends of a 95 % interval [nats]."""
CURVED = 0.25
"""Of a bend over its whole size, what a creep misses in the middle, where its pattern is taken at
the end: a parabola's distance from its chord."""
LEFT = 0.1
"""Share of the energy that a name explains which may begin to be missing at the same date; beyond,
the name does not fit."""


class Detector:
    """Looks for changes.

    Args:
        evidence: residuals of the series.
        rate: probability of any alarm on a series in which nothing changes.
    """

    def __init__(self, evidence: Evidence, rate: float) -> None:
        self.evidence, self.patterns = evidence, evidence.patterns
        logs = evidence.series.logs
        self.days = np.array([(log.date - logs[0].date).total_seconds() / 86400.0 for log in logs])
        self.shapes = profiles(self.days)
        self.matrix = np.array([shape.values for shape in self.shapes])
        keys = [tuple(self.patterns.keys[name] for name in log.runs) for log in logs]
        self.known = constants(keys)
        basis = np.linalg.qr(self.known)[0]
        centred = self.matrix - (self.matrix @ basis) @ basis.T
        rest, whole = (np.sum(m**2, axis=1) for m in (centred, self.matrix))
        self._hidden = np.flatnonzero(rest < 1e-9 * whole)
        self.unseen = [self.shapes[k] for k in self._hidden]
        """What cannot be told from logs that are driven otherwise."""
        self.moments = evidence.moments()
        own = self.moments.own()[0]
        self.watched = [k for k in range(self.patterns.width) if np.isfinite(own[:, k]).sum() > 3]
        quantities = len(self.watched) + evidence.channels
        self.tests = quantities * len(self.shapes)
        self.among = quantities * shares(self.shapes)
        """By profile, the number of tests that its share of the rate is divided by."""
        self.pairs = PARTS * 0.5 * quantities * len(self.shapes) * (len(self.shapes) - 1)
        self.rate = rate
        self._chosen = np.log(self.among / self.among.min())
        """What the best of many profiles gains more by chance than the best of few [nats]."""
        self._changes: list[Change] = []

    # -- sums with changes taken off -----------------------------------------------------------

    def _columns(self, changes: Iterable[Change]) -> tuple[list[int], Vector]:
        """Columns of changes and their amounts by log."""
        columns: list[int] = []
        rows: list[Vector] = []
        for change in changes:
            assert change.direction is not None
            for column, amount in zip(change.direction.columns, change.amounts, strict=True):
                columns.append(column)
                rows.append(amount * change.profile.values)
        return columns, np.array(rows).reshape(len(columns), self.days.size)

    def _without(self, changes: Sequence[Change]) -> Moments:
        return self.moments.without(*self._columns(changes))

    def alarm(self, changes: Sequence[Change]) -> float:
        """Smallest probability over all tests, corrected for their number."""
        values, deviations = self._without(changes).own()
        known = np.column_stack([self.known, *(c.profile.values for c in changes)])
        least = 1.0
        for column in self.watched:
            series, own = values[:, column], deviations[:, column]
            p = chances(series, own, known, self.matrix)
            both = paired(series, own, known, self.matrix) * self.pairs
            least = min(least, float(np.min(p * self.among)), both)
        return least

    # -- names and dates ---------------------------------------------------------------------------

    def gains(self, changes: Sequence[Change], root: Vector) -> Gains:
        """What each direction gains with each profile beside changes."""
        moments = self._without(changes)
        sums = Sums(*moments.weighted(root), self.known, self.patterns.declared)
        own = moments.own()
        directions, dates, chance = self.patterns.directions, [], []
        for direction in directions:
            gain, amounts = sums.by_profile(direction.columns, self.matrix)
            chance.append(self._chosen + (len(direction.columns) - 1.0))
            gain -= chance[-1]
            gain[self._hidden] = 0.0
            if direction.least is not None:
                same = [c for c in changes if c.direction and c.direction.name == direction.name]
                others = sum((c.amounts[0] * c.profile.values for c in same), 0.0 * self.days)
                values, deviations = (part[:, direction.columns[0]] for part in own)
                there = reached(values, deviations, others, self.matrix, amounts[:, 0])
                size = np.abs(amounts[:, 0]) * np.max(np.abs(self.matrix), axis=1)
                gain[there < direction.least - SHARE * size] = 0.0
            dates.append(gain)
        return Gains(sums, directions, self.matrix, dates, chance)

    def best(
        self, changes: Sequence[Change], root: Vector, *, further: bool = False, plain: bool = False
    ) -> Change | None:
        """The change that explains most of what the others leave.

        Args:
            changes: the others.
            root: of the scatter between logs.
            further: it is one more, and no small one.
            plain: only what has one column: two fit the sum of two changes too well.
        """
        gains = self.gains(changes, root)
        taken = [(c.direction.name, c.profile) for c in changes if c.direction]
        # what the bend of a pattern leaves of a creep looks like a spell
        bent = {c.direction.name for c in changes if c.profile.kind == "creep" and c.direction}

        def allowed(direction: Direction) -> NDArray[np.bool_]:
            if plain and len(direction.columns) > 1:
                return np.zeros(len(self.shapes), dtype=np.bool_)
            return np.array(
                [not any(name == direction.name and shape.alike(other) for name, other in taken)
                 and not (direction.name in bent and shape.last) for shape in self.shapes]
            )  # fmt: skip

        best = gains.best(allowed)
        if further:
            least = max((self._blur(c) for c in changes), default=0.0)
            while best and self._explained(self._change(gains, best[0])).sum() < least:
                best.pop(0)
        if not best:
            return None
        first = self._change(gains, best[0])
        names = {name: k for k, name in enumerate(d.name for d in self.patterns.directions)}
        alike = {best[0].direction, *(names[name] for name in first.rivals)}
        simplest = min(
            (entry for entry in best if entry.direction in alike),
            key=lambda entry: (
                self.patterns.directions[entry.direction].complexity, -entry.score
            ),
        )  # fmt: skip
        return first if simplest == best[0] else self._change(gains, simplest)

    def full(self, changes: Sequence[Change], root: Vector) -> None:
        """Take the patterns of the likeliest next changes at their full sizes.

        A large change of a parameter does more than many small ones, which would count for another
        name.
        """
        known = {change.direction.name for change in changes if change.direction}
        taken: dict[int, Vector] = {}
        for _ in range(PASSES):
            gains = self.gains(changes, root)
            order = gains.best(lambda d: np.full(len(self.shapes), d.name not in known))
            declared = [e for e in order if self.patterns.directions[e.direction].declared]
            close = [e for e in order if e.score > RIVAL * order[0].score]
            likely = dict.fromkeys([*order[:FINALISTS], *close, *declared[:FINALISTS]])
            new = False
            for entry in likely:
                change = self._change(gains, entry)
                size = change.amounts * change.full
                before = taken.get(entry.direction)
                if before is not None and np.all(np.abs(size - before) <= NEAR * np.abs(before)):
                    continue
                self.patterns.secant(entry.direction, size)
                taken[entry.direction], new = size, True
            if not new:
                break
            self.moments = self.evidence.moments()

    def _change(self, gains: Gains, entry: Scored) -> Change:
        """A direction and a profile as a change, with intervals and rivals."""
        index, sums = entry.direction, gains.sums
        direction, shape = self.patterns.directions[index], self.shapes[entry.profile]
        gain = float(gains.dates[index][entry.profile])
        columns = list(direction.columns)
        fitted = sums.fitted(columns, np.tile(shape.values, (len(columns), 1)))
        amounts = fitted.values
        # scatter along the direction beyond what the model has of it
        first = columns[int(np.argmax(np.abs(amounts)))]
        own = np.maximum(sums.weight[:, first, first], 1e-300)
        freedom = max(self.days.size - self.known.shape[1] - 1, 1)
        rest = fitted.rest[:, first] ** 2 / own
        spread = max(float(rest.sum()) / freedom, 1.0)
        told = own * (amounts[columns.index(first)] * shape.values) ** 2
        uneven = max(float(np.sum(rest / (1.0 + UNEVEN**2 * told))) / freedom, 1.0)
        alike = [k for k, s in enumerate(self.shapes) if s.kind == shape.kind]
        near = [
            self.shapes[k].first for k in alike if gains.dates[index][k] > gain - DATES * spread
        ]  # fmt: skip
        rivals = []
        for other, values in enumerate(gains.dates):
            if other == index or self.patterns.directions[other].contains(direction):
                continue
            theirs = gains.score(other, int(np.argmax(values)))
            if theirs > entry.score - GATE * uneven or self._alike(
                sums, direction, other, amounts, shape
            ):
                rivals.append((theirs, self.patterns.directions[other].name))
        rivals.sort(reverse=True)
        named = {d.name: d for d in self.patterns.directions}
        names = [
            name for _, name in rivals
            if not any(named[name].contains(named[other]) for _, other in rivals)
        ]  # fmt: skip
        return Change(
            direction, shape, amounts, np.sqrt(np.diag(fitted.covariance) * spread), gain,
            min(near), max(near), tuple(names), spread=spread,
        )  # fmt: skip

    def _alike(
        self, sums: Sums, direction: Direction, other: int, amounts: Vector, shape: Profile
    ) -> bool:  # fmt: skip
        """Whether another direction does the same but for less than has a name."""
        columns = list(direction.columns)
        rival = list(self.patterns.directions[other].columns)
        theirs = sums.nearest(shape.values, columns, rival, amounts)
        if theirs is None:
            return False
        most = float(np.max(np.abs(shape.values)))
        size = self.evidence.largest(
            [*columns, *rival], most * np.concatenate([amounts, -theirs]),
            np.zeros(self.patterns.declared),
        )  # fmt: skip
        return size < MATERIAL

    # -- all together ------------------------------------------------------------------------------

    def refitted(self, changes: Sequence[Change], root: Vector) -> list[Change]:
        """The changes with their amounts fitted together."""
        if not changes:
            return []
        sums = Sums(*self.moments.weighted(root), self.known, self.patterns.declared)
        columns = [c for change in changes for c in change.direction.columns]  # type: ignore[union-attr]
        shapes = np.array([change.profile.values for change in changes for _ in change.amounts])
        fitted = sums.fitted(columns, shapes)
        amounts = fitted.values
        spreads = np.array([change.spread for change in changes for _ in change.amounts])
        deviations = np.sqrt(np.diag(fitted.covariance) * spreads)
        found, place = [], 0
        for change in changes:
            size = change.amounts.size
            part = slice(place, place + size)
            found.append(replace(change, amounts=amounts[part], deviations=deviations[part]))
            place += size
        return found

    def weighed(
        self, changes: list[Change], root: Vector, *, plain: bool = False
    ) -> list[Change]:  # fmt: skip
        """All names and dates weighed anew, each with the others taken off."""
        for _ in range(PASSES):
            before = [(c.direction, c.profile) for c in changes]
            for place in range(len(changes)):
                others = [c for k, c in enumerate(changes) if k != place]
                again = self.best(others, root, plain=plain)
                if again is None:
                    continue
                again = replace(again, p=changes[place].p)
                changes = [*changes[:place], again, *changes[place + 1 :]]
                changes = self.refitted(changes, root)
            if before == [(c.direction, c.profile) for c in changes]:
                break
        return changes

    def sharpened(self, changes: list[Change], root: Vector) -> list[Change]:
        """Patterns of the changes taken at their full size."""
        places = {d.name: k for k, d in enumerate(self.patterns.directions)}
        found = []
        for change in changes:
            assert change.direction is not None
            place = places[change.direction.name]
            self.patterns.secant(place, change.amounts * change.full)
            found.append(replace(change, direction=self.patterns.directions[place]))
        self.moments = self.evidence.moments()
        return self.refitted(found, root)

    def found(self) -> Found:
        """Look for all changes."""
        changes: list[Change] = []
        first = self.moments.own()[0][:, : self.patterns.declared]
        for plain in (True, False):
            while len(changes) < MOST and (least := self.alarm(changes)) < self.rate:
                root = self._without(changes).scatter()
                self.full(changes, root)
                change = self.best(changes, root, further=True, plain=plain)
                if change is None or change.gain < GATE * change.spread:
                    break
                change = replace(change, p=least)
                changes = self.refitted([*changes, change], root)
                changes = self.sharpened(changes, root)
                changes = self.weighed(changes, self._without(changes).scatter(), plain=plain)
            if changes:
                changes = self.weighed(changes, self._without(changes).scatter())
                changes = self.sharpened(changes, self._without(changes).scatter())
                changes = self._needed(changes)
        columns, amounts = self._columns(changes)
        root = self._without(changes).scatter()
        fitted = self._without(changes).own()[0][:, : self.patterns.declared]
        left = self.evidence.left(columns, amounts, fitted)
        unexplained = self._unexplained(left, changes)
        changes = [
            self._judged(self._sized(change, changes), unexplained) for change in changes
        ]  # fmt: skip
        changes += unexplained
        changes.sort(key=lambda c: (c.profile.first, -c.gain))
        named = [c for c in changes if c.direction is not None]
        before = left
        if named:
            before = self.evidence.left([], np.zeros((0, self.days.size)), first)
        own, alone = self._own(named), self._correlated(named)
        return Found(changes, self.tests, root, own, before, left, alone)

    def _needed(self, changes: list[Change]) -> list[Change]:
        """Those that are not small beside the largest one, once all names are right."""
        sizes = [float(self._explained(change).sum()) for change in changes]
        least = max(map(self._blur, changes))
        kept = [
            change for change, size in zip(changes, sizes, strict=True)
            if size >= least and change.gain > GATE * change.spread
        ]  # fmt: skip
        return self.refitted(kept, self._without(kept).scatter())

    def _own(self, changes: Sequence[Change]) -> tuple[Vector, Vector]:
        """Values and deviations of each column by log, all changes but its own taken off."""
        values, deviations = self._without(changes).own()
        for change in changes:
            assert change.direction is not None
            if len(change.direction.columns) == 1:
                added = change.amounts[0] * change.profile.values
                values[:, change.direction.value] += added
        return values, deviations

    def _explained(self, change: Change) -> Vector:
        """Mean square over the noise that a change adds to each channel at its largest."""
        assert change.direction is not None
        count = self.evidence.channels
        full = change.amounts * change.full
        found = np.zeros(count)
        for values in self.patterns.values.values():
            pattern = values[:, list(change.direction.columns)] @ full
            found = np.maximum(found, np.mean(pattern.reshape(-1, count) ** 2, axis=0))
        return found

    def _blur(self, change: Change) -> float:
        """What a change may leave: laws have their usual shapes, creeps a pattern of one size."""
        assert change.direction is not None
        exact = change.direction.kind != "effect" and change.profile.kind != "creep"
        return (EXACT if exact else SHARE) ** 2 * float(self._explained(change).sum())

    def _unexplained(self, left: Vector, changes: Sequence[Change]) -> list[Change]:
        """Channels of which other than before is left, by more than patterns are wrong by."""
        found = []
        explained = sum((self._explained(c) for c in changes), np.zeros(self.evidence.channels))
        with np.errstate(divide="ignore", invalid="ignore"):
            logs = np.log(left)
        for place, channel in enumerate(self.evidence.series.problem.channels):
            series = np.where(np.isfinite(logs[:, place]), logs[:, place], np.nan)
            result = regress(series, np.ones_like(series), self.known, self.matrix)
            p = result.p * self.among
            best = int(np.argmin(p))
            shape = self.shapes[best]
            whole = float(result.slope[best] * np.max(np.abs(shape.values)))
            least = max(MATERIAL**2, SHARE**2 * float(explained[place]))
            if not p[best] < self.rate or abs(math.expm1(whole)) < least:
                continue
            gains = 0.5 * (result.slope / result.deviation) ** 2
            near = [
                s.first for k, s in enumerate(self.shapes)
                if s.kind == shape.kind and gains[k] > gains[best] - DATES
            ]  # fmt: skip
            found.append(
                Change(
                    None, shape, result.slope[best : best + 1], result.deviation[best : best + 1],
                    float(gains[best]), min(near), max(near), channel=channel.name,
                    p=float(p[best]),
                )
            )  # fmt: skip
        return found

    def _sized(self, change: Change, changes: Sequence[Change]) -> Change:
        """With its size from numbers per log, the other changes taken off."""
        direction = change.direction
        assert direction is not None
        if len(direction.columns) > 1:
            return change
        column = direction.value
        others = [c for c in changes if c is not change]
        values, deviations = (v[:, column] for v in self._without(changes).own())
        if np.isfinite(values).sum() < 4:
            return change
        values = values + change.amounts[0] * change.profile.values
        known = np.column_stack([self.known, *(c.profile.values for c in others)])
        shape = change.profile.values[None, :]
        result = regress(values, weights(values, deviations), known, shape)
        if result.freedom < 1 or not np.isfinite(result.deviation[0]):
            return change
        size = float(result.slope[0]) * change.full
        half = float(stdtrit(result.freedom, 0.975) * result.deviation[0]) * change.full
        if change.profile.kind == "creep":
            bend = CURVED * self.patterns.bent.get(direction.columns[0], 0.0)
            half += bend * abs(size)
            aside = math.ceil(bend * (self.days.size - change.profile.first))
            change = replace(
                change, low=max(change.low - aside, 1),
                high=min(change.high + aside, self.days.size - 1),
            )  # fmt: skip
        if direction.kind == "effect":  # a diagnosis fits the shape of its law, too
            half += SHARE * abs(size)
        return replace(change, size=size, half=half)

    def _judged(self, change: Change, unexplained: Sequence[Change]) -> Change:
        """Whether the name explains what changed: no more than a little of it is left."""
        assert change.direction is not None
        together = [c for c in unexplained if c.low <= change.high and change.low <= c.high]
        if not together:
            return change
        missing = sum(math.expm1(float(c.amounts[0] * c.full)) for c in together)
        return replace(change, fits=bool(missing < LEFT * float(self._explained(change).sum())))

    def _correlated(self, changes: Sequence[Change]) -> dict[str, float]:
        """Declared parameters whose successive logs are more alike than chance makes them."""
        values = self._without(changes).own()[0]
        known = np.column_stack([self.known, *(c.profile.values for c in changes)])
        declared = self.patterns.directions[: self.patterns.declared]
        found = {d.name: successive(values[:, d.value], known) for d in declared}
        return {name: size for name, size in found.items() if size}
