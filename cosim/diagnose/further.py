"""Runs that need another system: the models that were found are judged there, nothing is fitted.

Runs in which an arm swings, say, on a base that was diagnosed with its arm folded. Parameters and
effects are carried over by the names of instances and variables; start values of the runs are
estimated, as for all unused runs.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..calibrate.nuisance import late_estimated, released, settled
from ..calibrate.problem import Problem
from ..calibrate.simulator import Simulator
from ..errors import VariantError
from .models import Fitted

Vector = NDArray[np.float64]


@dataclass
class Further:
    """Models on runs of another system.

    Attributes:
        problem: that system with its runs.
        residuals: (`before`/`after`, run) -> residuals over sigma.
    """

    problem: Problem
    residuals: dict[tuple[str, str], Vector] = field(default_factory=dict)

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


def judged(simulator: Simulator, raw: Problem, before: Fitted, after: Fitted) -> Further:
    """Residuals of two models in the runs of another system.

    Args:
        simulator: of that system with its runs.
        raw: the system that was diagnosed, as declared.
        before, after: without and with what was found.

    Raises:
        CosimError: an effect does not fit, or the other system cannot be simulated.
    """
    found = Further(simulator.problem)
    for which, fitted in (("before", before), ("after", after)):
        if which == "after" and after is before:
            found.residuals |= {
                ("after", name): v for (_, name), v in list(found.residuals.items())
            }
            break
        problem = carried(simulator.problem, raw, fitted)
        model, theta = simulator.of(problem), problem.nominal
        if late_estimated(fitted.problem) and problem.late:
            model, theta, _ = released(model, theta)
        else:
            theta = settled(model, theta, [run.name for run in problem.runs])
        for name, residual in model.residuals(theta, None):
            found.residuals[which, name] = residual
        model.close()
    return found


def carried(problem: Problem, raw: Problem, fitted: Fitted) -> Problem:
    """Another system with the parameters and effects of a fitted one; only values of runs are free.

    Raises:
        VariantError: an instance that carries an effect is not there, or another one, or the effect
            does not fit.
    """
    model = problem.model
    for item in fitted.effects:
        if item.shift is not None:
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
