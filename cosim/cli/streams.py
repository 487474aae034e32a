"""Standard output for one JSON value alone: whatever FMUs print goes to standard error.

FMUs print from C and from Python, to the file descriptor or to `sys.stdout`, and C's buffers are
written when the process ends. So the descriptor is turned away until then.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO

from ..files import json_text

_kept: list[TextIO] = []


@contextmanager
def stdout_for_json() -> Iterator[None]:
    """Inside, only `print_json` writes to standard output."""
    given = sys.stdout
    given.flush()
    try:
        own = given.fileno() == 1
    except (OSError, ValueError):  # in memory
        own = False
    if own:
        _kept.append(os.fdopen(os.dup(1), "w", encoding="utf-8"))
        os.dup2(2, 1)
    else:
        _kept.append(given)
    sys.stdout = sys.stderr
    try:
        yield
    finally:
        _kept.pop().flush()
        sys.stdout = given


def print_json(content: Any, indent: int | None = 2) -> None:
    """Print one JSON value; on one line without an indent."""
    out = _kept[-1] if _kept else sys.stdout
    out.write(json_text(content, indent))
    out.flush()
