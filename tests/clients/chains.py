"""Chains of our FMUs and a plain Jacobi loop over FMPy, the reference for foreign masters."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.fmus import Slave, fmu
from tests.outside import environment

FOREIGN = Path(__file__).parent / "foreign.py"
KNOWN_LIMIT = ("Enumeration variable type not supported", "is of unsupported type, skipping")
"""What libcosim and ecos say about `solver.method`: they know no enumerations."""


@dataclass(frozen=True)
class Chain:
    """Instances by name (their variants), connections `a.x -> b.y`, and start values.

    `longest` is the number of connections on the longest path of direct feedthrough: so many
    exchanges settle all inputs in initialization mode.
    """

    instances: dict[str, str]
    connections: tuple[tuple[str, str], ...]
    values: dict[str, float] = field(default_factory=dict)
    longest: int = 4
    step: float = 1e-3
    count: int = 200

    def path(self, name: str, fmi: int, kinds: Mapping[str, str]) -> Path:
        return fmu(self.instances[name], kinds.get(name, "native"), fmi)


# load.w -> gear.w_a -> motor.tau -> gear.tau_b -> load: the longest path, 4 connections
_DRIVE = (
    ("motor.tau", "gear.tau_a"),
    ("gear.w_a", "motor.w"),
    ("gear.tau_b", "load.tau"),
    ("gear.J_b", "load.J_added"),
    ("load.w", "gear.w_b"),
)

CLOSED_LOOP = Chain(
    {"motor": "dc_motor/electrical", "gear": "gearbox/ratio", "load": "inertia/disc"},
    _DRIVE,
    {"motor.w_ref": 100.0, "load.speed": 1.0},
    step=1e-4,
    count=2000,
)

# The clocks (motor 0.5 ms and 50 us, link 3 ms) tick inside steps and at their ends.
SAMPLED = Chain(
    {
        "motor": "dc_motor/sampled",
        "gear": "gearbox/ratio",
        "load": "inertia/pendulum",
        "link": "command_link/held",
    },
    (*_DRIVE, ("link.v_d", "motor.w_ref"), ("load.phi", "link.w_set")),
    {"link.v_set": 80.0, "link.T": 0.003, "load.angle": 0.2},
    step=2.5e-4,
    count=1000,
)

CHAINS = {"closed_loop": CLOSED_LOOP, "sampled": SAMPLED}


def split(name: str) -> tuple[str, str]:
    instance, _, variable = name.partition(".")
    return instance, variable


def outputs(chain: Chain) -> list[str]:
    """All outputs of a chain, `instance.variable`."""
    found = []
    for name, variant in chain.instances.items():
        with Slave(fmu(variant), initialize=False) as slave:
            found += [f"{name}.{output}" for output in slave.names("output")]
    return found


def jacobi(
    chain: Chain,
    *,
    fmi: int = 2,
    kinds: Mapping[str, str] | None = None,
    exchanges: int | None = None,
    read_after_exchange: bool = False,
) -> dict[str, np.ndarray]:
    """Outputs after every step of a master that lets all instances step in parallel.

    Args:
        chain: what to run.
        fmi: version of all FMUs.
        kinds: instances of another kind than `native`.
        exchanges: how often connected values are passed on before the first step; default
            until all are settled.
        read_after_exchange: outputs with direct feedthrough differ once the new inputs are set.
    """
    slaves = {
        name: Slave(chain.path(name, fmi, kinds or {}), initialize=False)
        for name in chain.instances
    }

    def exchange() -> None:
        read = [
            slaves[a].get([x])[0] for a, x in (split(source) for source, _ in chain.connections)
        ]
        for (_, target), value in zip(chain.connections, read, strict=True):
            instance, variable = split(target)
            slaves[instance].set({variable: value})

    for name, slave in slaves.items():
        if fmi == 2:
            slave.fmu.setupExperiment(startTime=0.0)
        slave.set({split(n)[1]: x for n, x in chain.values.items() if split(n)[0] == name})
        slave.fmu.enterInitializationMode()
    for _ in range(chain.longest if exchanges is None else exchanges):
        exchange()
    for slave in slaves.values():
        slave.fmu.exitInitializationMode()
    names = {name: slave.names("output") for name, slave in slaves.items()}
    rows: dict[str, list[float]] = {f"{n}.{output}": [] for n in names for output in names[n]}
    for k in range(chain.count):
        for slave in slaves.values():
            slave.step(k * chain.step, chain.step)
        if read_after_exchange:
            exchange()
        for name, slave in slaves.items():
            for output, value in zip(names[name], slave.get(names[name]), strict=True):
                rows[f"{name}.{output}"].append(float(value))
        if not read_after_exchange:
            exchange()
    for slave in slaves.values():
        slave.close()
    return {name: np.array(values) for name, values in rows.items()}


def run_foreign(
    client: str, chain: Chain, *, fmi: int = 2, kinds: Mapping[str, str] | None = None
) -> dict[str, np.ndarray]:
    """Outputs after every step under a foreign master, which may say nothing but `KNOWN_LIMIT`."""
    task = {
        "paths": {name: str(chain.path(name, fmi, kinds or {})) for name in chain.instances},
        "connections": chain.connections,
        "values": chain.values,
        "outputs": outputs(chain),
        "step": chain.step,
        "count": chain.count,
    }
    result = subprocess.run(
        [sys.executable, str(FOREIGN), client],
        input=json.dumps(task),
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env=environment(),
    )
    said, _, answer = result.stdout.rpartition("\n@")
    text = said + result.stderr
    assert result.returncode == 0, f"{client} ended with {result.returncode}\n{text}"
    complaints = [
        line
        for line in text.splitlines()
        if any(word in line.lower() for word in ("[warn", "[error", "[fatal"))
        and not any(known in line for known in KNOWN_LIMIT)
    ]
    assert not complaints, "\n".join(complaints)
    return {name: np.array(values) for name, values in json.loads(answer).items()}


def assert_agree(found: Mapping[str, np.ndarray], expected: Mapping[str, np.ndarray]) -> None:
    """Equal to 1e-12 of each output's largest value.

    The masters compute the same sums from the same binaries; only the times that they pass differ,
    in the last bit (one counts nanoseconds, one adds steps up), and with them the lengths of the
    internal steps. 1e-12 leaves room for 1000 steps of that; a lost or doubled exchange or tick
    errs by more than 1e-5 here.
    """
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        scale = np.abs(values).max()
        np.testing.assert_allclose(
            found[name], values, rtol=0, atol=1e-12 * scale, err_msg=name, equal_nan=False
        )
    assert sum(np.ptp(values) > 0 for values in expected.values()) >= 10
