"""Prepared runs that problems share: those that differ in values and data, not in what is run.

A fit simulates many problems that differ in what is held and what is measured only. To prepare a
run (to create its FMUs and bind them) takes as long as a short simulation, so idle sessions are
kept for whoever runs the same next. What was simulated with the very same values is kept too: the
stages of a fit hand their values on, and each begins where the one before has ended.
"""

from __future__ import annotations

import math
import threading
from collections import OrderedDict
from collections.abc import Hashable
from typing import NamedTuple
from weakref import WeakValueDictionary

import numpy as np

from ..master.elsewhere import Elsewhere, Workers
from ..master.outline import Outline
from ..master.session import RUNAWAY, Session
from .budget import Budget
from .memory import give_back
from .parts import Vector

MOST = 128
"""Idle sessions that are kept, each with up to a megabyte beside the inputs, which those of one run
share; a fit of ten runs in three step sizes and two threads needs half of them."""
KEPT = 2**27
"""Bytes of simulated rows that are kept, those asked for last: a few hundred runs of a minute."""


class Key(NamedTuple):
    """What must be the same for a session to be used again.

    Attributes:
        kind: of the problem: variants, steps, what is recorded.
        run: times and identity of the inputs.
    """

    kind: Hashable
    run: Hashable


class Ran(NamedTuple):
    """A simulated run.

    Attributes:
        names: recorded.
        times: at which [s].
        rows: one per time, with a column per name.
        cost: work that it took (see `Session.run`).
        inputs: what the key identifies, kept alive with it.
    """

    names: tuple[str, ...]
    times: Vector
    rows: Vector
    cost: int
    inputs: object

    def within(self, limit: float) -> bool:
        """Whether a run with this limit on its work would have come to its end too."""
        calm = math.isinf(limit) or float(np.abs(self.rows).max(initial=0.0)) <= RUNAWAY
        return self.cost <= limit and calm


class SessionPool:
    """Idle sessions and what they gave, the ones used last.

    Args:
        budget: how much may be simulated; no limit if not given.

    Attributes:
        outlines: the oldest one of each run that is still in use, whose table of inputs the next
            session shares.
    """

    def __init__(self, budget: Budget | None = None) -> None:
        self.budget = budget or Budget()
        self._lock = threading.Lock()
        self._ran: OrderedDict[tuple[Key, Hashable], Ran] = OrderedDict()
        self._size = 0
        self._idle: dict[Key, list[tuple[object, Session | Elsewhere]]] = {}
        self._count = 0
        self._elsewhere: dict[int, Workers] = {}
        self.outlines: WeakValueDictionary[Hashable, Outline] = WeakValueDictionary()

    def elsewhere(self, count: int) -> Workers:
        """Other processes that run sessions, the same for all who ask for as many."""
        if count not in self._elsewhere:
            self._elsewhere[count] = Workers(count)
        return self._elsewhere[count]

    def take(self, key: Key) -> Session | Elsewhere | None:
        """An idle session, if there is one; nobody else gets it until it is given back."""
        with self._lock:
            idle = self._idle.get(key)
            if not idle:
                return None
            self._count -= 1
            return idle.pop()[1]

    def give(self, key: Key, session: Session | Elsewhere, inputs: object) -> None:
        """Keep a session for later.

        Args:
            key: what it runs.
            session: nobody uses it.
            inputs: what the key identifies, kept alive with it.
        """
        surplus: list[Session | Elsewhere] = []
        with self._lock:
            idle = self._idle.pop(key, [])
            self._idle[key] = [*idle, (inputs, session)]  # the last one again
            self._count += 1
            while self._count > MOST:
                oldest = next(iter(self._idle))
                surplus += [item for _, item in self._taken(oldest)]
        for item in surplus:
            item.close()

    def _taken(self, key: Key) -> list[tuple[object, Session | Elsewhere]]:
        found = self._idle.pop(key, [])
        self._count -= len(found)
        return found

    def ran(self, key: Key, values: Hashable, limit: float) -> Ran | None:
        """What was simulated with these values before, if that was within the limit."""
        place = (key, values)
        with self._lock:
            found = self._ran.get(place)
            if found is None or not found.within(limit):
                return None
            self._ran.move_to_end(place)
            return found

    def remember(self, key: Key, values: Hashable, ran: Ran) -> bool:
        """Keep what was simulated, nobody writes to its rows; whether it was new.

        Two threads may have simulated the same at once.
        """
        place = (key, values)
        with self._lock:
            new = place not in self._ran
            self._forget(place)
            self._ran[place] = ran
            self._size += ran.rows.nbytes
            while self._size > KEPT:
                self._forget(next(iter(self._ran)))
        return new

    def _forget(self, place: tuple[Key, Hashable]) -> None:
        old = self._ran.pop(place, None)
        self._size -= old.rows.nbytes if old else 0

    def close(self, kind: Hashable) -> None:
        """Free what is idle of one kind of problem."""
        with self._lock:
            found = [e for key in list(self._idle) if key.kind == kind for e in self._taken(key)]
        for _, session in found:
            session.close()
        give_back()
