"""What FMUs log: one C callback per FMI version for the whole process, sorted by instance.

One callback for all is needed because the C helper that formats FMI 2's messages remembers only
the last one it was given.
"""

from __future__ import annotations

import ctypes as ct
import itertools
from collections import deque
from collections.abc import Sequence

STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
_LIMIT = 50
_messages: dict[int, deque[str] | None] = {}
"""By key; none yet: None, for an empty deque is half a kilobyte."""
_keys = itertools.count(1)


def status_name(status: int) -> str:
    """A status in error texts."""
    if 0 <= status < len(STATUS):
        return repr(STATUS[status])
    return f"{status}, which FMI does not know"


def new_key(address: int = 0) -> int:
    """A key under which an instance's messages are kept; an address of its own where it has one."""
    key = address or next(_keys)
    _messages[key] = None
    return key


def environment(key: int) -> int:
    """The key as FMI's instance environment, a pointer that loggers only compare."""
    return key


def take(key: int) -> tuple[str, ...]:
    """Messages since the last call, oldest first."""
    kept = _messages.get(key)
    if not kept:
        return ()
    found = tuple(kept)
    kept.clear()
    return found


def tail(messages: Sequence[str]) -> str:
    """The end of an error text: what the FMU logged."""
    return ": " + "; ".join(messages) if messages else " (the FMU logged nothing)"


def forget(key: int) -> None:
    """Drop an instance's messages."""
    _messages.pop(key, None)


def _keep(key: int | None, status: int, message: bytes | None) -> None:
    key = key or 0
    if key in _messages:
        kept = _messages[key]
        if kept is None:
            kept = _messages[key] = deque(maxlen=_LIMIT)
        text = " ".join((message or b"").decode("utf-8", "replace").split())
        kept.append(text if status == 0 else f"{STATUS[min(status, 5)]}: {text}")


def _log2(
    key: int | None, name: bytes | None, status: int, category: bytes | None, message: bytes | None
) -> None:
    _keep(key, status, message)


def _log3(key: int | None, status: int, category: bytes | None, message: bytes | None) -> None:
    _keep(key, status, message)


LOGGER2 = ct.CFUNCTYPE(None, ct.c_void_p, ct.c_char_p, ct.c_int, ct.c_char_p, ct.c_char_p)(_log2)
LOGGER3 = ct.CFUNCTYPE(None, ct.c_void_p, ct.c_int, ct.c_char_p, ct.c_char_p)(_log3)
