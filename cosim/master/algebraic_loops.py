"""Direct feedthrough at one instant: the order in which to fetch outputs, and algebraic loops.

An algebraic loop is cut at some of its outputs z. One sweep around it gives G(z); its solution is
z = G(z), found by Newton's method with a Jacobian that is kept as long as it contracts:

    (I - dG/dz) (z_new - z) = G(z) - z

The Jacobian comes from the FMUs' directional derivatives where all of them have these and
otherwise from differences. Plain numbers and a fixed order of summation, so that compiled code can
do the same, bit for bit.

Source: Kübler and Schiehlen, Two methods of simulator coupling, 2000 (loops of direct feedthrough);
Kelley, Solving nonlinear equations with Newton's method, 2003 (chord method).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..system import feedthrough
from ..system.system import System
from .extrapolation import smooth
from .plan import Layout, Loop, Op, exchange, operations

Vector = NDArray[np.float64]
Rows = list[tuple[int, ...]]
ITERATIONS = 60
"""Newton iterations before a loop is said not to settle."""
SETTLED = 1e-10
"""Newton step, relative to max(1, |z|), at which a loop counts as solved."""
CONTRACTION = 0.25
"""The Jacobian is renewed when a Newton step is longer than this times the one before."""
INCREMENT = 1e-6
"""Of differences, relative to max(1, |z|)."""


# -- structure -------------------------------------------------------------------------------------


def find_loops(system: System, layout: Layout) -> list[tuple[set[str], Loop]]:
    """The algebraic loops, with the variables that take part, in the order of feedthrough."""
    influences = _influences(system, layout)
    nodes = list(dict.fromkeys([*influences, *(c.target for c in system.connections)]))
    paths = feedthrough.loops(nodes, influences)
    found = []
    for component in feedthrough.components(nodes, influences):
        members = set(component)
        path = next((item for item in paths if item[0] in members), None)
        if path is not None:
            found.append((members, _cut(system, layout, members, path)))
    return found


def _influences(system: System, layout: Layout) -> dict[str, list[str]]:
    """Dependencies at one instant; integers, booleans and held signals wait for the next."""
    continuous = smooth(system, layout)
    held = {
        (layout.names[layout.copy_source[index]], layout.names[layout.copy_target[index]])
        for index in np.flatnonzero(~continuous)
    }
    return {
        source: [target for target in targets if (source, target) not in held]
        for source, targets in system.dependencies().items()
    }


def _cut(system: System, layout: Layout, members: set[str], path: list[str]) -> Loop:
    """Cut a loop at the fewest outputs."""
    wires = [c for c in system.connections if c.source in members and c.target in members]
    present = {name.partition(".")[0] for name in members}
    instances = [name for name in system.order() if name in present]
    rotations = [instances[k:] + instances[:k] for k in range(len(instances))]
    orders: list[Sequence[str]] = list(
        itertools.permutations(instances) if len(instances) <= 4 else rotations
    )

    def torn(order: Sequence[str]) -> list[str]:
        rank = {name: index for index, name in enumerate(order)}
        return list(
            dict.fromkeys(
                c.source
                for c in wires
                if rank[c.source.partition(".")[0]] >= rank[c.target.partition(".")[0]]
            )
        )

    order = min(orders, key=lambda item: len(torn(item)))
    slots = {name: index for index, name in enumerate(layout.names)}
    sources = sorted(slots[name] for name in torn(order))
    position = {name: index for index, name in enumerate(layout.instances)}
    rows: Rows = []
    for name in order:
        rows += [*exchange(layout, position[name]), (Op.GET, position[name])]
    return Loop(np.array(sources, dtype=np.int64), operations(rows), system.explain_loop(path))


def consistent(
    system: System, layout: Layout, loops: list[tuple[set[str], Loop]], only_loops: bool
) -> Rows:
    """Operations that make outputs with direct feedthrough those of the inputs at this instant.

    Args:
        system, layout: what is run.
        loops: from `find_loops`.
        only_loops: leave out everything but the loops.
    """
    if only_loops:
        return [(Op.SOLVE, index) for index in range(len(loops))]
    position = {name: index for index, name in enumerate(layout.instances)}
    driver = {c.target: c.source for c in system.connections}
    reached = {layout.names[slot] for slot in layout.external.tolist()} | set(driver)
    fetched = set(layout.names[: int(layout.outputs[-1, 1])]) if len(layout.outputs) else set()
    needs: dict[str, set[str]] = {}
    influences = _influences(system, layout)
    for source, targets in influences.items():
        if source in reached:
            for target in targets:
                if target in fetched:
                    needs.setdefault(target, set())
                    if source in driver and source in influences.get(driver[source], ()):
                        needs[target].add(driver[source])
    waiting = set(needs)
    rows: Rows = []
    while waiting:
        before = len(waiting)
        for index, (members, _) in enumerate(loops):
            inside = members & waiting
            if inside and all(not (needs[name] - members) & waiting for name in inside):
                rows.append((Op.SOLVE, index))
                waiting -= members
        looped = set().union(*(members for members, _ in loops)) if loops else set()
        for name in system.order():
            ready = {
                output
                for output in waiting - looped
                if output.partition(".")[0] == name and not needs[output] & waiting
            }
            if ready:
                rows += [*exchange(layout, position[name]), (Op.GET, position[name])]
                waiting -= ready
        if len(waiting) == before:  # cannot be: what is left would be a loop
            raise AssertionError(f"no order for {sorted(waiting)}")
    return rows


def reached(system: System, layout: Layout) -> bool:
    """Whether external inputs are passed on to fetched outputs at the same instant."""
    influences = _influences(system, layout)
    fetched = {layout.names[slot] for slot in range(int(layout.inputs[0, 0]))}
    return any(
        fetched & set(influences.get(layout.names[slot], ())) for slot in layout.external.tolist()
    )


# -- numbers ---------------------------------------------------------------------------------------


class Newton:
    """Solves z = G(z), keeping the inverse of I - dG/dz.

    Attributes:
        inverse: n x n.
        valid: one number, whether `inverse` is good for anything.
    """

    def __init__(self, n: int, tolerance: float = SETTLED) -> None:
        self.n, self.tolerance = n, tolerance
        self.inverse = np.zeros((n, n))
        self.valid = np.zeros(1, dtype=np.int64)

    def keep(self, jacobian: Vector) -> bool:
        """Take dG/dz; False if I - dG/dz is singular."""
        inverse = invert((np.eye(self.n) - jacobian).tolist())
        self.valid[0] = inverse is not None
        if inverse is not None:
            self.inverse[:] = inverse
        return inverse is not None

    def solve(self, function: Callable[[list[float]], list[float]], z: list[float]) -> bool:
        """Find z = G(z) from the guess `z`, which is overwritten; the last call was of G(z).

        Returns:
            Whether it settled.
        """
        last = 0.0
        for _ in range(ITERATIONS):
            value = function(z)
            rest = [a - b for a, b in zip(value, z, strict=True)]
            renewed = False
            if not self.valid[0]:
                if not self.difference(function, z, value):
                    return False
                renewed = True
            size, change = self.newton_step(rest, z)
            if size <= self.tolerance and not renewed:
                return True
            if not renewed and last > 0.0 and not size <= CONTRACTION * last:
                if not self.difference(function, z, value):
                    return False
                size, change = self.newton_step(rest, z)
            if not size < np.inf:
                self.valid[0] = 0
                return False
            for i in range(self.n):
                z[i] += change[i]
            last = size
        self.valid[0] = 0
        return False

    def newton_step(self, rest: list[float], z: list[float]) -> tuple[float, list[float]]:
        """The change of z and its relative size."""
        size, change = 0.0, []
        for i, row in enumerate(self.inverse.tolist()):
            total = 0.0
            for factor, item in zip(row, rest, strict=True):
                total += factor * item
            change.append(total)
            relative = abs(total) / max(1.0, abs(z[i]))
            if not relative <= size:  # so that nan counts as large
                size = relative
        return size, change

    def difference(
        self, function: Callable[[list[float]], list[float]], z: list[float], value: list[float]
    ) -> bool:
        """Renew the Jacobian by differences around z."""
        n = self.n
        matrix = [[0.0] * n for _ in range(n)]
        for j in range(n):
            moved = list(z)
            increment = INCREMENT * max(1.0, abs(z[j]))
            moved[j] += increment
            there = function(moved)
            for i in range(n):
                matrix[i][j] = (1.0 if i == j else 0.0) - (there[i] - value[i]) / increment
        inverse = invert(matrix)
        self.valid[0] = inverse is not None
        if inverse is not None:
            self.inverse[:] = inverse
        return inverse is not None


def invert(matrix: list[list[float]]) -> list[list[float]] | None:
    """Inverse by Gauss-Jordan elimination with partial pivoting, None if there is none."""
    n = len(matrix)
    rows = [list(row) + [1.0 if i == j else 0.0 for j in range(n)] for i, row in enumerate(matrix)]
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(rows[i][k]) > abs(rows[best][k]):
                best = i
        pivot = rows[best][k]
        if not 1e-13 < abs(pivot) < np.inf:
            return None
        rows[k], rows[best] = rows[best], rows[k]
        for j in range(2 * n):
            rows[k][j] /= pivot
        for i in range(n):
            factor = rows[i][k]
            if i != k and factor != 0.0:
                for j in range(2 * n):
                    rows[i][j] -= factor * rows[k][j]
    return [row[n:] for row in rows]
