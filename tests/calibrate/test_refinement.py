"""A fidelity of which the declared one is a limit stands beside the effects."""

from __future__ import annotations

import numpy as np

from cosim.calibrate.problem import Problem
from cosim.calibrate.refinement import Refinement
from cosim.diagnose.candidates import candidates
from sources.packaging.catalog import refinements
from tests.problems import simulator

HELD = (("signed", 0.0),)
ELASTIC = Refinement("elastic", "elastic", "k", "k", held=HELD)
PLAY = Refinement("backlash", "elastic+backlash@spring", "spring.backlash.gap", "k", held=HELD)


def residual_size(problem: Problem, theta: np.ndarray, data: np.ndarray) -> float:
    model = simulator(problem).simulate(theta, "sines")
    return float(np.sqrt(np.mean(((model - data) / problem.sigma) ** 2)))


def test_the_stiff_limit_is_the_declared_gearbox(short: Problem, truth: np.ndarray) -> None:
    rigid = simulator(short).simulate(truth, "sines")
    elastic = ELASTIC.added_to(short, "gearbox")
    (compliance,) = [p for p in elastic.parameters if p.inverse]
    theta = elastic.nominal
    theta[: truth.size] = truth
    stiff = residual_size(elastic, theta, rigid)
    theta[elastic.index(compliance.name)] = compliance.span
    soft = residual_size(elastic, theta, rigid)
    # a hundredth of the compliance leaves a hundredth of the twist; 0.3: the exchange of a
    # rigid gearbox and that of a stiff spring differ within a step
    assert stiff < 0.3 < soft


def test_it_is_a_candidate_with_a_place_of_its_own(measured: Problem) -> None:
    found = [c for c in candidates(measured) if c.refinement is not None]
    assert [(c.label, c.prefix, c.change) for c in found] == [
        ("elastic at gearbox", "gearbox.elastic.", {"gearbox": "elastic"}),
        ("backlash at gearbox", "gearbox.backlash.", {"gearbox": "elastic+backlash@spring"}),
    ]


def test_play_comes_with_the_spring_that_it_needs(short: Problem) -> None:
    problem = PLAY.added_to(short, "gearbox")
    added = problem.parameters[len(short.parameters) :]
    assert [p.name for p in added if p.strength] == ["gearbox.backlash.gap"]
    assert {p.name for p in added} >= {"gearbox.backlash.1/k", "gearbox.backlash.d"}
    (compliance,) = [p for p in added if p.inverse]
    # a rigid gear with play still has a stiffness to be found: it begins at the gear's own
    assert compliance.nominal == compliance.span > compliance.minimum


def test_joints_yield_one_by_one_and_keep_what_was_found_before() -> None:
    found = refinements("ur5_arm/ticked+payload@tool")
    assert [entry["port"] for entry in found] == [f"joint_{k}" for k in range(1, 7)]
    assert {entry["fidelity"] for entry in found} == {"ticked_elastic+payload@tool"}
    assert (found[2]["parameter"], found[2]["others"]) == ("c[3]", ("t_d[3]",))
    # another joint may yield, too
    again = refinements("ur5_arm/ticked_elastic+payload@tool")
    assert again == found
    assert refinements("ur5_arm/elastic") == []
