"""The whole chain on one data set, and its result."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ..calibrate.checks.examine import check_data, examine
from ..calibrate.checks.finding import Finding, lines, passed
from ..calibrate.checks.late import check_late
from ..calibrate.clocks import offsets
from ..calibrate.deferred import step_error
from ..calibrate.nuisance import late_values
from ..calibrate.problem import Problem
from ..calibrate.simulator import Simulator
from ..errors import CosimError, ScenarioError, UnbuiltError
from .adding import made_of
from .bursts import bursts, times
from .carriers import leave_fmus
from .exchange import reconsidered
from .experiment import propose
from .further import Further, judged
from .grey_box import LawFromData, Site, site, unnamed
from .linear import SampleStack
from .localise import Place, localise
from .models import Fitted, is_open
from .power import power
from .rounds import Round
from .search import ROUNDS, Search
from .unstable import ends
from .whiteness import WhitenessTest, whiteness_tests

Vector = NDArray[np.float64]
PURPOSES = ("identification", "validation")


@dataclass
class Diagnosis:
    """Verdict and evidence.

    Attributes:
        problem: the declared system with the data as measured.
        verdict: effect_found, nothing_missing, confounded, unexplained or bad_data.
        reason: one or two sentences.
        search: all rounds.
        before, after: calibrated models without and with the effects.
        rivals: sets of effects that explain the data equally well.
        located: where an unknown input would have to enter the declared system, the best first.
        places: other places where the same effect would do the same, by label.
        residuals: (`before`/`after`, run) -> residuals over sigma, free of the step's error.
        structure: (`before`/`after`, purpose) -> tests.
        power: see `power.power`.
        experiment: proposed to separate rivals.
        ended: run -> time from which it does not count: what happens there hangs on small changes
            of start values (see `unstable`).
        further: the models on runs that need another system.
        law: made from the data where something enters that has no name.
        bursts: times of sudden residuals of a model that is at the noise elsewhere, by run.
        files: written ones.
        findings: on the data.
    """

    problem: Problem
    verdict: str
    reason: str
    search: Search | None = None
    before: Fitted | None = None
    after: Fitted | None = None
    rivals: list[Fitted] = field(default_factory=list)
    located: list[Place] = field(default_factory=list)
    places: dict[str, list[str]] = field(default_factory=dict)
    residuals: dict[tuple[str, str], Vector] = field(default_factory=dict)
    structure: dict[tuple[str, str], list[WhitenessTest]] = field(default_factory=dict)
    power: dict[str, dict[str, Any]] = field(default_factory=dict)
    experiment: dict[str, Any] | None = None
    ended: dict[str, float] = field(default_factory=dict)
    further: list[Further] = field(default_factory=list)
    law: LawFromData | None = None
    bursts: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    files: list[Path] = field(default_factory=list)
    wall: float = 0.0
    warnings: list[str] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)

    def _repr_html_(self) -> str:
        from .notebook import shown

        return shown(self.to_dict(), self.problem, self.residuals)

    def rms(self, which: str, purpose: str) -> dict[str, float | None]:
        """Channel -> RMS residual in its unit over the runs of a purpose."""
        rows = [
            self.residuals[which, run.name]
            for run in self.problem.runs
            if run.purpose == purpose and (which, run.name) in self.residuals
        ]
        if not rows:
            return {c.name: None for c in self.problem.channels}
        stacked = np.concatenate(rows)
        found: dict[str, float | None] = {}
        for column, channel in enumerate(self.problem.channels):
            values = stacked[:, column]
            values = values[np.isfinite(values)]
            found[channel.name] = (
                float(np.sqrt(np.mean(values**2))) * channel.sigma if values.size else None
            )
        return found

    def to_dict(self) -> dict[str, Any]:
        """As of `cosim diagnose --json`."""
        table: dict[str, Any] = {
            "dataset": self.problem.name,
            "system": self.problem.file.path.stem,
            "verdict": self.verdict,
            "reason": self.reason,
            "warnings": self.warnings,
            "findings": [finding.to_dict() for finding in self.findings],
            "effects": self.effects(),
            "model": made_of(self.problem, self.after),
            "alternatives": [
                {"effects": [c.label for c in f.effects], "score": self._score(f)}
                for f in self.rivals
            ],
            "localisation": [place.to_dict() for place in self.located],
            "law_from_data": None if self.law is None else self.law.to_dict(),
            "power": self.power,
            "proposed_experiment": self.experiment,
            "channels": {},
            "further_runs": [item.to_dict() for item in self.further],
            "parameters": self.parameters(),
            "clocks": offsets(fitted.estimate) if (fitted := self.after or self.before) else {},
            "start_values": self.start_values(),
            "bursts": self.bursts,
            "unstable_from": self.ended,
            "structure": {
                f"{which} {purpose}": [s.to_dict() for s in tests]
                for (which, purpose), tests in self.structure.items()
            },
            "evaluations": self.search.evaluations if self.search else 0,
            "wall_s": self.wall,
            "files": [str(path) for path in self.files],
        }
        for channel in self.problem.channels:
            table["channels"][channel.name] = {
                "unit": channel.unit,
                "noise_rms": channel.sigma,
                **{
                    which: {p: self.rms(which, p)[channel.name] for p in PURPOSES}
                    for which in ("before", "after")
                },
            }
        return table

    def _score(self, fitted: Fitted) -> float:
        """Log likelihood of a rival over that of its round's winner, all runs [nats]."""
        assert self.search is not None
        pairs = [p for r in self.search.rounds for p in zip(r.rivals, r.scores, strict=True)]
        return next(score for rival, score in pairs if rival is fitted)

    def parameters(self) -> dict[str, Any]:
        """Calibrated parameters before and after."""
        table: dict[str, Any] = {}
        for which, fitted in (("before", self.before), ("after", self.after)):
            if fitted is None:
                continue
            estimate = fitted.estimate
            for i, p in enumerate(estimate.problem.parameters):
                if p.role == "nuisance":
                    continue
                table.setdefault(p.name, {"unit": p.unit})[which] = {
                    "value": float(estimate.theta[i]),
                    "ci95": [float(estimate.low[i]), float(estimate.high[i])],
                    "identifiable": bool(estimate.identifiable[i]),
                }
        return table

    def start_values(self) -> dict[str, dict[str, float]]:
        """Late values that were estimated, by run."""
        return late_values(self.after.problem) if self.after is not None else {}

    def effects(self) -> list[dict[str, Any]]:
        """The effects that were found."""
        if self.after is None or self.search is None or self.before is None:
            return []
        found = []
        estimate = self.after.estimate
        stages = {r.winner.effects[-1]: r for r in self.search.rounds if r.winner is not None}
        for item in self.after.effects:
            prefix = item.prefix
            values = {
                p.name.removeprefix(prefix): {
                    "value": float(estimate.theta[i]),
                    "ci95": [float(estimate.low[i]), float(estimate.high[i])],
                    "unit": p.unit,
                    "identifiable": bool(estimate.identifiable[i]),
                }
                for i, p in enumerate(estimate.problem.parameters)
                if p.name.startswith(prefix)
            }
            stage = stages.get(item)
            winner = stage.winner if stage else None
            found.append(
                {
                    "effect": item.effect,
                    "component": item.instance,
                    "port": item.port,
                    "place": item.place,
                    "text": item.text,
                    "parameters": values,
                    "p_value": winner.p_value if winner else None,
                    "explained": self._explained(stage),
                    "gain_nats": self.search.gain(stage.base, winner) if stage and winner else None,
                    "validation_gain_nats": winner.gate.gain if winner and winner.gate else None,
                    "other_places": self.places.get(item.label, []),
                }
            )
        return found

    def _explained(self, stage: Round | None) -> float | None:
        """Share of the excess over the noise that the effect takes away."""
        if stage is None or stage.winner is None:
            return None
        before = stage.base.estimate
        excess = 2.0 * before.cost - before.count
        taken = 2.0 * (before.cost - stage.winner.estimate.cost)
        return float(np.clip(taken / excess, 0.0, 1.0)) if excess > 0.0 else None


