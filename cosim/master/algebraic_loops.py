"""Direct feedthrough at one instant: the order in which to fetch outputs, and algebraic loops.

An algebraic loop is cut at some of its outputs z. One sweep around it gives G(z); its solution is
z = G(z), found by Newton's method (`newton`). The Jacobian comes from the FMUs' directional
derivatives where all of them have these and otherwise from differences.

Source: Kübler and Schiehlen, Two methods of simulator coupling, 2000 (loops of direct feedthrough).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from ..system import feedthrough
from ..system.system import System
from .extrapolation import smooth
from .newton import single
from .plan import Layout, Loop, Op, exchange, operations

Rows = list[tuple[int, ...]]


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
    return Loop(
        np.array(sources, dtype=np.int64),
        operations(rows),
        system.explain_loop(path),
        single(system, members),
    )


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
    looped = set().union(*(members for members, _ in loops)) if loops else set()
    owned: dict[str, set[str]] = {}
    for name in waiting - looped:
        owned.setdefault(name.partition(".")[0], set()).add(name)
    order = system.order()
    rows: Rows = []
    while waiting:
        before = len(waiting)
        for index, (members, _) in enumerate(loops):
            inside = members & waiting
            if inside and all(not (needs[name] - members) & waiting for name in inside):
                rows.append((Op.SOLVE, index))
                waiting -= members
        for name in order:
            ready = {output for output in owned.get(name, ()) if not needs[output] & waiting}
            if ready:
                rows += [*exchange(layout, position[name]), (Op.GET, position[name])]
                waiting -= ready
                owned[name] -= ready
        if len(waiting) == before:  # cannot be: what is left would be a loop
            raise AssertionError(f"no order for {sorted(waiting)}")
    return rows


def relayed(system: System, layout: Layout) -> Rows:
    """Operations that bring what relays take to where they give it, in the order of feedthrough."""
    position = {name: index for index, name in enumerate(layout.instances)}
    rows: Rows = []
    for name in system.order():
        if system.members[name].description.extra.get("relay"):
            rows += [*exchange(layout, position[name]), (Op.GET, position[name])]
    return rows


def reached(system: System, layout: Layout) -> bool:
    """Whether external inputs are passed on to fetched outputs at the same instant."""
    influences = _influences(system, layout)
    fetched = {layout.names[slot] for slot in range(int(layout.inputs[0, 0]))}
    return any(
        fetched & set(influences.get(layout.names[slot], ())) for slot in layout.external.tolist()
    )
