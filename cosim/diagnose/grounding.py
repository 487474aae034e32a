"""Fits at the rig's own step, where what a coarser one adds to the model is not what was taken off.

What a coarse communication step adds is taken from the data at one point, where a fit begins
(`deferred`). Where runs meet limits or teeth by ticks, it is another one where the fit ends: the
data are right for the beginning only, and derivatives of the coarse model lead elsewhere. Steps at
the rig's own step need no correction.
"""

from __future__ import annotations

from dataclasses import replace

from ..calibrate.deferred import corrected
from ..calibrate.descent import LOWER
from ..calibrate.fit import CORRECTION, fit
from ..errors import CosimError
from .fitter import Fitter
from .models import Fitted, is_open

DRAFTS = 2
"""Drafts at most: where the second one still ends elsewhere, a third does, too."""
TURNS = 2
"""Fits at the rig's own step at most: where the first one leads on, jumps have hidden the rest."""


class GroundedFitter(Fitter):
    """Fits that end at the minimum of the model at the rig's own step."""

    def sharpened(self, quick: Fitted, base: Fitted, *, draft: bool = False) -> Fitted:
        """A quickly fitted model fitted again with derivatives of its own.

        By drafts, until one ends where what the search's step adds is what was taken off, and
        thoroughly from there; at the rig's own step if none does. Where that is the search's, runs
        may turn unstable, or more than noise is left by far, thoroughly at once.
        """
        raw = self.raw
        coarse = raw.ticks and raw.search.step != raw.step
        if draft or not coarse or raw.unstable or is_open(quick.estimate):
            return super().sharpened(quick, base, draft=draft)
        near = quick
        for _ in range(DRAFTS):
            near = super().sharpened(near, base, draft=True)
            if self.astray(near) < LOWER:
                near = super().sharpened(near, base)
                break
        if self.astray(near) < LOWER:
            return near
        for _ in range(TURNS):
            before, near = self._exactly(near), self._grounded(near, base)
            if before - self._exactly(near) < LOWER:
                break
        return near

    def astray(self, fitted: Fitted) -> float:
        """How far the cost that a fit saw at its end is from that at the rig's own step [nats]."""
        rows = dict(fitted.estimate.residuals)
        seen = self.fitting.cost(self.fitting.vector([rows[name] for name in self.fitting.names]))
        return abs(seen - self._exactly(fitted))

    def _exactly(self, fitted: Fitted) -> float:
        return self.fitting.cost(self.fit_data - fitted.fit)

    def _grounded(self, near: Fitted, base: Fitted) -> Fitted:
        """The model fitted at the rig's own step from close by."""
        measured = {run.name: run.data for run in self.raw.runs}
        problem = near.problem.with_data(measured).changed(step=self.raw.step)
        name = near.effects[-1].label
        try:
            simulator = near.simulator.limited({}).of(problem)
            fine = fit(simulator, near.estimate.theta, effort=CORRECTION)
            simulator = corrected(near.simulator, fine.theta, self.raw)
        except CosimError as error:
            self.say(f"{name} could not be fitted at the rig's step: {error}")
            return super().sharpened(near, base)
        self.say(f"{name}: fitted at the rig's own step")
        return self.again(self.judged(replace(fine, simulator=simulator)), near, base)
