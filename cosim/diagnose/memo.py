"""The best fit of each set of effects that a search has made: what the verdict is about."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .linear import SampleStack
from .models import Fitted
from .values import Values

Vector = NDArray[np.float64]
SETTLED = 0.2
"""A later fit takes an earlier one's place though it is worse by so much [nats]: thorough fits end
that near their minima (`descent.SETTLED`), and have the better intervals."""
Labels = frozenset[str]


class Memo:
    """Fits by their sets of effects, without derivatives.

    Attributes:
        failed: sets that cannot be simulated.
    """

    def __init__(self) -> None:
        self._fits: dict[Labels, Fitted] = {}
        self.failed: set[Labels] = set()

    def __iter__(self) -> Iterator[Fitted]:
        return iter(self._fits.values())

    @property
    def declared(self) -> Fitted:
        """The fit without effects, which is made before all others."""
        return self._fits[frozenset()]

    def get(self, labels: Labels) -> Fitted | None:
        """The fit of a set, None if there is none."""
        return self._fits.get(labels)

    def note(self, fitted: Fitted, rise: Callable[[Fitted, Fitted], float]) -> None:
        """Keep a fit unless it is worse than the one known by `SETTLED` or more.

        Args:
            fitted: the fit.
            rise: by how much the second of two fits is worse [nats].
        """
        known = self._fits.get(fitted.labels)
        if known is None or rise(known, fitted) < SETTLED:
            self.keep(fitted)

    def keep(self, fitted: Fitted) -> None:
        """Keep a fit whatever was known of its set."""
        slim = replace(fitted.estimate, jacobian=[], residuals=[])
        self._fits[fitted.labels] = replace(fitted, estimate=slim)

    def cut(
        self, before: tuple[SampleStack, SampleStack], after: tuple[SampleStack, SampleStack]
    ) -> None:
        """Let runs end earlier, in the fits as in the data."""
        for labels, fitted in self._fits.items():
            rows = [
                new.vector([
                    row[: run.times.size]
                    for row, run in zip(old.by_run(values), new.runs, strict=True)
                ])
                for old, new, values in zip(before, after, (fitted.fit, fitted.check), strict=True)
            ]  # fmt: skip
            self._fits[labels] = replace(fitted, values=Values(rows[0], rows[1]))