def diagnose(
    problem: Problem,
    out: Path | None = None,
    say: Callable[[str], None] = lambda text: None,
    *,
    workers: int | None = None,
    law_at: str = "",
) -> Diagnosis:
    """Close the loop on one data set.

    Args:
        problem: the declared system and its data.
        out: folder for the FMUs with the effects.
        say: told what is done.
        workers: threads, one per core if not given.
        law_at: make a law from the data there (`load.flange`), and do not ask the catalogue.

    Raises:
        CosimError: the declared system cannot be simulated, or no law can enter there.
        UnknownNameError: there is no such place.
    """
    begun, asked = time.perf_counter(), site(problem, law_at) if law_at else None
    simulator = Simulator(problem, workers=workers)
    findings = examine(simulator)
    if any(f.severity == "error" for f in findings):
        return _refused(problem, findings, begun)
    search = Search(simulator, say, only=None if asked is None else [])
    search.prepare()
    try:
        # threads of BLAS wait in loops, at the cost of simulations
        with threadpool_limits(1, user_api="blas"):
            base = search.calibrated()
            late = passed(check_late(base.estimate), problem.source.allow)
            findings += late
            if any(f.severity == "error" for f in late):
                return _refused(problem, findings, begun)
            return _searched(search, base, findings, out, say, begun, asked)
    finally:
        search.close()


