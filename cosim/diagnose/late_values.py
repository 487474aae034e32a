"""Fits of models whose runs begin with values that matter only once an effect is known."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..calibrate.deferred import corrected
from ..calibrate.estimate import Estimate
from ..calibrate.fit import CORRECTION, DRAFT, POLISH, fit
from ..calibrate.nuisance import late_estimated, released
from ..calibrate.simulator import Simulator
from ..calibrate.staged import jointly, staged
from ..errors import CosimError, FmuCallError
from .fitter import Fitter
from .models import Fitted
from .secant import patience
from .unstable import ended
from .whiteness import structured, whiteness_tests

Vector = NDArray[np.float64]
RELEASES, PAYS = 4, 0.01
"""Times at most that late values and all others are estimated in turn, and the share of what a
model leaves beyond noise that another turn must remove."""
WORTH = 0.05
"""Late values are kept if they remove this share of what a model leaves beyond noise."""


class LateValueFitter(Fitter):
    """Fits models with late values (start angles of casters)."""

    _settled: Estimate | None = None
    """Fit whose late values have been estimated: once more would bring as little."""

    def released(self, winner: Fitted, base: Fitted) -> Fitted:
        """The model with late values of the runs (start angles of casters) estimated, if it helps.

        The effect may be what makes them matter: dry friction keeps casters where they were.
        """
        if not self.raw.late or winner.estimate is self._settled:
            return winner
        least = PAYS if late_estimated(winner.problem) else WORTH
        for _ in range(RELEASES):
            if not self.lacking(winner):
                break
            theta = winner.estimate.theta
            beyond = winner.estimate.robust - 0.5 * winner.estimate.count
            try:
                simulator = corrected(winner.simulator, theta, self.raw)
                simulator = simulator.limited(patience(winner.simulator))
                simulator, values, fall = released(simulator, theta)
                if fall < least * beyond:
                    break
                self.say(f"start values of the runs estimated: {fall:.0f} nats")
                if not late_estimated(winner.problem):
                    simulator, values = staged(simulator, values)
                found = self._with_late(simulator, values)
            except CosimError as error:
                self.say(f"start values of the runs could not be estimated: {error}")
                break
            gain = self.gain(winner, found)
            if gain > 0.0:
                self.say(f"fitted with them: {gain:.0f} nats")
            else:  # where runs are unstable a joint step may lose what start values had gained
                found = self.fitted(simulator, values, winner.estimate)
                gain = self.gain(winner, found)
                if gain <= 0.0:
                    break
                self.say(f"with them and hardly another change: {gain:.0f} nats")
            winner = self.again(found, winner, base)
            if gain < PAYS * beyond:
                break
            least = PAYS
        winner = self._unused_late(winner, base)
        self._settled = winner.estimate
        return winner

    def _unused_late(self, winner: Fitted, base: Fitted) -> Fitted:
        """The model with late values of unused runs as its own parameters want them.

        Turns end when fitted runs are at the noise, or want no other values; those of unused runs
        are then as the model before wanted them. A start value that is off by little shows in slow
        parts first.
        """
        left = whiteness_tests(self.check_data - winner.check, self.checking)
        more = any(t.structured or structured(t.slow, len(left) * t.p_value) for t in left)
        if not self.unused or self.lacking(winner) or not more:
            return winner
        theta = winner.estimate.theta
        try:
            simulator = corrected(winner.simulator, theta, self.raw)
            moved = released(simulator, theta)[0].problem
            problem = simulator.problem
            runs = [r if r.purpose == "identification" else moved.run(r.name) for r in problem.runs]
            simulator = simulator.of(problem.changed(runs=runs))
            found = self.judged(fit(simulator, theta, effort=CORRECTION))
        except CosimError as error:
            self.say(f"start values of unused runs could not be estimated: {error}")
            return winner
        if self.gains(winner, found)[1] <= 0.0:
            return winner
        self.say("start values of unused runs estimated")
        return self.again(found, winner, base)

    def _with_late(self, simulator: Simulator, theta: Vector) -> Fitted:
        """A model fitted together with late values; beside them, if that cannot be simulated."""
        try:
            held, values, known = jointly(simulator, theta)
        except FmuCallError as error:
            self.say(f"start values of the runs are held: {error}")
            return self.judged(fit(simulator, theta, effort=DRAFT))
        return self.judged(fit(held, values, known=known))

    def recalled(self, known: Fitted, base: Fitted) -> Fitted:
        """A fit of the memo with derivatives again; thorough, if its model can be simulated so.

        Args:
            known: what the memo has.
            base: what its gain counts from.
        """
        found = self.sharpened(known, base)
        return self.cut(known) if found is known else found

    def cut(self, fitted: Fitted) -> Fitted:
        """A model judged by runs that end where they do now."""
        sizes = {run.name: run.times.size for run in self.raw.runs}
        simulator = fitted.simulator.of(ended(fitted.problem, sizes))
        found = self.judged(fit(simulator, fitted.estimate.theta, effort=POLISH))
        found.effects, found.signature = fitted.effects, fitted.signature
        return found

    def shortened(self, fitted: Fitted, sizes: Mapping[str, int]) -> Fitted:
        """Judge by runs that end after so many samples from now on.

        Args:
            fitted: a model; it is fitted again where the rest holds more than noise.
            sizes: samples by run.

        Returns:
            The model, judged by the rest.
        """
        before = self.fitting, self.checking
        self._measured(ended(self.raw, sizes))
        self.declared = ended(self.declared, sizes)
        self.memo.cut(before, (self.fitting, self.checking))
        self._own = None
        found = self.cut(fitted)
        if self.lacking(found):
            found = self.judged(fit(found.simulator, fitted.estimate.theta, effort=CORRECTION))
        found.effects, found.signature = fitted.effects, fitted.signature
        found.gate = fitted.gate
        self.note(found)
        return found
