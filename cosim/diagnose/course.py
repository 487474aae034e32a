"""What a search does next: rounds, laws of one place, sets along the log's motion.

The course of docs/diagnosis.md: rounds add laws until one adds none; where one leaves far more than
noise and its law took less than half of what was missing, a law of one place and sets along the
log's motion are asked, once; where one without a law leaves more than noise, laws are asked anew
around the sheet's values, once. The verdict is another matter: it comes from the table of all fits.
"""

from __future__ import annotations

from ..errors import CosimError, UnbuiltError
from .answer import percent
from .fitter import BRINGS
from .grey_box import single
from .grey_box.single import ALL
from .localise import everywhere, localise
from .models import Fitted, is_open
from .power import power
from .result import Diagnosis
from .rivals import reconsidered
from .rounds import Round
from .search import ROUNDS, Search
from .second_look import around_nominal, leaves_law
from .together import ahead, together
from .unstable import ends
from .verdict import HALF
from .whiteness import CALIBRATED


class Course:
    """Rounds one after the other, and what is asked between them.

    Args:
        result: of which fits are looked for; it notes places, laws of one place and warnings.
        search: scores and fits.
        base: the model to begin with.
        rounds: how many laws are added at most; none where a law from the data is asked for.
    """

    def __init__(
        self, result: Diagnosis, search: Search, base: Fitted, rounds: int = ROUNDS
    ) -> None:
        self.result, self.search, self.base, self.rounds = result, search, base, rounds
        self.current = base
        """The best model so far."""
        self.winners: list[Round] = []
        """The rounds that added its laws."""
        self.whole: Fitted | None = None
        """A set found along the log's motion that leaves noise."""
        self.proposed = rounds == 0
        """Whether such sets have been asked for."""
        self.at_nominal = False
        """Whether laws were asked around nominal values, and one was better there."""
        self.waiting: Round | None = None
        """The round there; it takes the place of all rounds so far."""

    def followed(self) -> Fitted:
        """The best model that it leads to."""
        search = self.search
        for number in range(self.rounds):
            search.say(f"round {number + 1}: {len(search.known)} candidates")
            stage = self._next()
            if stage is None:
                break
            if number == 0 and self.base is self.result.before:
                self._located(stage)
            if stage.winner is not None and self.winners and slight(search, stage):
                stage.winner = None
            if not (self._without(stage) if stage.winner is None else self._added(stage)):
                break
        else:
            if self.waiting is not None:
                self._taken(self._replaced(self.waiting))
            self.current = reconsidered(search, self.current, self.winners)
        return self._ended()

    def _next(self) -> Round | None:
        """The next round; none if it fails, then what earlier ones have found is kept."""
        if self.waiting is not None:
            return self._replaced(self.waiting)
        try:
            return self.search.round(self.current)
        except CosimError as error:
            if not self.winners:
                raise
            self.result.warnings.append(f"no further effect was looked for: {error}")
            self.search.say(self.result.warnings[-1])
            return None

    def _replaced(self, stage: Round) -> Round:
        """The round around nominal values, in the place of all rounds so far."""
        self.winners, self.waiting = [], None
        self.search.rounds.append(stage)
        return stage

    def _located(self, stage: Round) -> None:
        """What the first round tells besides: power, and where what is missing enters."""
        result, search = self.result, self.search
        bench = search.bench(self.base, search.fitting)
        result.power = power(stage, search.fitting, bench)
        search.evaluations += bench.evaluations
        result.warnings += [stage.unasked] if stage.failed else []
        if stage.winner is not None or self._slow(self.base):
            search.say("where does it enter?")
            ranked = [s.candidate for s in stage.signatures]
            result.located = localise(search, self.base, ranked)

    def _slow(self, model: Fitted) -> bool:
        """Whether a model leaves what is no noise, larger than stated or not."""
        return leaves_law(self.search, model)

    def _taken(self, stage: Round) -> None:
        """Go on with what a round has found."""
        assert stage.winner is not None
        self.search.say(f"added: {stage.winner.effects[-1].label}")
        self.winners.append(stage)
        self.current = stage.winner

    def _without(self, stage: Round) -> bool:
        """After a round that added nothing; whether there is a further one."""
        self.current = stage.base
        found = reconsidered(self.search, self.current, self.winners)
        if found is not self.current:
            self.current = found
            return True
        return self._asked_at_nominal()

    def _added(self, stage: Round) -> bool:
        """After a round that added a law; whether there is a further one."""
        result, search = self.result, self.search
        self._taken(stage)
        asked = stage.open and not self.proposed and share(search, stage) < HALF
        one_place = bool(result.located) and result.located[0].curves[0].explained > ALL
        if asked and one_place and not search.raw.late:
            asked_everywhere(result)
            asked_single(result)
        one = result.single
        if asked and (ahead(search) or (one is not None and one.enough)):
            self.proposed, found = True, proposed_set(result, self.current)
            if found is not self.current and not search.lacking(found):
                self.whole = found
        if self.whole is not None and len(self.whole.effects) <= len(self.current.effects) + 1:
            return False  # else rounds may do with fewer laws
        one = result.single
        if one is not None and one.enough and search.lacking(self.current):
            return False  # named laws elsewhere could only describe it worse
        self.current = shortened(result, self.winners, self.current)
        if self._slow(self.current):
            return True
        self.current = reconsidered(search, self.current, self.winners)
        # a law too small to be missed hides in the others and bends them; where runs turn unstable,
        # every law moves the moment a little, and seems one
        return not search.raw.unstable

    def _asked_at_nominal(self) -> bool:
        """Ask once around nominal values; whether a law there is better."""
        if self.at_nominal:
            return False
        self.waiting = around_nominal(self.search, self.current)
        self.at_nominal = self.waiting is not None
        return self.at_nominal

    def _ended(self) -> Fitted:
        """The best of what rounds and sets have led to, fitted to the end."""
        search, current, whole = self.search, self.current, self.whole
        if whole is not None and (
            search.lacking(current) or search.total(current, whole) > 0.0
        ):  # fmt: skip
            current = whole
        if not self.proposed and self._slow(current):
            current = proposed_set(self.result, current)
        drafted = bool(self.winners) and self.winners[-1].open
        if drafted and is_open(current.estimate):
            current = search.sharpened(current, self.winners[-1].base)
        return current


