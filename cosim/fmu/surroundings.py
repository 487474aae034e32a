"""What belongs to the whole process and an FMU may change: put back after its calls, and named.

Working directory, file mode mask, decimal point, handlers of signals, rounding of floating-point
numbers: what one FMU leaves changed would change the results of the others, or of this program.
"""

from __future__ import annotations

import contextlib
import ctypes as ct
import ctypes.util
import locale
import os
import platform
import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

CRASHES = (signal.SIGSEGV, signal.SIGFPE)
SIGNALS = (signal.SIGINT, signal.SIGTERM, *CRASHES)
"""Whose handlers are watched."""


class _Modes:
    """Rounding and treatment of tiny numbers, where it is known how this machine keeps them."""

    def __init__(self) -> None:
        self.known = sys.platform == "linux" and platform.machine() == "x86_64"
        if self.known:
            library = ct.PyDLL(ctypes.util.find_library("m") or "libm.so.6")
            self._get, self._set = library.fegetenv, library.fesetenv
            self._get.argtypes = self._set.argtypes = [ct.c_void_p]
            self._environment = ct.create_string_buffer(32)  # fenv_t
            self._address = ct.addressof(self._environment)
            self._old = ct.c_uint16.from_buffer(self._environment)  # control of the x87 unit
            self._control = ct.c_uint32.from_buffer(self._environment, 28)  # of the SSE unit

    def get(self) -> int:
        """The modes without the flags of exceptions (6 bits), which calculations set."""
        if not self.known:
            return 0
        self._get(self._address)
        return int(self._control.value) & ~0x3F

    def put(self, wanted: int) -> None:
        """Return to modes."""
        self._get(self._address)
        self._control.value = wanted
        self._old.value = (self._old.value & ~0xC00) | (wanted >> 3 & 0xC00)  # rounding
        self._set(self._address)


modes = _Modes()
MODES = "the rounding of floating-point numbers"


def _handlers() -> tuple[Any, ...]:
    get = ct.pythonapi.PyOS_getsig
    get.restype = ct.c_void_p
    return tuple(get(int(number)) for number in SIGNALS)


def _given_up(number: signal.Signals, handler: Any) -> bool:
    """Whether a handler was taken off by another thread that is crashing.

    Python's fault handler does so before it reports; put back then, it would report for ever.
    """
    return number in CRASHES and not handler  # None: the default


def _put_handlers(wanted: dict[signal.Signals, Any]) -> None:
    put = ct.pythonapi.PyOS_setsig
    put.argtypes, put.restype = [ct.c_int, ct.c_void_p], ct.c_void_p
    for number, handler in wanted.items():
        put(int(number), handler)


def _folder() -> str:
    try:
        return os.getcwd()
    except FileNotFoundError:  # somebody has removed it
        return ""


def _mask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


@dataclass(frozen=True)
class Surroundings:
    """As they are at one time."""

    folder: str
    mask: int
    point: str
    handlers: tuple[Any, ...]
    modes: int

    @classmethod
    def now(cls) -> Surroundings:
        """As they are."""
        return cls(
            _folder(), _mask(), locale.setlocale(locale.LC_NUMERIC), _handlers(), modes.get()
        )

    def restore(self) -> list[str]:
        """Return to them; what had changed."""
        now = Surroundings.now()
        if now == self:
            return []
        found = []
        if now.folder != self.folder and self.folder:
            os.chdir(self.folder)
            found.append(f"the working directory to {now.folder}")
        if now.mask != self.mask:
            os.umask(self.mask)
            found.append(f"the file mode mask to {now.mask:03o}")
        if now.point != self.point:
            locale.setlocale(locale.LC_NUMERIC, self.point)
            found.append(f"the locale of numbers to {now.point}")
        changed = {
            number: old
            for number, old, new in zip(SIGNALS, self.handlers, now.handlers, strict=True)
            if old != new and not _given_up(number, new)
        }
        if changed:
            _put_handlers(changed)
            found.append(f"what happens at {', '.join(number.name for number in changed)}")
        if now.modes != self.modes:
            modes.put(self.modes)
            found.append(MODES)
        return found


@contextlib.contextmanager
def kept(tell: Callable[[str], None]) -> Iterator[None]:
    """Put back what the block changes, and tell what that was."""
    before = Surroundings.now()
    try:
        yield
    finally:
        for what in before.restore():
            tell(what)
