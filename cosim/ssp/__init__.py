"""System Structure and Parameterization (SSP) 1.0 and 2.0: archives that other tools run.

from cosim import ssp
ssp.write(system, "bench.ssp", experiment=ssp.Experiment(stop=1.0, step=1e-4))
system = ssp.read("bench.ssp")
scenario = ssp.read_scenario("from_elsewhere.ssp", step=1e-3)
"""

from .document import open_package
from .experiment import export, read_scenario
from .read import Experiment, Package, Terminal, read, read_package
from .write import PARAMETER_SET, local_starts, write

__all__ = [
    "PARAMETER_SET",
    "Experiment",
    "Package",
    "Terminal",
    "export",
    "local_starts",
    "open_package",
    "read",
    "read_package",
    "read_scenario",
    "write",
]
