"""How much may be simulated, and a way to end a search with what it has."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager


class StoppedError(Exception):
    """A search ends here.

    No `CosimError`: one law that cannot be simulated gives way to the next, this ends all.
    """


class Budget:
    """Counts simulated runs and ends the work of all who simulate with it.

    A number of runs gives the same end on any machine at any load.

    Args:
        runs: at most, no limit if not given.

    Attributes:
        spent: runs begun so far, without those known from before.
        stopped: why the work has ended, "" as long as it goes on.

    Raises:
        ValueError: `runs` is no positive number.
    """

    def __init__(self, runs: int | None = None) -> None:
        if runs is not None and runs < 1:
            raise ValueError(f"a budget of {runs} simulated runs is none; give at least 1")
        self.runs, self.spent, self.stopped = runs, 0, ""
        self._lifted = False
        self._lock = threading.Lock()

    def stop(self, why: str) -> None:
        """End the work before the next simulated run."""
        self.stopped = self.stopped or why

    @contextmanager
    def lifted(self) -> Iterator[None]:
        """End nothing meanwhile: what is done is the report on what was found."""
        before, self._lifted = self._lifted, True
        try:
            yield
        finally:
            self._lifted = before

    def spend(self) -> None:
        """Count a run.

        Raises:
            StoppedError: it may not be simulated any more.
        """
        with self._lock:
            if not self._lifted:
                if self.runs is not None and self.spent >= self.runs:
                    self.stop(f"after {self.runs} simulated runs")
                if self.stopped:
                    raise StoppedError(self.stopped)
            self.spent += 1
