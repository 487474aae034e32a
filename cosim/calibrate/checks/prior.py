"""Parameters that a fit takes far from what is said to be known of them beforehand."""

from __future__ import annotations

from collections.abc import Iterator

from ..estimate import Estimate
from .finding import Finding, quantity

FAR = 4.0
"""Deviations of a prior that are more than chance: one value in 16000 is as far off."""


def check_priors(estimate: Estimate) -> Iterator[Finding]:
    """Declared parameters that ended farther from their nominal values than priors let expect."""
    problem = estimate.problem
    for p, value in zip(problem.parameters, estimate.theta.tolist(), strict=True):
        if p.role != "declared" or not p.prior:
            continue
        off = abs(value - p.nominal) / p.prior
        if off > FAR:
            text = (
                f"{p.name} ended at {quantity(value, p.unit)}, {off:.3g} deviations of its prior "
                f"from {quantity(p.nominal, p.unit)}: the data contradict what is said to be "
                f"known; the model lacks something, or the prior of {quantity(p.prior, p.unit)} "
                "is too narrow"
            )
            yield Finding("warning", "prior", "", "", text)
