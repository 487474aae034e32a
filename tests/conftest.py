"""`make quick` is `pytest -m "not slow"`.

Modules that are slow as a whole are not even imported then, and it says so when it takes too long.
"""

from __future__ import annotations

import gc
import os
import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from cosim.master import cores

QUICK = "not slow"
LONGEST = 60.0
"""[s] What one waits for without doing something else."""
SLOW_MODULE = re.compile(r"^pytestmark = pytest\.mark\.slow$", flags=re.M)
BEGIN = pytest.StashKey[float]()


ROOT = Path(__file__).resolve().parents[1]
PRODUCTS = {"out", "dist", "build"}
"""Folders of the checkout that hold what commands made, and that git ignores."""


@pytest.fixture(scope="session", autouse=True)
def checkout_stays_clean() -> Iterator[None]:
    """Tests, and the tools that they start, write to their own folders only."""
    before = {path.name for path in ROOT.iterdir()}
    yield
    left = {path.name for path in ROOT.iterdir()} - before - PRODUCTS
    left = {name for name in left if not name.startswith((".", "__pycache__"))}
    assert not left, f"the tests have left {sorted(left)} in {ROOT}"


def pytest_configure(config: pytest.Config) -> None:
    config.stash[BEGIN] = time.perf_counter()
    gc.disable()  # until all tests are collected: the looking was a quarter of it
    # each worker of xdist has its share of the processors: more threads would only wait
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    if workers > 1 or getattr(config.option, "numprocesses", None):
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # inherited by workers that begin now
    if workers > 1:
        os.environ.setdefault(cores.VARIABLE, str(max(cores.cores() // workers, 1)))


def pytest_collection_finish() -> None:
    """Thousands of collected tests stay to the end: nobody has to look through them for garbage."""
    gc.collect()
    gc.freeze()
    gc.enable()


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    # their parameters alone, models of the whole catalogue, take 15 s to build
    if config.option.markexpr == QUICK and collection_path.match("test_*.py"):
        return SLOW_MODULE.search(collection_path.read_text(encoding="utf-8")) is not None or None
    return None


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    taken = time.perf_counter() - config.stash[BEGIN]
    if config.option.markexpr != QUICK or taken <= LONGEST:
        return
    calls = [r for r in terminalreporter.stats.get("passed", []) if r.when == "call"]
    terminalreporter.write_line(
        f"{taken:.0f} s are more than the {LONGEST:.0f} s of a quick run. If the machine was idle"
        " and the FMUs were built, mark these as slow:"
    )
    for report in sorted(calls, key=lambda report: -report.duration)[:5]:
        terminalreporter.write_line(f"{report.duration:6.1f} s  {report.nodeid}")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with what takes longest: at the end, one worker would wait for the other."""
    longest = "tests/diagnose/"
    items.sort(key=lambda item: not item.nodeid.startswith(longest))
