"""Run systems of FMUs, compare them with measurements, and ask what is missing.

import cosim
result = cosim.run("motor_bench", variants={"gearbox": "elastic+backlash"})
result.recording.to_pandas()
result.recording.plot(path="bench.png")
"""

from .data.recording import Recording, read_recording
from .data.signals import Constant, Function, Table
from .errors import CosimError
from .fmu.instance import Instance
from .master.master import Master
from .running.runner import Result, RunResult, run
from .system.provider import FolderProvider
from .system.system import System
from .system.toml import read_system

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
    "read_recording",
    "read_system",
    "run",
]
