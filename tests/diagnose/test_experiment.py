"""The proposed run tells apart what the runs at hand do not, as well as it was said to."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.own_plant import example, made
from cosim.calibrate.parts import MeasuredRun
from cosim.calibrate.problem import Problem
from cosim.diagnose.answer import Verdict
from cosim.diagnose.candidates import Candidate, candidates
from cosim.diagnose.experiment import propose, scaled
from cosim.diagnose.models import Fitted
from cosim.diagnose.rounds import Round
from cosim.diagnose.search import Search
from cosim.diagnose.table import table_of
from cosim.diagnose.verdict import decide
from tests.problems import simulator

pytestmark = pytest.mark.slow

EXAMPLE = Path(__file__).parents[2] / "scenarios/motor_bench/data/MB-12"


def varied(run: MeasuredRun, factor: float, name: str, purpose: str) -> MeasuredRun:
    """A run with scaled inputs."""
    found = scaled(run, factor)
    assert found is not None
    return replace(found, name=name, purpose=purpose)


def attributed(
    problem: Problem, known: list[Candidate]
) -> tuple[Round, Verdict, list[Fitted | None]]:
    """One round over these candidates, the verdict, and the rivals that it names."""
    search = Search(simulator(problem), only=known)
    try:
        base = search.calibrated()
        search.note(base)
        stage = search.round(base)
        table = table_of(search, search.rounds, {}, {})
        verdict = decide(table)
        return stage, verdict, [search.memo.get(table.models[i].labels) for i, _ in verdict.rivals]
    finally:
        search.close()


@pytest.mark.parametrize(("truth", "size"), [("coulomb", 0.04), ("stribeck", 0.07)])
def test_slow_runs_do_not_tell_two_frictions_apart_and_the_proposed_one_does(
    truth: str, size: float
) -> None:
    rig = example(EXAMPLE, 4.0)
    step = next(run for run in rig.runs if run.name == "ST1")
    slow = [varied(step, 0.4, "A", "identification"), varied(step, 0.4, "B", "validation")]
    rig = rig.changed(runs=slow, parameters=[p for p in rig.parameters if not p.run])
    labels = ("coulomb at load.flange", "stribeck at load.flange")
    known = [c for c in candidates(rig) if c.label in labels]
    (item,) = [c for c in known if c.effect == truth]

    first, verdict, rivals = attributed(made(rig, item, size, 5).problem, known)
    (rival,) = rivals
    assert first.winner is not None and rival is not None and verdict.kind == "confounded"
    proposal = propose(first.winner, rival)
    assert proposal is not None and proposal["distance"] > 4.0

    assert propose(first.winner, first.winner) is None  # no run tells a model from itself

    run = next(run for run in slow if run.name == proposal["run"])
    more = [
        varied(run, proposal["input_factor"], f"P{i}", "identification")
        for i in range(proposal["repetitions"])
    ]
    more_runs = made(rig.changed(runs=[*slow, *more]), item, size, 5).problem
    second, verdict, _ = attributed(more_runs, known)
    assert verdict.kind == "effect_found" and [x.effect for x in verdict.laws] == [truth]
    costs = {f.effects[-1].effect: f.estimate.cost for f in second.fitted}
    gain = max(costs.values()) - min(costs.values())
    # noise alone moves a gain of d^2 / 2 by d: 4 of these, on a distance of 16 and more
    promised = proposal["distance"]
    assert gain == pytest.approx(0.5 * promised**2 * len(more), abs=4.0 * promised)
