"""Run systems of FMUs, compare them with measurements, and ask what is missing.

import cosim
result = cosim.run("motor_bench", variants={"gearbox": "elastic+backlash"})
result.recording.to_pandas()
result.recording.plot(path="bench.png")
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from . import arithmetic

if TYPE_CHECKING:
    from . import errors
    from .data.recording import Recording, read_recording
    from .data.signals import Constant, Function, Table
    from .errors import CosimError
    from .fmu.instance import Instance
    from .master.master import Master
    from .master.twin import Twin
    from .running.opening import open
    from .running.runner import Result, RunResult, run
    from .system.provider import FolderProvider
    from .system.system import System
    from .system.toml import read_system

arithmetic.choose()  # before anything loads NumPy

__all__ = [
    "Constant",
    "CosimError",
    "FolderProvider",
    "Function",
    "Instance",
    "Master",
    "Recording",
    "Result",
    "RunResult",
    "System",
    "Table",
    "Twin",
    "errors",
    "open",
    "read_recording",
    "read_system",
    "run",
]

_HOMES = {
    "Constant": "data.signals",
    "CosimError": "errors",
    "FolderProvider": "system.provider",
    "Function": "data.signals",
    "Instance": "fmu.instance",
    "Master": "master.master",
    "Recording": "data.recording",
    "Result": "running.runner",
    "RunResult": "running.runner",
    "System": "system.system",
    "Table": "data.signals",
    "Twin": "master.twin",
    "open": "running.opening",
    "read_recording": "data.recording",
    "read_system": "system.toml",
    "run": "running.runner",
}
"""Name -> module, loaded when the name is first used (PEP 562).

A module of this package, the command line above all, then loads what it needs and no more.
"""


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        value = getattr(importlib.import_module(f".{_HOMES[name]}", __name__), name)
    elif name == "errors":
        value = importlib.import_module(".errors", __name__)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
