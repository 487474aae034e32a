"""Runs that want other parameters than the rest: another machine, or another state of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..normal import Normal
from .finding import Finding

if TYPE_CHECKING:
    from ..estimate import Estimate


def check_machines(estimate: Estimate, share: float = 0.3) -> list[Finding]:
    """Runs that want other parameters than the rest: another machine, or another state of it.

    Args:
        estimate: of all runs together.
        share: of a run's cost that its own parameters must save.
    """
    problem, found = estimate.problem, []
    common = [i for i, p in enumerate(problem.parameters) if not p.run]
    for item, residual in zip(estimate.jacobian, estimate.residuals, strict=True):
        normal = Normal(problem, estimate.theta, [item], [residual])
        matrix = normal.matrix + 1e-6 * max(np.trace(normal.matrix), 1.0) * np.eye(
            len(normal.matrix)
        )
        change = np.linalg.solve(matrix, normal.gradient)
        saved = 2.0 * float(change @ normal.gradient) - float(change @ normal.matrix @ change)
        total = float(np.nansum(residual[1] ** 2))
        excess = total - float(np.isfinite(residual[1]).sum())
        if excess > 0.2 * total and saved > share * total:
            worst = max(common, key=lambda i: abs(float(change[i])))
            parameter = problem.parameters[worst]
            wanted = estimate.theta[worst] + float(change[worst]) * problem.scale[worst]
            text = (
                f"wants other parameters than the rest, {parameter.name} about {wanted:.4g} "
                f"instead of {estimate.theta[worst]:.4g} {parameter.unit}: another machine, or "
                "another state of it"
            )
            found.append(Finding("warning", "machine", item.run, parameter.name, text))
    return found
