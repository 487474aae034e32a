"""The other process of `elsewhere`: runs sessions that it is told of, until its input ends."""

from __future__ import annotations

import os
import pickle
import signal
import struct
import sys
from collections import OrderedDict
from dataclasses import dataclass
from typing import IO

import numpy as np
from numpy.typing import NDArray

from ..errors import CosimError, FmuCallError
from .outline import Outline
from .session import Session

MOST = 32
"""Sessions that are kept, those run last: a fit of ten runs in three step sizes."""


@dataclass(frozen=True)
class Request:
    """What is asked.

    Attributes:
        number: of the session.
        order: its outline, pickled, the first time.
        values, limit: of the run.
    """

    number: int
    order: bytes | None
    values: dict[str, float]
    limit: float


@dataclass(frozen=True)
class Answer:
    """What came of it.

    Attributes:
        times, rows, work: of the run.
        known: sessions that need no order.
        error: what was raised, None if nothing was.
    """

    times: NDArray[np.float64]
    rows: NDArray[np.float64]
    work: int
    known: tuple[int, ...]
    error: CosimError | None = None


def receive(out: IO[bytes]) -> bytes:
    """Read one message.

    Raises:
        EOFError: there is no more.
    """
    (size,) = struct.unpack("<Q", _read(out, 8))
    return _read(out, size)


def _read(out: IO[bytes], size: int) -> bytes:
    content = out.read(size)
    if len(content) < size:
        raise EOFError
    return content


def answered(sessions: OrderedDict[int, Session], request: Request) -> Answer:
    """Run what is asked."""
    empty = np.zeros(0)
    try:
        session = sessions.get(request.number)
        if session is None:
            assert request.order is not None
            outline: Outline = pickle.loads(request.order)
            session = sessions[request.number] = Session.of(outline)
            while len(sessions) > MOST:
                sessions.popitem(last=False)[1].close()
        sessions.move_to_end(request.number)
        times, rows = session.run(request.values, limit=request.limit)
    except FmuCallError as error:  # as text: recordings of failed runs are not asked for
        session = sessions.pop(request.number, None)
        if session is not None:
            session.close()
        return Answer(empty, empty, 0, tuple(sessions), FmuCallError(str(error), error.messages))
    except CosimError as error:
        plain = type(error)(str(error))
        return Answer(empty, empty, 0, tuple(sessions), plain)
    return Answer(times, rows, session.work, tuple(sessions))


def main() -> None:
    """Answer requests from the standard input."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who asks decides
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # FMUs print
    sessions: OrderedDict[int, Session] = OrderedDict()
    while True:
        try:
            request: Request = pickle.loads(receive(sys.stdin.buffer))
        except EOFError:
            break
        content = pickle.dumps(answered(sessions, request))
        out.write(struct.pack("<Q", len(content)) + content)
        out.flush()
    os._exit(0)  # what libraries of FMUs do at an ordinary end is of no use here
