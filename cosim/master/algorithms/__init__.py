"""Co-simulation algorithms: one file each, each compiles a system into a `plan.Plan`.

A module here has `compile_plan(system, external, observed, **options) -> Plan` and is chosen by its
name.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ...errors import InputError, UnknownNameError, listing

if TYPE_CHECKING:  # the command line asks for names only
    from ...system.system import System
    from ..plan import Plan


def names() -> list[str]:
    """The algorithms that exist."""
    return sorted(info.name for info in pkgutil.iter_modules(__path__))


def known_options(algorithm: str) -> list[str]:
    """The options of an algorithm that exists.

    Raises:
        InputError: its file does not say how to compile a plan.
    """
    module = importlib.import_module(f"{__name__}.{algorithm}")
    if not hasattr(module, "compile_plan"):
        raise InputError(
            f"algorithm {algorithm!r}: {module.__file__} has no function "
            "compile_plan(system, external, observed, *, options) -> Plan"
        )
    return [
        name
        for name, parameter in inspect.signature(module.compile_plan).parameters.items()
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY
    ]


def compile_plan(
    algorithm: str,
    system: System,
    external: Sequence[str],
    observed: Sequence[str],
    options: Mapping[str, Any] | None = None,
) -> Plan:
    """Compile a system by the named algorithm.

    Raises:
        UnknownNameError: there is no such algorithm, or it has no such option.
    """
    # folders take longer to list than a short run to simulate
    if f"{__name__}.{algorithm}" not in sys.modules and algorithm not in names():
        raise UnknownNameError(
            f"there is no algorithm {algorithm!r}; {listing(names(), algorithm)}"
        )
    known = known_options(algorithm)
    for name in options or {}:
        if name not in known:
            raise UnknownNameError(
                f"algorithm {algorithm!r} has no option {name!r}; {listing(known, name)}"
            )
    module = importlib.import_module(f"{__name__}.{algorithm}")
    plan: Plan = module.compile_plan(system, external, observed, **(options or {}))
    return replace(plan, algorithm=algorithm)