def slight(search: Search, stage: Round) -> bool:
    """Whether a further law takes next to nothing of what is evidently still missing.

    It is not what is missing then, and further ones on top of it would mislead.
    """
    estimate, winner = stage.base.estimate, stage.winner
    assert winner is not None
    calibrated = estimate.robust < CALIBRATED**2 * 0.5 * estimate.count
    if search.raw.unstable or calibrated or share(search, stage) > BRINGS:
        return False
    taken = percent(max(share(search, stage), 0.0))
    search.say(f"not added: {winner.effects[-1].label}, {taken} of what is left")
    return True


def share(search: Search, stage: Round) -> float:
    """What a round's law takes of what the model before leaves beyond noise."""
    base, winner = stage.base, stage.winner
    assert winner is not None
    return search.gain(base, winner) / (base.estimate.robust - 0.5 * base.estimate.count)


def asked_everywhere(result: Diagnosis) -> None:
    """Where what the declared model lacks may enter, asked at all places, once."""
    search, base = result.search, result.before
    assert search is not None and base is not None
    if not result.everywhere:
        search.say("where does it enter? Asked at all places")
        result.located, result.everywhere = everywhere(search, base), True


def asked_single(result: Diagnosis) -> None:
    """The best law of signals of one place, asked once."""
    search, base = result.search, result.before
    assert search is not None and base is not None
    if result.single is None:
        result.single = one = single(search, base, result.located)
        beyond = base.estimate.robust - 0.5 * base.estimate.count
        gained = search.gain(base, one.law.fitted) if one is not None and one.law else 0.0
        if one is not None and gained > HALF * beyond:
            result.located.sort(key=lambda place: place.label != one.label)


def proposed_set(result: Diagnosis, current: Fitted) -> Fitted:
    """The best set of effects by evidence along the log's motion, or the given model.

    Of those at one place alone, and where one law does as well, if one law there would do.
    """
    search = result.search
    assert search is not None
    if search.raw.late:  # start values that decide when casters turn over hide first orders
        return current
    asked_everywhere(result)
    asked_single(result)
    one = result.single
    enough = one is not None and one.enough
    only = [site.shaft for site in (one.site, *one.alike)] if one is not None and enough else []
    try:
        return together(search, current, result.located, only)
    except UnbuiltError as error:
        result.warnings.append(f"sets of effects were not compared along the log: {error}")
        search.say(result.warnings[-1])
        return current


def shortened(result: Diagnosis, winners: list[Round], current: Fitted) -> Fitted:
    """The model judged by runs that end where it has left them by an instability."""
    search = result.search
    assert search is not None
    if not search.raw.late or winners[-1].open or not search.lacking(current):
        return current
    names = [*search.fitting.names, *search.checking.names]
    try:
        sizes = ends(current.simulator, current.estimate.theta, list(dict.fromkeys(names)))
    except CosimError as error:  # it runs so well that a small change is too much
        search.say(f"where runs turn unstable is not known: {error}")
        return current
    if not sizes:
        return current
    for name, size in sizes.items():
        result.ended[name] = float(current.problem.run(name).logged[size])
    until = ", ".join(f"{name} to {result.ended[name]:.2f} s" for name in sizes)
    search.say(f"unstable from there on, so runs count up to where the model leaves them: {until}")
    current = reconsidered(search, current, winners)
    for stage in winners:
        stage.open, stage.cut = False, True
    return search.shortened(current, sizes)
