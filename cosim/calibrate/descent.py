"""Levenberg-Marquardt and Gauss-Newton steps of a bounded weighted least-squares fit.

Parameters are scaled by their spans, so that combinations that the runs cannot tell apart stay
where they began. Limits whose integrators stop tick by tick make the cost stepwise: the Jacobian is
taken over wide steps first, and along main directions at last (`felt`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from ..errors import FmuCallError
from .differences import UNEVEN, jacobian, unevenness
from .felt import SHORTEST, felt
from .known import STEP, Known
from .loss import Loss, Squares
from .making_up import walk
from .normal import BOUNDS, Normal, cost_of, drawn, gradient
from .products import pairs, stepped
from .simulator import Simulator

Vector = NDArray[np.float64]
STEPS = (2e-2, STEP, 1e-2)
"""Steps of differences over the span, from the first iterations to the last."""
REUSED = 0.02
"""A Jacobian is used again after a step that lowered the cost by this fraction."""
CORRECTIONS = 4
"""Steps at most with the Jacobian of a point that is close."""
TURNS = 3
"""Times that derivatives are taken along main directions: jumps turn these less each time, and
after three what they claim on nothing has fallen from 1e5 to what longer steps do not show."""
RENEWALS, DRAFTED = 5, 3
"""Jacobians that a fit from close by takes at most, and that a draft takes."""
FIRM = 1e-9
"""Damping of a Gauss-Newton step, relative to the information, with which a quick fit begins."""
PARTS = (0.3, 0.1)
"""Shares of a step that are tried where the whole step is none."""
RESTORED = 3
"""Steps after a step that has left a curved valley, to come back to its floor."""
SHORTER = 8
"""Times a step is damped by 30 more until it is given up: from Gauss-Newton to steepest descent."""
SETTLED = 0.2
"""Fall of the cost [nats] below which a quick fit ends: far below what is decided on it."""
KEPT = 0.25
"""Share of what a quadratic promises that steps must keep: below, trust regions call it poor."""
SHRUNK, VALLEY = 0.1, 15
"""Factor on the steps of differences where a quadratic is poor, down to the shortest, and the
Jacobians from then on."""
LOWER = 1.0
"""Fall of the cost [nats] from which a point that was met on another errand is worth going to: the
data prefer it by a factor of e, and fits end that near to their minima."""
EVEN, ROUGHLY = 1e-3, 1e-2
"""Share of the cost beyond the noise's below which a fall is none: the model is that far off. The
second for drafts."""


LEFT = 0.5
"""Share of the information on a direction that must be left of it where both sides disagree, or
all is differentiated anew: over steps that are felt, a bend is less, a jump is not. What a bend
takes off may be little of each parameter, and still more than what the others do not make up for.
"""


class Descent:
    """A point on its way to the minimum, with what was simulated there last."""

    _met: tuple[Vector, list[tuple[str, Vector]], float] | None = None

    def __init__(
        self,
        simulator: Simulator,
        purpose: str | Iterable[str],
        theta: Vector,
        begun: int | None = None,
    ) -> None:
        self.simulator = simulator
        self.problem = problem = simulator.problem
        self.purpose = purpose if isinstance(purpose, str) else list(purpose)
        self.theta = np.clip(theta, problem.lower, problem.upper)
        self.loss: Loss = Squares()
        self.uneven = False
        self.promised = math.inf
        self.unkept, self.valley = 0.0, False
        self.damping, self.length = FIRM, STEPS[-1]
        self.begun = simulator.evaluations if begun is None else begun
        self.refused: tuple[Vector, str] | None = None
        self.drawn = drawn(problem)
        self.products, self.straight = pairs(problem), np.zeros(self.theta.size)
        self.residuals = simulator.residuals(self.theta, self.purpose)
        self.cost = self.total(self.theta, self.residuals)

    def total(self, theta: Vector, residuals: list[tuple[str, Vector]]) -> float:
        """Cost with the bounds as a weak prior, which decides where the data are silent."""
        p = self.problem
        away = ((theta - p.nominal) / p.scale)[self.drawn]
        return cost_of(p, theta, residuals, self.loss) + 0.5 * BOUNDS * float(away @ away)

    def count(self, loss: Loss) -> None:
        """Count residuals in another way from here on."""
        self.loss = loss
        self.cost = self.total(self.theta, self.residuals)

    def normal(self, relative: float, central: bool) -> Normal:
        """Normal equations here, from differences with steps of this share of the spans."""
        self.jacobian = jacobian(
            self.simulator, self.theta, self.purpose, central=central, relative=relative
        )
        normal = Normal(self.problem, self.theta, self.jacobian, self.residuals, self.loss)
        self.uneven = bool(normal.rough)
        return self._felt(set(normal.rough)) if self.uneven else normal

    def _felt(self, rough: set[str]) -> Normal:
        """Normal equations with the derivatives of runs that jump over steps that they feel."""
        self.jacobian = felt(self.simulator, self.theta, self.jacobian, rough)
        return Normal(self.problem, self.theta, self.jacobian, self.residuals, self.loss)

    def smooth(self) -> None:
        """Last steps, with derivatives in which jumps are little; long ones have led here."""
        p = self.problem
        if p.unstable:  # rough at any step
            return
        self.uneven |= any(unevenness(p, item) > UNEVEN for item in self.jacobian)
        if not self.uneven:
            normal = Normal(p, self.theta, self.jacobian, self.residuals, self.loss)
            if normal.left > LEFT:
                return
        everything = {item.run for item in self.jacobian}  # jumps that few see count, too
        for _ in range(TURNS):
            normal = self._felt(everything)
        self.settle(normal, CORRECTIONS)

    @property
    def jumps(self) -> bool:
        """Whether limits make the model jump; bends of products, too, differ on both sides."""
        return self.uneven and not self.products

    def attempt(self, theta: Vector) -> bool:
        """Go there, inside the bounds, if it is better."""
        theta = np.clip(theta, self.problem.lower, self.problem.upper)  # sums round past them
        return not np.array_equal(theta, self.theta) and self._went(theta, self._seen(theta))

    def _seen(self, theta: Vector) -> tuple[list[tuple[str, Vector]], float] | None:
        """Residuals and cost at a point, None if it cannot be simulated."""
        try:
            residuals = self.simulator.residuals(theta, self.purpose)
        except FmuCallError as error:
            self.refused = theta, str(error)
            return None
        return residuals, self.total(theta, residuals)

    def _went(self, theta: Vector, seen: tuple[list[tuple[str, Vector]], float] | None) -> bool:
        """Go to a point that has been seen, if it is better."""
        if seen is None or not seen[1] < self.cost:
            return False
        self.theta, (self.residuals, self.cost) = theta, seen
        self.refused = None
        return True

    def meet(self, theta: Vector, residuals: list[tuple[str, Vector]], cost: float) -> None:
        """Note a point that was simulated on another errand, for `lowered`."""
        if cost < (self.cost - LOWER if self._met is None else self._met[2]):
            self._met = theta, residuals, cost

    def lowered(self) -> bool:
        """Go to the lowest point that was met, if it is lower than here."""
        met, self._met = self._met, None
        if met is None or not met[2] < self.cost:  # the fit may have gone lower since
            return False
        self.theta, self.residuals, self.cost = met
        return True

    def restored(self, normal: Normal, theta: Vector, damping: float) -> bool:
        """Go there if it is better, or to where further steps with the same derivatives lead.

        A step along a curved valley ends on its slope, which costs more than was gained; the
        derivatives across it are good enough to come back down. Elsewhere no step is made good.
        """
        p, promised, before = self.problem, self.promised, math.inf
        for _ in range(1 + RESTORED if self.valley else 1):
            seen = self._seen(theta)
            if self._went(theta, seen):
                return True
            if seen is None or not seen[1] < before:
                break
            residuals, before = seen
            slope = gradient(p, theta, self.jacobian, residuals, self.loss)
            theta = self.step(normal, damping, theta, slope)
        self.promised = promised
        return False

    def step(
        self,
        normal: Normal,
        damping: float,
        theta: Vector | None = None,
        gradient: Vector | None = None,
    ) -> Vector:
        """Damped Gauss-Newton step inside the bounds; `promised` says what it should gain.

        It goes to the minimum of the quadratic within the bounds: cutting off parameters that would
        leave them spoils the step along collinear ones.

        Args:
            normal: equations.
            damping: relative to the mean information on a parameter.
            theta, gradient: another point and the gradient there, if it is not that of `normal`.
        """
        p = self.problem
        theta = self.theta if theta is None else theta
        gradient = normal.gradient if gradient is None else gradient
        size = theta.size
        whole = normal.matrix + np.diag(BOUNDS * self.drawn)
        gradient = gradient - BOUNDS * self.drawn * (theta - p.nominal) / p.scale
        ridge = damping * np.trace(whole) / size + 1e-9
        values, vectors = np.linalg.eigh(whole)
        # information taken off for jumps may leave a direction with none at all
        root = np.sqrt(np.maximum(values, 0.0) + ridge)
        along = (vectors.T @ gradient) / root
        change = vectors @ (along / root)
        low, high = (p.lower - theta) / p.scale, (p.upper - theta) / p.scale
        if np.any(change < low) or np.any(change > high):
            matrix = root[:, None] * vectors.T
            change = lsq_linear(matrix, along, (low, high), method="bvls").x
        self.promised = float(gradient @ change - 0.5 * change @ whole @ change)
        self.straight = change * p.scale
        found = stepped(theta, self.straight, self.products)
        return np.asarray(np.clip(found, p.lower, p.upper))

    def descend(self, relative: float, limit: int, tolerance: float) -> None:
        """Levenberg-Marquardt until the cost no longer falls by `tolerance` of it.

        A Jacobian costs as many simulations as there are parameters, a step one; so a Jacobian is
        used again as long as steps with it pay.
        """
        damping = 1e-6
        for _ in range(limit):
            normal = self.normal(relative, central=False)
            first = self.cost
            for _ in range(8):
                if self.attempt(self.step(normal, damping)):
                    damping = max(damping * 0.1, 1e-12)
                    break
                damping = max(damping, 1e-9) * 10.0
            else:
                return
            before = first
            while before - self.cost > REUSED * before:
                before = self.cost
                normal.gradient = self.gradient()
                if not self.attempt(self.step(normal, damping)):
                    break
            if first - self.cost <= tolerance * max(first, 1.0):
                return

    def follow(self, known: Known, limit: int, share: float) -> None:
        """Gauss-Newton with a Jacobian from close by; only what it lacks is differentiated.

        Parameters that were there before hardly change what they do when one is added, so a step
        costs one simulation and one for each new parameter.
        """
        damping = FIRM
        for _ in range(limit):
            self.jacobian = known.extended(self.simulator, self.theta, self.purpose)
            normal = Normal(self.problem, self.theta, self.jacobian, self.residuals, self.loss)
            before = self.cost
            settled = self.settle(normal, 1, damping)
            fall = before - self.cost
            self.unkept = 0.0 if settled else max(self.promised - fall, 0.0)
            if settled or fall <= self.enough(share):
                return
            damping = max(0.1 * self.damping, FIRM)

    def enough(self, share: float) -> float:
        """Fall of the cost below which a fit ends: a share of what is left beyond the noise."""
        noise = 0.5 * float(sum(np.isfinite(r).sum() for _, r in self.residuals))
        return max(SETTLED, share * (self.cost - noise))

    def gradient(self) -> Vector:
        """J^T r with the last Jacobian and the present residuals."""
        return gradient(self.problem, self.theta, self.jacobian, self.residuals, self.loss)

    def settle(self, normal: Normal, limit: int, damping: float = FIRM) -> bool:
        """Damped steps with one Jacobian; whether they came to where it promises no more."""
        for _ in range(limit):
            self.damping = damping
            whole = self.step(normal, damping)
            straight = self.straight
            if abs(self.promised) < SETTLED:
                return True
            # a limit or a threshold is passed: the direction is right, but not so far
            if not (self.restored(normal, whole, damping) or any(
                self.attempt(stepped(self.theta, part * straight, self.products)) for part in PARTS
            )):  # fmt: skip
                for _ in range(SHORTER):
                    damping = self.damping = max(damping, 1e-7) * 30.0
                    if self.attempt(self.step(normal, damping)):
                        break
                else:
                    return False
            damping = max(damping * 0.1, 1e-12)
            normal.gradient = self.gradient()
        return False

    def walked(self, normal: Normal) -> float:
        """Go along the valley to which a hardly damped step points; by how much the cost fell."""
        before, normal.gradient = self.cost, self.gradient()
        walk(self, self.step(normal, FIRM) - self.theta)
        return before - self.cost

    def correct(self, *, draft: bool = False, goal: float = math.inf) -> Normal:
        """Steps with a Jacobian taken here, and with another one as long as they lead far.

        Where steps keep little of what the quadratic promises, or more than so many of them can,
        differences were too long for what many parameters undo of each other: they are taken again,
        shorter. In the valley in which that happens, more Jacobians are needed; where the second is
        no better, the valley is bent, and is walked.

        Args:
            draft: only to be compared: one-sided differences, and fewer of them.
            goal: cost [nats] from which it is of use; where derivatives promise less, it is left.
        """
        left = DRAFTED if draft else RENEWALS
        if self.jumps:  # over short steps its derivatives say more than there is
            self.length = STEPS[-1]
        while True:
            before, left = self.cost, left - 1
            normal = self.normal(self.length, central=not draft)
            bent = not (draft or self.jumps or self.problem.unstable)
            self.step(normal, FIRM)
            promised = self.promised
            # where it jumps, information is taken off, and too little is promised
            if not self.uneven and self.cost - CORRECTIONS * promised > goal:
                break
            settled = self.settle(normal, CORRECTIONS)
            # more damped, any step promises nothing
            if settled and (self.damping <= FIRM or not bent):
                break
            fall, enough = before - self.cost, self.enough(ROUGHLY if draft else EVEN)
            if bent:
                poor = not KEPT * promised < fall < CORRECTIONS * promised
                poor &= max(fall, promised) >= enough
            else:
                poor = fall == 0.0 and not (draft or self.problem.unstable)
            if poor and bent and self.valley and left and self.walked(normal) > enough:
                continue
            if poor and self.length > SHORTEST:
                self.length, left, self.valley = SHRUNK * self.length, VALLEY, True
            elif fall < enough or not left:
                break
        return normal
