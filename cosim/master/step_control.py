"""Steps whose length follows their error: see `algorithms.adaptive`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..errors import FmuCallError
from .iteration import restore, saved
from .plan import Iteration, Op

if TYPE_CHECKING:
    from .execution import Execution

Vector = NDArray[np.float64]
SHORTEST = 1e-6
"""Shortest step, relative to the communication step."""
SLACK = 1e-9
"""Part of a communication step by which two instants may differ and be the same."""


class StepControl:
    """Goes through the raster of communication points in steps of its own.

    Attributes:
        taken, rejected: steps.
        shortest, longest: of those taken [s].
    """

    def __init__(self, run: Execution, settings: Iteration) -> None:
        self.run, self.settings = run, settings
        layout = run.layout
        self.raster = run.master.step
        self.limit = settings.longest or 100.0 * self.raster
        self.sweep = [(Op(int(op)), int(a), int(b)) for op, a, b in run.plan.solving]
        self.step = [(Op(int(op)), int(a), int(b)) for op, a, b in run.plan.step]
        self.sources = np.unique(layout.copy_source[settings.smooth])
        self.nominal = np.array([self._nominal(layout.names[slot]) for slot in self.sources])
        held = set(layout.copy_source[~settings.smooth].tolist()) | set(layout.external.tolist())
        self.interpolated = np.array([slot not in held for slot in layout.record_source.tolist()])
        self.restart()

    def restart(self) -> None:
        """Begin anew."""
        self.time, self.size = float(self.run.times[0]), min(self.raster, self.limit)
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
        instance, _, variable = full.partition(".")
        known = self.run.master.system.members[instance].description.variables
        found = known[variable if variable in known else variable.rpartition("[")[0]]
        return abs(found.nominal or 1.0)

    def advance(self, last: int) -> None:
        """Go on up to a communication point."""
        run = self.run
        if run.index == 0 and run.row == 0:
            self.arrive(0)
        while run.index < last:
            change = self._next_change()
            rest = float(run.times[change]) - self.time
            size = min(self.size, self.limit)
            whole = size >= rest * (1.0 - 1e-6)
            if not whole and size > 0.5 * rest:
                size = 0.5 * rest  # two steps of like length instead of a long and a short one
            self._step(rest if whole else size, change if whole else None)

    def _next_change(self) -> int:
        """The first communication point ahead at which external inputs change, or the last."""
        run = self.run
        end = run.times.size - 1
        later = run.external[run.index + 1 : end] != run.external[run.index]
        found = np.flatnonzero(later.any(axis=1))
        return run.index + 1 + int(found[0]) if found.size else end

    def go(self, time: float, size: float) -> tuple[Vector, Vector]:
        """A step of all instances; energy into both ends of each bond, and what went over it."""
        run, layout = self.run, self.run.layout
        before = run.values[layout.bond_output].copy()
        for op, a, b in self.step:
            if op is Op.STEP:
                run.instances[a].step(time, size)
            else:
                run.do(op, a, b)
        inputs = run.values[layout.bond_input]
        terms = layout.bond_sign * inputs * (before + run.values[layout.bond_output]) * 0.5 * size
        energy, passed = np.zeros(len(layout.bonds)), np.zeros(len(layout.bonds))
        np.add.at(energy, layout.bond_index, terms)
        np.add.at(passed, layout.bond_index, 0.5 * np.abs(terms))
        for op, a, b in self.sweep:
            run.do(op, a, b)
        return energy, passed

    def _step(self, size: float, target: int | None) -> None:
        """Try a step; `target` is the communication point at its end, if there is one."""
        run = self.run
        begin = run.values.copy()
        time, half = self.time, 0.5 * size
        with saved(run) as states:
            self.go(time, size)
            whole = run.values[self.sources].copy()
            restore(run, states)
            run.values[:] = begin
            first, passed = self.go(time, half)
            middle = run.values.copy()
            second, also = self.go(time + half, half)
            error = self._error(begin, whole, first + second, passed + also, size)
            if not error <= 1.0:
                self.rejected += 1
                if size <= SHORTEST * self.raster:
                    raise FmuCallError(
                        f"{run.master.system.name}: at t = {time:.9g} s even a step of "
                        f"{size:.3g} s misses the tolerance {self.settings.tolerance:g} of the "
                        f"step control ({self._worst(begin, whole)})"
                    )
                restore(run, states)
                run.values[:] = begin
                self.size = size * (max(0.2, 0.9 * error**-0.5) if np.isfinite(error) else 0.2)
                return
        self.taken += 1
        self.shortest, self.longest = min(self.shortest, size), max(self.longest, size)
        run.bond_energy += first + second
        self.power = np.maximum(self.power, (passed + also) / size)
        self.size = size * min(3.0, 0.9 * max(error, 1e-6) ** -0.5)
        self.time = time + size if target is None else float(run.times[target])
        self._between(begin, middle, time, size, target)
        if target is not None:
            self.arrive(target)

    def _error(
        self, begin: Vector, whole: Vector, energy: Vector, passed: Vector, size: float
    ) -> float:
        """Error of a step, 1 at the tolerance."""
        settings, now = self.settings, self.run.values[self.sources]
        scale = np.maximum(np.maximum(np.abs(begin[self.sources]), np.abs(now)), self.nominal)
        local = np.abs(now - whole) / (settings.tolerance * scale)
        reference = np.maximum(passed, self.power * size)
        invented = np.abs(energy) / np.maximum(settings.energy * reference, 1e-300)
        everything = np.concatenate([local, np.where(reference > 0.0, invented, 0.0), [0.0]])
        return float(np.max(everything)) if np.isfinite(everything).all() else np.inf

    def _worst(self, begin: Vector, whole: Vector) -> str:
        now = self.run.values[self.sources]
        difference = np.abs(now - whole) / np.maximum(np.abs(begin[self.sources]), self.nominal)
        if not difference.size:
            return "energy of a power bond"
        worst = int(np.argmax(np.where(np.isfinite(difference), difference, np.inf)))
        return f"worst: {self.run.layout.names[int(self.sources[worst])]}"

    def _between(
        self, begin: Vector, middle: Vector, time: float, size: float, target: int | None
    ) -> None:
        """Recorded values at the communication points inside a step."""
        run = self.run
        end = run.values
        last = run.times.size if target is None else target
        slack = SLACK * self.raster
        while run.index + 1 < last and run.times[run.index + 1] <= self.time + slack:
            run.index += 1
            x = (float(run.times[run.index]) - time) / size
            curve = (
                begin * ((2.0 * x - 1.0) * (x - 1.0))
                + middle * (4.0 * x * (1.0 - x))
                + end * (x * (2.0 * x - 1.0))
            )
            held = begin if x < 0.5 else middle if x < 1.0 - 1e-9 else end
            self._keep(curve, held)

    def arrive(self, index: int) -> None:
        """Stand at a communication point: external inputs change, values are recorded."""
        run = self.run
        run.index = index
        run.do(Op.EXTERNAL, 0, 0)
        for op, a, b in self.sweep:
            run.do(op, a, b)
        if index < run.times.size - 1:  # the last one is recorded by the operations of the end
            self._keep(run.values, run.values)

    def _keep(self, smooth: Vector, held: Vector) -> None:
        run, layout = self.run, self.run.layout
        if run.index % run.every:
            return
        source = layout.record_source
        found = np.where(self.interpolated, smooth[source], held[source])
        run.keep(found * layout.record_gain + layout.record_offset)

    def report(self) -> dict[str, float]:
        """What it did."""
        return {
            "taken": self.taken,
            "rejected": self.rejected,
            "shortest_s": self.shortest if self.taken else 0.0,
            "longest_s": self.longest,
        }
