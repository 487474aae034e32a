"""Running scenarios in tests: FMUs are built once, results of whole scenarios are kept."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from cosim.running.runner import Result, run
from tests.fmus import fmu


class Built:
    """Provider of the tests."""

    def path(self, variant: str) -> Path:
        return fmu(variant)


PROVIDER = Built()


@lru_cache(maxsize=None)
def whole(name: str) -> Result:
    """A scenario with all its runs."""
    return run(name, provider=PROVIDER)
