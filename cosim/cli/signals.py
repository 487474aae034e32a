"""Signals of the system that a command takes itself."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def taken(number: signal.Signals, handle: Callable[[], None]) -> Iterator[None]:
    """Call a function at a signal inside the block; outside of the main thread none comes."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(number, lambda *_: handle())
    try:
        yield
    finally:
        signal.signal(number, before)
