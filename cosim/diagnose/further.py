"""Runs and channels that need another system: the models that were found are judged there.

Runs in which an arm swings, say, and the currents of its joints, on a base that was diagnosed with
its arm folded. Parameters and effects are carried over by the names of instances and variables;
nothing is fitted but start values of the runs, as for all unused runs. What shows most in channels
that the first system does not have is missing in the other one (`Further.unseen`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..calibrate.budget import StoppedError
from ..calibrate.checks.examine import check_data
from ..calibrate.checks.finding import passed
from ..calibrate.deferred import step_error
from ..calibrate.nuisance import late_estimated, released, settled
from ..calibrate.pool import SessionPool
from ..calibrate.problem import Problem
from ..calibrate.simulator import Simulator
from ..errors import CosimError, ScenarioError, VariantError
from .linear import SampleStack
from .models import Fitted
from .whiteness import WhitenessTest, whiteness_tests

Vector = NDArray[np.float64]
FITTED, BEYOND = "identification", 2.0
"""Times the worst shared channel's RMS over the noise from which one that only the other system has
shows something of its own: on a lever, an error of the pose is a little more at an arm's end."""


@dataclass
class Further:
    """Models on runs of another system.

    Attributes:
        simulator: of that system with its runs.
        residuals: (`before`/`after`, run) -> residuals over sigma.
    """

    simulator: Simulator
    residuals: dict[tuple[str, str], Vector] = field(default_factory=dict)

    @property
    def problem(self) -> Problem:
        """That system with its runs."""
        return self.simulator.problem

    def judge(self, which: str, raw: Problem, fitted: Fitted) -> None:
        """Keep the residuals of a model.

        Args:
            which: `before` or `after`.
            raw: the system that was diagnosed, as declared.
            fitted: the model.

        Raises:
            CosimError: an effect does not fit, or the other system cannot be simulated.
        """
        problem = carried(self.problem, raw, fitted)
        model, theta = self.simulator.of(problem), problem.nominal
        if late_estimated(fitted.problem) and problem.late:
            model, theta, _ = released(model, theta)
        else:
            known = dict(zip(fitted.problem.names, fitted.estimate.theta.tolist(), strict=True))
            for i, name in enumerate(problem.names):
                theta[i] = known.get(name, theta[i])
            seen = {run.name for run in fitted.problem.runs}
            others = [run.name for run in problem.runs if run.name not in seen]
            theta = settled(model, theta, others)
        errors = step_error(model, theta, problem.step)
        for name, residual in model.residuals(theta, None):
            exact = problem.run(name).white(errors[name] / problem.sigma)
            self.residuals[which, name] = residual + exact
        model.close()

    def unseen(self, raw: Problem, which: str) -> list[WhitenessTest]:
        """Channels that only this system has, above their noise and farther than all shared ones.

        What is missing shows in them first, so that it is looked for there; not in what a sensor of
        both systems takes part in (`Channel.by`). Nothing if this system has no runs that a model
        may be fitted to.
        """
        runs = [run for run in self.problem.runs if (which, run.name) in self.residuals]
        if not any(run.purpose == FITTED for run in runs):
            return []
        stack = SampleStack(self.problem, runs)
        tests = whiteness_tests(
            stack.vector([self.residuals[which, run.name] for run in runs]), stack
        )
        shared = {channel.name for channel in raw.channels}
        most = max((t.lasting for t in tests if t.channel in shared), default=0.0)
        beside = {channel.name for channel in self.problem.channels if channel.by in raw.instances}
        own = [t for t in tests if t.channel not in shared | beside and t.structured]
        return sorted((t for t in own if t.lasting > BEYOND * most), key=lambda t: -t.lasting)

    def rms(self, which: str, column: int, run: str | None = None) -> float | None:
        """RMS residual of a channel over sigma, over all runs or in one."""
        rows = [v[:, column] for (kind, name), v in self.residuals.items()
                if kind == which and run in (None, name)]  # fmt: skip
        values = np.concatenate(rows) if rows else np.zeros(0)
        values = values[np.isfinite(values)]
        return float(np.sqrt(np.mean(values**2))) if values.size else None

    def to_dict(self) -> dict[str, object]:
        """As of `cosim diagnose --json`."""
        channels = {}
        for column, channel in enumerate(self.problem.channels):
            row: dict[str, object] = {"unit": channel.unit, "noise_rms": channel.sigma}
            for which in ("before", "after"):
                value = self.rms(which, column)
                row[which] = None if value is None else value * channel.sigma
            channels[channel.name] = row
        return {
            "system": self.problem.file.path.stem,
            "runs": [run.name for run in self.problem.runs],
            "channels": channels,
        }


def looked(raw: Problem, base: Fitted, simulator: Simulator) -> tuple[list[Further], list[str]]:
    """The declared model on the runs of other systems, and why some are not judged.

    Args:
        raw: the system that is diagnosed, as declared.
        base: the declared model, calibrated.
        simulator: of that system; others work as it does, on its budget.
    """
    found, warnings = [], []
    for read in raw.further:
        try:
            problem = read()
            if not problem.runs:
                continue
            wrong = [f for f in passed(check_data(problem), problem.source.allow)
                     if f.run and f.severity == "error"]  # fmt: skip
            if wrong:
                raise ScenarioError("; ".join(map(str, wrong)))
            pool = SessionPool(simulator.budget)
            item = Further(Simulator(problem, workers=simulator.workers, pool=pool))
            item.judge("before", raw, base)
            found.append(item)
        except CosimError as error:  # they are an extra: the verdict stands without them
            warnings.append(f"further runs are not judged: {error}")
        except StoppedError as stopped:  # what is left to do says what there is
            warnings.append(f"further runs are not judged: stopped {stopped}")
    return found, warnings


def carried(problem: Problem, raw: Problem, fitted: Fitted) -> Problem:
    """Another system with the parameters and effects of a fitted one; only values of runs are free.

    Raises:
        VariantError: an instance that carries an effect is not there, or another one, or the effect
            does not fit.
    """
    model = problem.model
    for item in fitted.effects:
        if item.column is not None:
            continue
        if raw.instances[item.instance] != problem.instances.get(item.instance):
            raise VariantError(
                f"{problem.file.path}: {item.label} was found on {item.instance} = "
                f"{raw.instances[item.instance]}, here it is "
                f"{problem.instances.get(item.instance, 'missing')}"
            )
        model = model.changed(item.change)
    values = {n: v for n, v in fitted.problem.constants.items() if n not in raw.constants}
    for p, value in zip(fitted.problem.parameters, fitted.estimate.theta.tolist(), strict=True):
        if not p.run:
            values |= p.set(value)
    changed = problem.changed(
        model=model,
        constants={**problem.constants, **values},
        parameters=[p for p in problem.parameters if p.run],
        shafts=fitted.problem.shafts,
    )
    return changed.changed(runs=[changed.standing(run) for run in changed.runs])
