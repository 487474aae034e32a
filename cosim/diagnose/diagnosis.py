"""The whole chain on one data set."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

from threadpoolctl import threadpool_limits

from ..calibrate.budget import Budget, StoppedError
from ..calibrate.checks.examine import check_fit, examine
from ..calibrate.checks.finding import Finding, lines, passed
from ..calibrate.checks.own_errors import exact_starts
from ..calibrate.estimate import Estimate
from ..calibrate.input_noise import propagated
from ..calibrate.pool import SessionPool
from ..calibrate.problem import Problem
from ..calibrate.simulator import Simulator
from ..errors import CosimError
from .adding import made_of
from .alike import hold_all
from .anew import asked_anew
from .answer import Verdict
from .bounds import opened, told
from .bursts import bursts, times
from .by_run import by_run
from .candidates import candidates
from .carriers import leave_fmus
from .course import Course, asked_everywhere, asked_single
from .established import all_told, examined
from .experiment import propose
from .facts import Table
from .foreign import Adapter, attached
from .foreign_file import leave_system
from .foreign_words import placed
from .further import Further, looked
from .grey_box import Site, site, unnamed
from .left_over import left_over
from .levelled import levelled
from .localise import localise
from .models import Fitted
from .result import Diagnosis
from .rivals import elsewhere, simplified
from .rounds import Round
from .search import ROUNDS, Search
from .second_look import leaves_more
from .small import small_laws, widen
from .table import candidates_of, force_of, table_of, unsure
from .verdict import above, decide, proposal, unasked

TURNS = 4
"""Times at most that a proposed set is fitted to the end with its special cases, or a free force is
asked for beside it; after each of them another set may be proposed."""


def diagnose(
    problem: Problem,
    out: Path | None = None,
    say: Callable[[str], None] = lambda text: None,
    *,
    workers: int | None = None,
    without: Iterable[str] = (),
    law_at: str = "",
    law: bool = True,
    budget: Budget | None = None,
) -> Diagnosis:
    """Calibrate, look for what is missing, and judge: all that `cosim diagnose` does on a data set.

    Args:
        problem: the declared system and its data.
        out: folder for the FMUs with what was found, none are written if not given.
        say: told what is done.
        workers: threads, one per core if not given.
        without: effects that are left out of the catalogue, to see what it says of data that have
            them: it should end with `unexplained`, or with laws that do the same.
        law_at: make a law from the data there (`load.flange`; `fan.tau` of an FMU without
            sources), and do not ask the catalogue.
        law: make one from the data where no law of the catalogue fits, too; takes several times as
            long as to see that none does.
        budget: how much may be simulated. A search that it ends is `unexplained`, with what it has
            found as hints.

    Raises:
        CosimError: the declared system cannot be simulated, no effect of that name fits it, no law
            can enter there, or the budget ends before the declared parameters are fitted.
        UnknownNameError: there is no such place.
    """
    problem, adapters = attached(problem)
    asked = site(problem, placed(law_at, adapters)) if law_at else None
    budget = budget or Budget()
    task = _Task(asked, adapters, out, say, tuple(without), law, workers, budget)
    try:
        return _diagnosed(problem, task)
    except StoppedError as stopped:
        raise CosimError(
            f"{problem.name}: stopped {stopped}, before the declared parameters were fitted; there "
            "is nothing to report yet, so let it go on for longer"
        ) from stopped


@dataclass(frozen=True)
class _Task:
    """How `diagnose` was called."""

    asked: Site | None
    adapters: tuple[Adapter, ...]
    out: Path | None
    say: Callable[[str], None]
    without: tuple[str, ...]
    law: bool
    workers: int | None
    budget: Budget
    begun: float = field(default_factory=time.perf_counter)


def _diagnosed(
    problem: Problem, task: _Task, first: Collection[str] = (), base: Fitted | None = None
) -> Diagnosis:
    """The diagnosis on one system, or on one with more parts if what is missing shows there.

    Args:
        problem: the declared system and its data.
        task: how it was called.
        first: labels of candidates that are considered before all others, if any.
        base: the declared model on the smaller system, to begin with.
    """
    simulator = Simulator(problem, workers=task.workers, pool=SessionPool(task.budget))
    findings = examine(simulator)
    if any(f.severity == "error" for f in findings):
        return _refused(problem, findings, task)
    # threads of BLAS wait in loops, at the cost of simulations
    with threadpool_limits(1, user_api="blas"):
        simulator, counted = propagated(simulator)
        findings += counted
        search = Search(simulator, task.say, None if task.asked is None else [],
                        without=task.without)  # fmt: skip
        if first:
            search.narrowed(first)
        search.prepare()
        try:
            calibrated = search.calibrated(None if base is None else base.estimate.values)
            late = check_fit(calibrated.estimate)
            if {f.kind for f in late if f.severity == "error"} in ({"start"}, {"differs"}):
                task.say("what differs from run to run explains what is left: does one law?")
                simpler = _one_law(search, calibrated)
                late = passed(late, frozenset({"start", "differs"} if simpler else ()))
            findings += late
            if any(f.severity == "error" for f in late):
                return _refused(problem, findings, task)
            further, notes = looked(problem, calibrated, simulator)
            whole, why = (None, "") if task.asked else _shown(further, problem, "before", task.say)
            named: set[str] = set()
            result = None
            if whole is None:
                result = _smaller(search, calibrated, findings, task, further)
                if result.answer.laws:
                    named = {law.label for law in result.answer.laws}
                    whole, why = _shown(further, problem, "after", task.say)
            if whole is not None:
                own = {c.label for c in candidates(whole)} - {c.label for c in candidates(problem)}
                try:  # what was named gets its turn beside what the smaller system lacks
                    larger = _diagnosed(whole, task, own | named, calibrated)
                    if larger.verdict != "bad_data":
                        larger.warnings.insert(0, why)
                        return larger
                    notes.append(f"not {why}: {larger.reason}")
                except (CosimError, StoppedError) as error:  # what the smaller one says stays
                    notes.append(f"not {why}: {error}")
            if result is None:
                result = _smaller(search, calibrated, findings, task, further)
            result.warnings += notes
            return _written(result, task)
        finally:
            search.close()


def _one_law(search: Search, declared: Fitted) -> bool:
    """Whether one law leaves noise: less to assume than an error of each run."""
    stage = search.round(declared)
    search.rounds.clear()
    return stage.winner is not None and not search.lacking(stage.winner)


def _smaller(
    search: Search,
    base: Fitted,
    findings: list[Finding],
    task: _Task,
    further: list[Further],
) -> Diagnosis:
    """What one system says, judged in larger ones."""
    result = _searched(search, base, findings, task)
    result.further = further
    with task.budget.lifted():
        _look_further(result)
    return result


def _shown(
    further: Iterable[Further], raw: Problem, which: str, say: Callable[[str], None]
) -> tuple[Problem | None, str]:
    """The system in whose own channels what is missing shows, if there is one, and a sentence."""
    for item in further:
        if tests := item.unseen(raw, which):
            shown = ", ".join(f"{t.channel} ({t.rms:.3g} times its noise)" for t in tests)
            why = f"diagnosed with {item.problem.file.path.stem}: what is missing shows in {shown}"
            why += f", more than in any channel of {raw.file.path.stem}"
            say(why)
            return item.problem, why
    return None, ""


def _refused(problem: Problem, findings: list[Finding], task: _Task) -> Diagnosis:
    """The verdict on data that cannot be used."""
    errors = tuple(lines(f for f in findings if f.severity == "error"))
    table = Table(errors=errors)
    result = Diagnosis(problem, decide(table), table, findings=findings)
    result.warnings = lines(f for f in findings if f.severity != "error")
    result.wall = time.perf_counter() - task.begun
    return result


def _searched(search: Search, base: Fitted, findings: list[Finding], task: _Task) -> Diagnosis:
    problem, asked = search.raw, task.asked
    result = Diagnosis(problem, Verdict(""), search=search, before=base, findings=findings)
    result.adapters = task.adapters
    result.warnings = lines(findings)
    result.withheld = tuple(sorted(search.withheld))
    search.note(base)
    result.asked, why, settled = asked is not None, "", False
    rounds = ROUNDS if asked is None else 0
    try:
        current = Course(result, search, base, rounds).followed()
        if search.narrow and search.lacking(current):
            search.widened()
            current = Course(result, search, current, rounds).followed()
        wide: list[Estimate] = []
        current = _judged(result, search, current, wide)
        while (found := _asked_anew(result, search, current)) is not None:
            current = _judged(result, search, found, wide)
        settled = True
        with task.budget.lifted():  # what was found stands, and is told whole
            _completed(result, search, current, wide)
        assert result.after is not None
        enough = result.answer.white or (result.answer.bounds and not result.answer.beyond)
        if result.verdict == "unexplained" and not enough and asked is None:
            result.by_run = by_run(search, base)
            enough = any(not item.left for item in result.by_run)
        if asked or (task.law and result.verdict == "unexplained" and not enough):
            if asked is None and not search.raw.late:
                asked_everywhere(result)
                asked_single(result)
                if result.located:  # the places are others now
                    force = force_of(result.located[0])
                    result.answer = replace(result.answer, force=force)
            lacking = search.cut(result.after) if result.ended else result.after
            result.law = unnamed(search, lacking, result.located, asked, result.single)
    except StoppedError as stopped:
        why = str(stopped)
    with task.budget.lifted():
        if why:
            _stopped(result, search, why, settled=settled)
        assert result.after is not None
        cut = result.ended and result.after is base  # runs were ended since it was fitted: it lacks
        if not cut and not search.lacking(result.after):
            sudden = bursts(search.fit_data - result.after.fit, search.fitting)
            result.bursts = times(sudden, list(search.fitting.runs))
        left_over(result)
        result.warnings += told(base, result.after)
        result.warnings += unsure(result.table, result.after.labels)
        if result.verdict == "unexplained" and (said := exact_starts(problem)):
            result.warnings.append(said)
    return result


def _written(result: Diagnosis, task: _Task) -> Diagnosis:
    """The result with its files."""
    problem, after, out = result.problem, result.after, task.out
    assert after is not None
    if result.law is not None:
        result.files += result.law.leave_fmu(out)
    if out is not None and result.answer.laws:
        result.files += leave_fmus(problem, after.effects, out, result.warnings)
        made = made_of(problem, after)
        result.files += leave_system(problem, result.adapters, made, out, result.warnings)
    result.wall = time.perf_counter() - task.begun
    return result


def _stopped(result: Diagnosis, search: Search, why: str, *, settled: bool) -> None:
    """The verdict on the fits that there are; one that is settled stays."""
    search.say(f"stopped {why}")
    if settled:
        result.warnings.append(f"no law was made from the data: stopped {why}")
        return
    forces = {frozenset[str](): result.located} if result.located else {}
    result.table = table_of(search, search.rounds, forces, result.ended, why)
    result.answer, result.after = decide(result.table), result.before


def _judged(result: Diagnosis, search: Search, current: Fitted, wide: list[Estimate]) -> Fitted:
    """The verdict on all fits; the set that it proposes is fitted to the end before it is named.

    Args:
        result: gets table, verdict and model.
        search: its rounds and fits.
        current: the best model that they have led to.
        wide: estimates that hold their parameters with small laws, see `widen`.

    Returns:
        The set that was proposed last, the given model if none was.
    """
    rounds, ended = search.rounds, result.ended
    forces = {frozenset[str](): result.located} if result.located else {}
    current = examined(search, current, candidates_of(rounds))
    declared = search.memo.declared
    if search.lifted is None:
        search.lifted = opened(search, declared)
    simple: set[frozenset[str]] = set()
    level: set[frozenset[str]] = set()
    offered = list(dict.fromkeys(c for stage in rounds for c in stage.probes))
    for _ in range(TURNS):
        widen(search, current, wide)
        if current.effects:
            search.memo.keep(current)
            if current.labels not in simple:
                simplified(search, current, offered)
                elsewhere(search, current, _beside(search, current))
                simple.add(current.labels)
                level.add(current.labels)
                levelled(search, current, level)
        result.table = table_of(search, rounds, forces, ended)
        place = proposal(result.table)
        others = [] if place is None else unasked(result.table, place)
        for labels in [result.table.models[i].labels for i in others]:
            known = search.memo.get(labels)
            assert known is not None
            search.say(f"does each of these do something? {', '.join(sorted(labels))}")
            examined(search, known, candidates_of(rounds))
        if others:
            result.table = table_of(search, rounds, forces, ended)
            place = proposal(result.table)
        if place is None:
            break
        best = result.table.models[place]
        if best.labels != current.labels:
            known = search.memo.get(best.labels)
            assert known is not None
            current = all_told(search, search.recalled(known, declared))
        elif above(best) and best.labels not in forces:
            search.say("does a force at a port explain what is left?")
            ranked = [s.candidate for s in rounds[0].signatures]
            forces[best.labels] = localise(search, current, ranked)
        else:
            break
    else:  # a force was asked last, or another set proposed
        result.table = table_of(search, rounds, forces, ended)
        place = proposal(result.table)
        if place is not None and result.table.models[place].labels != current.labels:
            known = search.memo.get(result.table.models[place].labels)
            assert known is not None
            current = search.recalled(known, declared)
    result.answer = decide(result.table)
    result.after = current if result.answer.laws else result.before
    return current


def _asked_anew(result: Diagnosis, search: Search, current: Fitted) -> Fitted | None:
    """A better set than the proposed one, if that leaves more than noise and there is one."""
    place = proposal(result.table)
    if result.asked or search.raw.late or place is None:
        return None
    if result.table.models[place].labels != current.labels or not leaves_more(search, current):
        return None
    try:
        return asked_anew(search, current)
    except CosimError as error:  # the set that is proposed stays
        result.warnings.append(f"laws were not asked for anew: {error}")
        search.say(result.warnings[-1])
        return None


def _completed(result: Diagnosis, search: Search, current: Fitted, wide: list[Estimate]) -> None:
    """What is said beside the verdict: small laws, and what would tell its set from another."""
    after, answer = result.after, result.answer
    assert after is not None
    widen(search, after, wide)
    others = [search.memo.get(result.table.models[i].labels) for i in answer.alike]
    result.warnings += hold_all(after, [other for other in others if other is not None])
    result.small = small_laws(search, after)
    result.warnings += [law.sentence for law in result.small]
    if answer.rivals:
        names = result.table.models[answer.rivals[0][0]].labels
        rival = search.memo.get(names)
        assert rival is not None
        result.experiment = propose(current, rival)


def _beside(search: Search, fitted: Fitted) -> list[Round]:
    """The rounds that asked beside laws of a set; if none did, one that asks for the same laws.

    A set that was found along the log's motion has had no rounds.
    """
    laws = set(fitted.effects)
    if len(laws) < 2 or any(laws & set(stage.base.effects) for stage in search.rounds):
        return search.rounds
    kinds = {effect.effect for effect in laws}
    return [search.scored(fitted, {c.label for c in search.known if c.effect in kinds})]


def _look_further(result: Diagnosis) -> None:
    """Judge the model with what was found on runs of other systems, too."""
    search, before, after = result.search, result.before, result.after
    assert search is not None and before is not None and after is not None
    for item in list(result.further):
        search.say(f"further runs: {', '.join(run.name for run in item.problem.runs)}")
        if after is before:
            item.residuals |= {
                ("after", n): v for (which, n), v in list(item.residuals.items())
                if which == "before"
            }  # fmt: skip
            continue
        try:
            item.judge("after", result.problem, after)
        except CosimError as error:  # they are an extra: the verdict stands without them
            result.further.remove(item)
            result.warnings.append(f"further runs are not judged: {error}")
