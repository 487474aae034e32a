"""How far the work is, on standard error: bars on a terminal, else a line every few seconds."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any

from .output import say

EVERY = 5.0
"""Time between two lines where there is no terminal [s]; work that takes less says nothing."""


class Display:
    """Tasks with a name, how much is done and of how much; used in a `with` statement.

    Nothing goes to standard output. All methods may be called from any thread.
    """

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._bars: Any = None
        self._tasks: dict[str, Any] = {}
        self._begun: dict[str, float] = {}
        self._told = time.monotonic()
        self._last = ("", "")

    def __enter__(self) -> Display:
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import (
                BarColumn,
                Progress,
                TextColumn,
                TimeElapsedColumn,
                TimeRemainingColumn,
            )

            self._bars = Progress(
                TextColumn("{task.description}", markup=False), BarColumn(bar_width=24),
                TextColumn("{task.fields[count]}", markup=False),
                TimeElapsedColumn(), TimeRemainingColumn(compact=True),
                console=Console(stderr=True), transient=True,
            )  # fmt: skip
            self._bars.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._bars is not None:
            self._bars.stop()

    @property
    def on_terminal(self) -> bool:
        """Whether there are bars."""
        return self._bars is not None

    def update(
        self, task: str, done: float, total: float | None = None, *, text: str = "", count: str = ""
    ) -> None:
        """Say how far a task is.

        Args:
            task: what tells it from others.
            done, total: in any unit; without a total nobody knows how long it takes.
            text: what is shown instead of the task's name.
            count: as shown beside the bar, `done` of `total` in percent by default.
        """
        with self._lock:
            now = time.monotonic()
            self._begun.setdefault(task, now)
            shown = count or ("" if total is None else f"{done / total if total else 1.0:4.0%}")
            if self._bars is not None:
                if task not in self._tasks:
                    self._tasks[task] = self._bars.add_task(task, total=total, count=shown)
                self._bars.update(
                    self._tasks[task], description=text or task, completed=done, total=total,
                    count=shown,
                )  # fmt: skip
            elif now - self._told >= EVERY and (text, shown) != self._last:
                self._told, self._last = now, (text, shown)
                left = _left(now - self._begun[task], done, total)
                said = ", ".join(part for part in (shown.strip(), left) if part)
                say(f"{text or task}{': ' if said else ''}{said}")

    def end(self, task: str) -> None:
        """Take a task away."""
        with self._lock:
            self._begun.pop(task, None)
            if self._bars is not None and task in self._tasks:
                self._bars.remove_task(self._tasks.pop(task))

    @contextmanager
    def watch(self, task: str, look: Callable[[], str]) -> Iterator[None]:
        """Show what `look` says, again and again, as long as the block runs; "" is not shown."""
        done = threading.Event()

        def again() -> None:
            while not done.wait(0.5):
                if text := look():
                    self.update(task, 0.0, text=text)

        thread = threading.Thread(target=again, daemon=True)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()
            self.end(task)

    def say(self, text: str) -> None:
        """A line that stays."""
        with self._lock:
            if self._bars is not None:
                self._bars.console.print(text, markup=False, highlight=False, soft_wrap=True)
            else:
                say(text)
            self._told = time.monotonic()

    def building(self, variant: str, done: int, total: int) -> None:
        """FMUs that are built, as `installation.builder.Told`."""
        if variant:
            name = variant if len(variant) <= 48 else f"{variant[:47]}…"
            text = f"building {name}"
            self.update("building FMUs", done, total, text=text, count=f"{done} of {total} FMUs")
        else:
            self.end("building FMUs")


def _left(gone: float, done: float, total: float | None) -> str:
    """About how long it will take, once a tenth is done."""
    if not total or done < 0.1 * total or done >= total:
        return ""
    return f"about {max(round(gone * (total - done) / done), 1)} s left"
