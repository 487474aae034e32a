"""A fidelity of which the declared one is a limit stands beside the effects."""

from __future__ import annotations

import numpy as np

from cosim.calibrate.parts import Refinement
from cosim.calibrate.problem import Problem
from cosim.diagnose.candidates import candidates

ELASTIC = Refinement("elastic", "k", (("signed", 0.0),))


def residual_size(problem: Problem, theta: np.ndarray, data: np.ndarray) -> float:
    model = problem.simulate(theta, "sines")
    return float(np.sqrt(np.mean(((model - data) / problem.sigma) ** 2)))


def test_the_stiff_limit_is_the_declared_gearbox(short: Problem, truth: np.ndarray) -> None:
    rigid = short.simulate(truth, "sines")
    elastic = short.with_fidelity("gearbox", ELASTIC)
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
        ("elastic at gearbox", "gearbox.elastic.", {"gearbox": "elastic"})
    ]
