"""The same systems with FMUs of FMI 2 and of FMI 3: error, order, cost of a communication step.

    python -m benchmarks.versions [CASE ...] [--duration SECONDS]

Cases are those of `benchmarks.coupling`. Inputs move within a step by derivatives that the FMUs are
told (FMI 2), because the FMUs ask for them (FMI 3, intermediate update), or not at all (FMI 3 of
the same FMUs that do not declare it), at last with inner steps. Errors are the largest over the
time given, against the system's own solution with FMI 2 at 50 us (`benchmarks.coupling` says how
exact that is); cost is the least processor time of several runs; the last column is how far FMI 3
is from FMI 2, in the same units.
"""

from __future__ import annotations

import argparse
import re
import tempfile
import time
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.coupling import FINE, Case, errors, motor_bench, of_scenario, run, signals_of
from cosim.master.master import Master
from cosim.master.session import Session
from cosim.spec.archive import pack
from cosim.spec.cache import cache_folder
from cosim.system.system import System
from sources.packaging.build import build

CASES = ("motor_bench", "mir250/CN1", "mobile_manipulator/IY", "ur5_bench/UR5e", "omni_base/open")
OUT = cache_folder() / "versions"
REPEATS = 5
INNER = 4
"""Inner steps in the last rows."""


def undeclared(path: Path, folder: Path) -> Path:
    """A copy of an FMU of FMI 3 that does not say that it asks for inputs."""
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    text = files["modelDescription.xml"].decode()
    files["modelDescription.xml"] = re.sub(
        r' (providesIntermediateUpdate|intermediateUpdate)="true"', "", text
    ).encode()
    copy = folder / path.name
    copy.write_bytes(pack(files))
    return copy


def with_fmus(system: System, of: Callable[[str], Path]) -> System:
    """The system with other FMUs of the same variants."""
    found = System(system.name, system.provider)
    for member in system.members.values():
        found.add(member.name, str(of(member.description.name)), member.parameters)
    for wire in system.connections:
        found.connect(wire.source, wire.target, factor=wire.gain, offset=wire.offset, convert=False)
    return found


def versions(system: System, folder: Path) -> dict[str, System]:
    """The system with FMUs of each kind."""

    def third(variant: str) -> Path:
        return build(variant, out=OUT, fmi=3)

    return {
        "FMI 2": with_fmus(system, lambda variant: build(variant, out=OUT)),
        "FMI 3": with_fmus(system, third),
        "FMI 3, held": with_fmus(system, lambda variant: undeclared(third(variant), folder)),
    }


def inner(system: System, count: int) -> dict[str, int]:
    """So many inner steps of all whose inputs cannot move."""
    return {
        name: count
        for name, member in system.members.items()
        if not any(member.description.moves(v) for v in member.description.of("input"))
    }


def cost(case: Case, algorithm: str, options: dict[str, Any], step: float) -> float:
    """Least processor time of a communication step [s]."""
    master = Master(case.system, algorithm, step, options=options)
    settings = {"inputs": case.inputs, "record": signals_of(case)[:1]}
    with Session(master, case.duration, **settings) as session:  # type: ignore[arg-type]
        best = np.inf
        for _ in range(REPEATS):
            begin = time.process_time()
            session.run()
            best = min(best, time.process_time() - begin)
    return float(best) / round(case.duration / step)


def table(name: str, case: Case, folder: Path) -> None:
    """Print the table of a case."""
    signals = signals_of(case)
    exact = run(case, "gauss_seidel", {"extrapolation": 2}, FINE, signals)[0].values
    algorithm, options, usual = case.usual or ("gauss_seidel", {"extrapolation": 2}, 1e-3)
    if not options.get("extrapolation"):
        algorithm, options = "gauss_seidel", {"extrapolation": 2}
    print(f"\n{name}, {case.duration:g} s, {algorithm} {dict(options)}")
    head = "".join(f"{column.title:>16s}" for column in case.columns)
    print(f"  {'FMUs':<14s}{'step':>8s}{head}{'order':>7s}{'us/step':>9s}{'from FMI 2':>12s}")
    steps = [step for step in case.steps if step <= 2 * usual]
    second = {}
    rows = [(label, system, 1) for label, system in versions(case.system, folder).items()]
    rows.append((f"held, {INNER} inner", rows[-1][1], INNER))
    plain = dict(options)
    for label, system, count in rows:
        other, last = replace(case, system=system), None
        options = plain if count == 1 else {**plain, "inner_steps": inner(system, count)}
        for step in steps:
            values = run(other, algorithm, options, step, signals)[0].values
            apart = errors(case, signals, values, exact)
            order = "-"
            if last is not None and apart.all():
                order = f"{float(np.mean(np.log(last / apart) / np.log(2.0))):.1f}"
            second.setdefault(step, values)
            away = max(errors(case, signals, values, second[step]))
            spent = cost(other, algorithm, dict(options), step) * 1e6
            columns = "".join(f"{error:>16.2e}" for error in apart)
            print(
                f"  {label:<14s}{step * 1e3:>6g}ms{columns}{order:>7s}{spent:>9.2f}{away:>12.1e}",
                flush=True,
            )
            last = apart


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", help=", ".join(CASES))
    parser.add_argument("--duration", type=float, default=2.0, help="at most [s]")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name in arguments.cases or CASES:
            case = motor_bench() if name == "motor_bench" else of_scenario(name)
            case = replace(case, duration=min(case.duration, arguments.duration))
            table(name, case, Path(folder))


if __name__ == "__main__":
    main()
