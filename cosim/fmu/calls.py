"""Which call to an FMU comes next, told before it is made to whoever watches from elsewhere.

Steps and the exchange of values are not told here but by the executors, which make them often.
"""

from __future__ import annotations

from collections.abc import Callable

_listener: Callable[[str, str], None] | None = None


def listen(listener: Callable[[str, str], None] | None) -> None:
    """Have each call told: name of the instance, and what it is asked for."""
    global _listener
    _listener = listener


def announce(name: str, what: str) -> None:
    """Say that an instance is about to be asked for something."""
    if _listener is not None:
        _listener(name, what)