def _refused(problem: Problem, findings: list[Finding], begun: float) -> Diagnosis:
    """The verdict on data that cannot be used."""
    errors = lines(f for f in findings if f.severity == "error")
    result = Diagnosis(problem, "bad_data", "; ".join(errors), findings=findings)
    result.warnings = lines(f for f in findings if f.severity != "error")
    result.wall = time.perf_counter() - begun
    return result


def _searched(
    search: Search,
    base: Fitted,
    findings: list[Finding],
    out: Path | None,
    say: Callable[[str], None],
    begun: float,
    asked: Site | None = None,
) -> Diagnosis:
    problem = search.raw
    result = Diagnosis(problem, "", "", search, base, findings=findings)
    result.warnings = lines(findings)
    current = base
    winners: list[Round] = []
    for number in range(ROUNDS if asked is None else 0):
        say(f"round {number + 1}: {len(search.known)} candidates")
        try:
            stage = search.round(current)
        except UnbuiltError as error:
            if not winners:
                raise
            result.warnings.append(f"no further effect was looked for: {error}")
            say(result.warnings[-1])
            break
        if number == 0:
            result.power = power(stage, search.fitting)
            if stage.winner is not None or any(
                s.structured for p in PURPOSES for s in _tests(search, base, p)
            ):
                say("where does it enter?")
                ranked = [s.candidate for s in stage.signatures]
                result.located = localise(search, base, ranked, say)
        if stage.winner is None:
            current = stage.base
            found = reconsidered(search, current, winners)
            if found is current:
                break
            current = found
            continue
        say(f"added: {stage.winner.effects[-1].label}")
        winners.append(stage)
        current = stage.winner
        shortened = _shortened(result, winners, current)
        if not any(s.structured for p in PURPOSES for s in _tests(search, shortened, p)):
            current = reconsidered(search, shortened, winners)
            break
        current = shortened
    else:
        current = reconsidered(search, current, winners)
    if winners and winners[-1].open and is_open(current.estimate):  # only drafted so far
        current = search.sharpened(current, winners[-1].base)
    if len(current.effects) > 1:
        current = search.eliminated(current)
        winners = [w for w in winners if w.winner and w.winner.effects[-1] in current.effects]
    if not search.lacking(current):
        sudden = bursts(search.fit_data - current.fit, search.fitting)
        result.bursts = times(sudden, list(search.fitting.runs))
    result.after = current
    _verdict(result, winners)
    if asked or result.verdict == "unexplained":
        result.law = unnamed(search, current, result.located, asked)
    if result.law is not None:
        result.files += result.law.leave_fmu(out)
        result.reason = f"{'' if asked else result.reason} {result.law.reason}".strip()
    _look_further(result)
    if out is not None and current.effects:
        result.files += leave_fmus(problem, current.effects, out, result.warnings)
    result.wall = time.perf_counter() - begun
    return result


def _shortened(result: Diagnosis, winners: list[Round], current: Fitted) -> Fitted:
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
        result.ended[name] = float(current.problem.run(name).times[size])
    until = ", ".join(f"{name} to {result.ended[name]:.2f} s" for name in sizes)
    search.say(f"unstable from there on, so runs count up to where the model leaves them: {until}")
    current = reconsidered(search, current, winners)
    for stage in winners:
        stage.open = False  # their rivals have had their turn
    return search.shortened(current, sizes)


