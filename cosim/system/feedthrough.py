"""Graphs of variables: who depends on whom at one instant."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol

from ..fmu.description import Description

Graph = Mapping[str, Sequence[str]]
"""Node -> the nodes that it directly influences."""


class Wire(Protocol):
    """A connection of two variables."""

    @property
    def source(self) -> str:
        """The output."""

    @property
    def target(self) -> str:
        """The input that it drives."""


class Influences:
    """Who influences whom in a system, gone through again only when the system has grown."""

    def __init__(self) -> None:
        self._seen: list[object] = []
        self._found: Graph = {}

    def of(self, members: Mapping[str, Description], connections: Sequence[Wire]) -> Graph:
        """Variable -> variables that it influences at the same instant; a plan asks ten times."""
        present: list[object] = [*members, *members.values(), *connections]
        if len(present) != len(self._seen) or any(map(operator.is_not, present, self._seen)):
            self._seen, self._found = present, _influences(members, connections)
        return self._found


def _influences(members: Mapping[str, Description], connections: Sequence[Wire]) -> Graph:
    found: dict[str, list[str]] = {}
    for connection in connections:
        found.setdefault(connection.source, []).append(connection.target)
    for member, description in members.items():
        for output, inputs in description.dependencies.items():
            names = description.variables[output].elements()
            for item in inputs:
                for element in description.variables[item].elements():
                    found.setdefault(f"{member}.{element}", []).extend(
                        f"{member}.{name}" for name in names
                    )
    return found


def components(nodes: Iterable[str], graph: Graph) -> list[list[str]]:
    """Strongly connected components in topological order (influences first).

    Tarjan's algorithm, without recursion; among equals the order of `nodes` is kept.
    """
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    on_stack: set[str] = set()
    stack: list[str] = []
    found: list[list[str]] = []
    for root in reversed(list(nodes)):
        if root in index:
            continue
        work = [(root, iter(reversed(graph.get(root, ()))))]
        index[root] = low[root] = len(index)
        stack.append(root)
        on_stack.add(root)
        while work:
            node, successors = work[-1]
            for successor in successors:
                if successor not in index:
                    index[successor] = low[successor] = len(index)
                    stack.append(successor)
                    on_stack.add(successor)
                    work.append((successor, iter(reversed(graph.get(successor, ())))))
                    break
                if successor in on_stack:
                    low[node] = min(low[node], index[successor])
            else:
                work.pop()
                if work:
                    parent = work[-1][0]
                    low[parent] = min(low[parent], low[node])
                if low[node] == index[node]:
                    component = []
                    while True:
                        member = stack.pop()
                        on_stack.discard(member)
                        component.append(member)
                        if member == node:
                            break
                    found.append(component)
    return found[::-1]


def loops(nodes: Iterable[str], graph: Graph) -> list[list[str]]:
    """One shortest cycle through each strongly connected component with a cycle."""
    found = []
    for component in components(nodes, graph):
        members = set(component)
        start = min(component)
        if len(component) == 1 and start not in graph.get(start, ()):
            continue
        previous: dict[str, str] = {}
        queue = [start]
        while queue and start not in previous:
            node = queue.pop(0)
            for successor in graph.get(node, ()):
                if successor in members and successor not in previous:
                    previous[successor] = node
                    queue.append(successor)
        cycle = [start]
        node = previous[start]
        while node != start:
            cycle.append(node)
            node = previous[node]
        found.append(cycle[:1] + cycle[:0:-1])
    return found
