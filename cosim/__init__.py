"""Run systems of FMUs, compare them with measurements, and ask what is missing.

import cosim
result = cosim.run("motor_bench", variants={"gearbox": "elastic+backlash"})
result.recording.to_pandas()
result.recording.plot(path="bench.png")
"""

from .errors import CosimError
from .instance import Instance
from .master import Master
from .provider import FolderProvider
from .recording import Recording, read_recording
from .runner import Result, RunResult, run
from .signals import Constant, Function, Table
from .system import System
from .system_file import read_system

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