def _tests(search: Search, fitted: Fitted, purpose: str) -> list[WhitenessTest]:
    if purpose == PURPOSES[0]:
        return whiteness_tests(search.fit_data - fitted.fit, search.fitting)
    return whiteness_tests(search.check_data - fitted.check, search.checking)


def _verdict(result: Diagnosis, winners: list[Round]) -> None:
    search, before, after = result.search, result.before, result.after
    assert search is not None and before is not None and after is not None
    for which, fitted in (("before", before), ("after", after)):
        if which == "after" and after is before:
            result.residuals |= {
                ("after", name): v for (kind, name), v in list(result.residuals.items())
            }
        else:
            _residuals(result, which, fitted)
        for purpose in PURPOSES:
            runs = [r for r in result.problem.runs if r.purpose == purpose]
            if runs:
                stack = SampleStack(result.problem, runs)
                vector = stack.vector([result.residuals[which, r.name] for r in runs])
                result.structure[which, purpose] = whiteness_tests(vector, stack)
    left = {
        s.channel
        for purpose in PURPOSES
        for s in result.structure.get(("after", purpose), [])
        if s.structured
    }
    remark = (
        f" In {', '.join(sorted(left))} the residual still holds more than noise." if left else ""
    )
    if result.ended:
        until = ", ".join(f"{name} up to {time:.1f} s" for name, time in result.ended.items())
        remark += (
            f" Further effects were looked for in {until} only: after that, changes of the start "
            "values that nobody can see decide what the model does."
        )
    if winners:
        different: list[Fitted] = []
        for stage in winners:
            assert stage.winner is not None
            added = stage.winner.effects[-1]
            for rival in stage.rivals:
                other = rival.effects[-1]
                if other.effect == added.effect:
                    result.places.setdefault(added.label, []).append(other.place)
                elif other not in after.effects:
                    different.append(rival)
            if stage.winner.signature is not None:
                tried = {f.effects[-1].label for f in stage.fitted}
                for label in set(stage.winner.signature.same) - tried:
                    result.places.setdefault(added.label, []).append(label)
        result.rivals = different
        names = " and ".join(c.label for c in after.effects)
        if different:
            result.verdict = "confounded"
            others = ", ".join(f.effects[-1].label for f in different)
            result.experiment = propose(winners[-1].winner or after, different[0])
            result.reason = f"{names} explains the data, but so does {others}." + remark
        else:
            result.verdict = "effect_found"
            result.reason = (
                f"{names}: the gain holds on runs that were not used for fitting, and no other "
                f"effect of the catalogue does as well." + remark
            )
    elif left:
        result.verdict = "unexplained"
        result.reason = (
            f"The residual of {', '.join(sorted(left))} holds more than noise, and no effect of "
            "the catalogue explains it on unused runs."
        )
    else:
        result.verdict = "nothing_missing"
        result.reason = (
            "The calibrated system reaches the noise, and no effect of the catalogue improves it "
            "on unused runs."
        )


def _residuals(result: Diagnosis, which: str, fitted: Fitted) -> None:
    """Residuals against the data as measured, the step's error removed at these parameters."""
    step = result.problem.step
    whole = {run.name: run for run in result.problem.runs}
    runs = [replace(whole[run.name], starts=run.starts) for run in fitted.problem.runs]
    problem = fitted.problem.changed(runs=runs, step=step)
    simulator = fitted.simulator.limited({}).of(problem)
    theta = fitted.estimate.theta
    errors = step_error(simulator, theta, step)
    for name, residual in simulator.residuals(theta, None):
        result.residuals[which, name] = residual + errors[name] / problem.sigma
    simulator.close()


def _look_further(result: Diagnosis) -> None:
    """Judge the models on runs that need another system."""
    assert result.search is not None and result.before is not None and result.after is not None
    for read in result.problem.further:
        try:
            problem = read()
            if not problem.runs:
                continue
            result.search.say(f"further runs: {', '.join(run.name for run in problem.runs)}")
            found = passed(check_data(problem), problem.source.allow)
            wrong = [f for f in found if f.run and f.severity == "error"]
            if wrong:
                raise ScenarioError("; ".join(map(str, wrong)))
            simulator = Simulator(problem, workers=result.search.simulator.workers)
            result.further.append(judged(simulator, result.problem, result.before, result.after))
        except CosimError as error:  # they are an extra: the verdict stands without them
            result.warnings.append(f"further runs are not judged: {error}")
