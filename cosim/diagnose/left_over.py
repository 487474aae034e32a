"""What both models leave in all runs, and tests on it."""

from __future__ import annotations

from dataclasses import replace

from ..calibrate.deferred import step_error
from .linear import SampleStack
from .models import Fitted
from .result import PURPOSES, Diagnosis
from .whiteness import whiteness_tests


def left_over(result: Diagnosis) -> None:
    """Residuals of both models in all runs, and tests on them."""
    before, after = result.before, result.after
    assert before is not None and after is not None
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
        result.residuals[which, name] = residual + whole[name].white(errors[name] / problem.sigma)
    simulator.close()
