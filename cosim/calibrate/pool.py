"""Prepared runs that problems share: those that differ in values and data, not in what is run.

A fit simulates many problems that differ in what is held and what is measured only. To prepare a
run (to create its FMUs and bind them) takes as long as a short simulation, so idle sessions are
kept for whoever runs the same next.
"""

from __future__ import annotations

import threading
from collections.abc import Hashable
from typing import NamedTuple

from ..session import Session
from ..system import System

MOST = 128
"""Idle sessions that are kept, each with some megabytes; a fit of ten runs in three step sizes and
two threads needs half of them."""


class Key(NamedTuple):
    """What must be the same for a session to be used again.

    Attributes:
        kind: of the problem: variants, steps, what is recorded.
        run: times and identity of the inputs.
    """

    kind: Hashable
    run: Hashable


class Pool:
    """Idle sessions and the systems that they run, the ones used last."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._idle: dict[Key, list[tuple[object, Session]]] = {}
        self._count = 0
        self._systems: dict[Hashable, System] = {}

    def take(self, key: Key) -> Session | None:
        """An idle session, if there is one; nobody else gets it until it is given back."""
        with self._lock:
            idle = self._idle.get(key)
            if not idle:
                return None
            self._count -= 1
            return idle.pop()[1]

    def give(self, key: Key, session: Session, inputs: object) -> None:
        """Keep a session for later.

        Args:
            key: what it runs.
            session: nobody uses it.
            inputs: what the key identifies, kept alive with it.
        """
        surplus: list[Session] = []
        with self._lock:
            idle = self._idle.pop(key, [])
            self._idle[key] = [*idle, (inputs, session)]  # the last one again
            self._count += 1
            while self._count > MOST:
                oldest = next(iter(self._idle))
                surplus += [item for _, item in self._taken(oldest)]
        for item in surplus:
            item.close()

    def _taken(self, key: Key) -> list[tuple[object, Session]]:
        found = self._idle.pop(key, [])
        self._count -= len(found)
        return found

    def system(self, kind: Hashable) -> System | None:
        """The system of a kind of problem, if it was kept."""
        return self._systems.get(kind)

    def keep(self, kind: Hashable, system: System) -> System:
        """Keep a system; the one that counts, where two threads have made one."""
        with self._lock:
            return self._systems.setdefault(kind, system)

    def close(self, kind: Hashable) -> None:
        """Free what is idle of one kind of problem."""
        with self._lock:
            self._systems.pop(kind, None)
            found = [e for key in list(self._idle) if key.kind == kind for e in self._taken(key)]
        for _, session in found:
            session.close()
