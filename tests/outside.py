"""Processes in which other tools run."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest


def environment() -> dict[str, str]:
    """With the libraries that come with Python packages: ecos needs libtbb, of the package tbb."""
    places = [str(Path(sys.prefix) / "lib"), os.environ.get("LD_LIBRARY_PATH", "")]
    return {**os.environ, "LD_LIBRARY_PATH": os.pathsep.join(p for p in places if p)}


def hear_interrupts() -> None:
    """For a new process: a shell's background jobs, and all that they start, are deaf to SIGINT."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def require(package: str) -> None:
    """Skip where a package cannot be loaded, with the reason that it gives."""
    result = subprocess.run(
        [sys.executable, "-c", f"import {package}"],
        capture_output=True, text=True, check=False, env=environment(),
    )  # fmt: skip
    if result.returncode:
        reason = (result.stderr.strip().splitlines() or ["no message"])[-1]
        pytest.skip(f"import {package} fails with code {result.returncode}: {reason}")
