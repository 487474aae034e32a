"""Graphs of variables: who depends on whom at one instant."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

Graph = Mapping[str, Sequence[str]]
"""Node -> the nodes that it directly influences."""


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
