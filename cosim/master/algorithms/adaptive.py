"""Adaptive: Jacobi with steps whose error is controlled by repeating them.

Every step is gone at once and in two halves. The difference estimates the error of the halves,
which are kept:

    e = max_i |y_i(h/2, h/2) - y_i(h)| / (tolerance max(|y_i|, nominal_i))

A second measure is the energy that the coupling invented in the step, the sum over a power bond of
what both ends say they took, relative to what went over it. A step is accepted if neither is above
its tolerance; the next one is 0.9 e^(-1/2) as long. The communication step is the raster of
recorded values. Those inside a longer step are interpolated, and what that leaves is kept within
the tolerance, too (`between_points`): where recorded values need it, steps go from one
communication point to the next, but are never shorter for them. A step never goes over a change
of an external input. An FMU that fails in a step, discards it or asks to end the run may do so
because the step is too long for what it is connected to: the step is taken back and made
shorter, and the failure counts where even the shortest one has it. Needs FMUs that can return
to a saved state.

Options:
    tolerance: relative error of one step, in connected and in recorded values.
    energy: relative energy that the coupling may invent in one step.
    longest: longest step [s]; 100 communication steps if not given.

Source: Schierz, Arnold and Clauß, Co-simulation with communication step size control in an
FMI-compatible master algorithm, 2012; Sadjina et al., Energy conservation and power bonds in
co-simulations, 2017.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import AlgebraicLoopError, FmuCallError
from ...system.system import System
from ..algebraic_loops import consistent, find_loops
from ..between_points import BetweenPoints, Moment
from ..extrapolation import smooth
from ..interpreter import Interpreter
from ..kernel.programs import Programs
from ..options import positive, refuse_without_states
from ..plan import Op, Plan, final_operations, initial_sweep, lay_out, operations
from ..rollback import Checkpoint

Vector = NDArray[np.float64]
SHORTEST = 1e-6
"""Shortest step, relative to the communication step."""
FRESH, STEP = 0, 1
"""Programs: connected values brought up to date; a step of all instances."""
ROUNDING = 1e-6
"""Part of a step that is not left over for a step of its own."""
RESOLVED = 8
"""Units in the last place of the time that a step has at least: its middle is rounded to one."""
SLACK = 1e-9
"""Part of a communication step by which two instants may differ and be the same."""


@dataclass(frozen=True)
class Settings:
    """What controls the steps.

    Attributes:
        tolerance: relative error of one step.
        smooth: per copy, whether its values are continuous in time.
        energy: energy that the coupling may invent in a step, relative to what it passes on.
        longest: longest step [s]; None: 100 communication steps.
    """

    tolerance: float
    smooth: NDArray[np.bool_]
    energy: float
    longest: float | None


def compile_plan(
    system: System,
    external: Sequence[str],
    observed: Sequence[str],
    *,
    tolerance: float = 1e-4,
    energy: float = 0.1,
    longest: float | None = None,
) -> Plan:
    """Compile a system."""
    refuse_without_states(system, "adaptive", variable=True)
    layout = lay_out(system, external, observed)
    loops = find_loops(system, layout)
    fresh = consistent(system, layout, loops, only_loops=False)
    everyone = range(len(layout.instances))
    step = [
        (Op.COPY, 0, len(layout.copy_source)),
        *[(op, index) for op in (Op.SET, Op.STEP, Op.GET) for index in everyone],
    ]
    return Plan(
        layout,
        initial_sweep(system, layout),
        operations(step),
        final_operations(fresh),
        tuple(loop for _, loop in loops),
        operations(fresh),
        stepper=partial(
            StepControl,
            settings=Settings(
                positive("tolerance", tolerance),
                smooth(system, layout),
                positive("energy", energy),
                None if longest is None else positive("longest", longest),
            ),
        ),
    )


class StepControl:
    """A `plan.Stepper` that goes through the communication points in steps of its own.

    Args:
        run: what steps.
        settings: tolerances.

    Attributes:
        taken, rejected: steps.
        shortest, longest: of those taken [s].
    """

    looks_ahead = True

    def __init__(self, run: Interpreter, settings: Settings) -> None:
        self.run, self.settings = run, settings
        layout = run.layout
        self.raster = run.step
        self.limit = settings.longest or 100.0 * self.raster
        self.programs = Programs(run, run.plan.solving, run.plan.step)
        self.sources = np.unique(layout.copy_source[settings.smooth])
        self.nominal = np.array([self._nominal(layout.names[slot]) for slot in self.sources])
        held = np.unique(layout.copy_source[~settings.smooth])
        self.between = BetweenPoints(run.system, layout, held, settings.tolerance)
        self.restart()

    def restart(self) -> None:
        """Begin anew."""
        self.time, self.size = float(self.run.times[0]), min(self.raster, self.limit)
        self.between.forget()
        self.taken = self.rejected = 0
        self.shortest, self.longest = np.inf, 0.0
        layout = self.run.layout
        # what counts as some power: nominal effort times nominal flow, then the largest seen
        self.power = np.zeros(len(layout.bonds))
        for bond, first, second in zip(
            layout.bond_index, layout.bond_output, layout.bond_input, strict=True
        ):
            nominal = self._nominal(layout.names[first]) * self._nominal(layout.names[second])
            self.power[bond] += 0.5 * nominal

    def _nominal(self, full: str) -> float:
        return abs(self.run.system.declaration(full).nominal or 1.0)

    def save(self) -> dict[str, Any]:
        """Where it stands, and its step size."""
        kept = ("time", "size", "taken", "rejected", "shortest", "longest", "power")
        return {name: getattr(self, name) for name in kept} | {"past": self.between.memory}

    def restore(self, memory: dict[str, Any]) -> None:
        """Return to them."""
        self.between.memory = memory["past"]
        vars(self).update({name: item for name, item in memory.items() if name != "past"})

    def advance(self, last: int) -> None:
        """Go on up to a communication point."""
        run = self.run
        if run.index == 0 and run.row == 0:
            self.arrive(0)
        while run.index < last:
            size = min(self.size, self.limit)
            change = self._next_change()
            rest = float(run.times[change]) - self.time
            if 0.5 * rest < size < self._less(rest):
                size = 0.5 * rest  # two steps of like length instead of a long and a short one
            # what goes beyond a communication point ends at one: the last within reach
            within = int((self.time + size - float(run.times[0])) / self.raster + ROUNDING)
            point = min(max(within, run.index + 1), change)
            rest = float(run.times[point]) - self.time
            whole = size >= self._less(rest)
            self._step(rest if whole else size, point if whole else None)

    def _less(self, rest: float) -> float:
        """What counts as all of the rest [s]: times round, those since 1970 to 0.2 us."""
        return rest * (1.0 - ROUNDING) - RESOLVED * math.ulp(self.time)

    def _least(self) -> float:
        """The shortest step [s]."""
        return max(SHORTEST * self.raster, RESOLVED * math.ulp(self.time))

    def _next_change(self) -> int:
        """The first communication point ahead at which external inputs change, or the last."""
        run = self.run
        end = run.times.size - 1
        later = run.external[run.index + 1 : end] != run.external[run.index]
        changed = later.any(axis=1)
        for items in run.outline.objects.values():
            ahead = np.array(items[run.index + 1 : end], dtype=object)
            changed |= ahead != items[run.index]
        found = np.flatnonzero(changed)
        return run.index + 1 + int(found[0]) if found.size else end

    def go(self, time: float, size: float) -> tuple[Vector, Vector]:
        """A step of all instances; energy into both ends of each bond, and what went over it."""
        run, layout = self.run, self.run.layout
        before = run.values[layout.bond_output].copy()
        self.programs.do(STEP, time, run.size(time, size))
        inputs = run.values[layout.bond_input]
        terms = layout.bond_sign * inputs * (before + run.values[layout.bond_output]) * 0.5 * size
        energy, passed = np.zeros(len(layout.bonds)), np.zeros(len(layout.bonds))
        np.add.at(energy, layout.bond_index, terms)
        np.add.at(passed, layout.bond_index, 0.5 * np.abs(terms))
        self.programs.do(FRESH, time + size)
        return energy, passed

    def _step(self, size: float, target: int | None) -> None:
        """Try a step; `target` is the communication point at its end, if there is one."""
        run = self.run
        begin = self._now()
        time, half = self.time, 0.5 * size
        with self.programs.saved() as before:
            try:
                self.go(time, size)
                whole = run.values.copy()
                self.programs.restore(before)
                first, passed = self.go(time, half)
                middle = self._now()
                second, also = self.go(time + half, half)
            except (FmuCallError, AlgebraicLoopError):
                dead = any(instance.dead for instance in run.instances)
                if dead or size <= self._least():
                    raise
                self._reject(before, 0.2 * size)
                return
            error = self._error(begin.values, whole, first + second, passed + also, size)
            beside = self.between.error(begin, middle, self._now(), whole, time, size)
            refined = target is None or target == run.index + 1  # no communication point inside
            if not (error <= 1.0 and (beside <= 1.0 or refined)):
                if size <= self._least():
                    raise FmuCallError(
                        f"{run.system.name}: at t = {time:.9g} s even a step of "
                        f"{size:.3g} s misses the tolerance {self.settings.tolerance:g} of the "
                        f"step control ({self._worst(begin.values, whole)})"
                    )
                self._reject(before, self._next(size, error, beside))
                return
        self.taken += 1
        self.shortest, self.longest = min(self.shortest, size), max(self.longest, size)
        run.bond_energy += first + second
        run.bond_turnover += passed + also
        self.power = np.maximum(self.power, (passed + also) / size)
        self.size = self._next(size, error, beside)
        self.time = time + size if target is None else float(run.times[target])
        self._between(begin, middle, time, size, target)
        self.between.keep(time + half, middle)
        if target is not None:
            self.arrive(target)

    def _reject(self, before: Checkpoint, size: float) -> None:
        """Take a step back; the next one is as long as `size` [s]."""
        self.rejected += 1
        self.programs.restore(before)
        self.size = size

    def _now(self) -> Moment:
        return Moment(self.run.values.copy(), self.run.objects.copy())

    def _next(self, size: float, error: float, beside: float) -> float:
        """The next step's size: what coupling asks for, and for recorded values the raster."""

        def asked(error: float) -> float:
            if not np.isfinite(error):
                return 0.2 * size
            return size * float(np.clip(0.9 * max(error, 1e-6) ** -0.5, 0.2, 3.0))

        return min(asked(error), max(asked(beside), self.raster))

    def _error(
        self, begin: Vector, whole: Vector, energy: Vector, passed: Vector, size: float
    ) -> float:
        """Error of a step, 1 at the tolerance."""
        settings, now = self.settings, self.run.values[self.sources]
        scale = np.maximum(np.maximum(np.abs(begin[self.sources]), np.abs(now)), self.nominal)
        local = np.abs(now - whole[self.sources]) / (settings.tolerance * scale)
        reference = np.maximum(passed, self.power * size)
        invented = np.abs(energy) / np.maximum(settings.energy * reference, 1e-300)
        everything = np.concatenate([local, np.where(reference > 0.0, invented, 0.0), [0.0]])
        return float(np.max(everything)) if np.isfinite(everything).all() else np.inf

    def _worst(self, begin: Vector, whole: Vector) -> str:
        now = self.run.values[self.sources]
        difference = np.abs(now - whole[self.sources]) / np.maximum(
            np.abs(begin[self.sources]), self.nominal
        )
        if not difference.size:
            return "energy of a power bond"
        worst = int(np.argmax(np.where(np.isfinite(difference), difference, np.inf)))
        return f"worst: {self.run.layout.names[int(self.sources[worst])]}"

    def _between(
        self, begin: Moment, middle: Moment, time: float, size: float, target: int | None
    ) -> None:
        """Recorded values at the communication points inside a step."""
        run = self.run
        end = self._now()
        last = run.times.size if target is None else target
        slack = SLACK * self.raster
        while run.index + 1 < last and run.times[run.index + 1] <= self.time + slack:
            run.index += 1
            x = (float(run.times[run.index]) - time) / size
            self._keep(self.between.values(begin, middle, end, x))

    def arrive(self, index: int) -> None:
        """Stand at a communication point: external inputs change, values are recorded."""
        run = self.run
        run.index = index
        if index and (run.external[index] != run.external[index - 1]).any():
            self.between.forget()
        run.do(Op.EXTERNAL, 0, 0)
        self.programs.do(FRESH, float(run.times[index]))
        if index < run.times.size - 1:  # the last one is recorded by the operations of the end
            self._keep(run.values[run.layout.record_source])

    def _keep(self, values: Vector) -> None:
        run, layout = self.run, self.run.layout
        if run.index % run.every == 0:
            run.keep(values * layout.record_gain + layout.record_offset)

    def steps(self) -> int:
        """Steps of the whole system that were made: each is gone at once and in two halves."""
        return 3 * (self.taken + self.rejected)

    def report(self) -> Mapping[str, Any]:
        """What it did."""
        control = {
            "taken": self.taken,
            "rejected": self.rejected,
            "shortest_s": self.shortest if self.taken else 0.0,
            "longest_s": self.longest,
        }
        self.programs.report()
        return {"step_control": control}
