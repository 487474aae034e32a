"""The motor bench as a system, for several tests."""

from __future__ import annotations

from cosim.system.provider import Provider
from cosim.system.system import System

WIRES = [
    ("motor.tau", "gearbox.tau_a"),
    ("gearbox.w_a", "motor.w"),
    ("gearbox.tau_b", "load.tau"),
    ("gearbox.J_b", "load.J_added"),
    ("load.w", "gearbox.w_b"),
]


def bench(provider: Provider, motor: str = "dc_motor.lab_bench/electrical") -> System:
    system = System("bench", provider)
    system.add("motor", motor)
    system.add("gearbox", "gearbox.lab_bench/ratio")
    system.add("load", "inertia.lab_bench/disc")
    for source, target in WIRES:
        system.connect(source, target)
    return system
