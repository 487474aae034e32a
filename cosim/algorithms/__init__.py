"""Co-simulation algorithms: one file each, each compiles a system into a `plan.Plan`.

A module here has `compile_plan(system, external, observed) -> Plan` and is chosen by its name.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Sequence

from ..errors import UnknownNameError, listing
from ..plan import Plan
from ..system import System


def names() -> list[str]:
    """The algorithms that exist."""
    return sorted(info.name for info in pkgutil.iter_modules(__path__))


def compile_plan(
    algorithm: str, system: System, external: Sequence[str], observed: Sequence[str]
) -> Plan:
    """Compile a system by the named algorithm.

    Raises:
        UnknownNameError: there is no such algorithm.
    """
    if algorithm not in names():
        raise UnknownNameError(
            f"there is no algorithm {algorithm!r}; {listing(names(), algorithm)}"
        )
    module = importlib.import_module(f"{__name__}.{algorithm}")
    plan: Plan = module.compile_plan(system, external, observed)
    return plan
