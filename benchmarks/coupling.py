"""Error of the coupling against the same equations solved as one, and energy that it invents.

    python -m benchmarks.coupling [CASE ...] [--quick] [--steps SECONDS ...] [--solver-step SECONDS]

A case is `motor_bench` (its system with a motor in continuous time) or a run of a scenario as it is
(`mobile_manipulator/IY`). Its table has, over algorithms and communication steps, the largest error
of positions, heading and currents, the order measured from step to step, the energy invented
relative to the energy dissipated, and how many times faster than real time it ran (processor time
of one core). The line with an arrow is the scenario's own algorithm and step.

The reference is the monolithic solution: the variants' equations composed, outputs in the order of
direct feedthrough, solved with SciPy's Radau at a relative tolerance of 1e-9. Runs of a scenario
are long; there it is the system's own solution at 50 us, and the first line says how far that is
from the monolithic one over the first two seconds (over the whole run with --whole, which takes a
minute for some runs and hours for others). `mir250_parts`, the base in parts, is compared with the
packed base: with `mobile_base/planar` in `mir250`, which has the same equations.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.monolith import Monolith
from cosim.data.recording import Recording
from cosim.data.signals import Constant
from cosim.errors import CosimError
from cosim.installation.builder import default_provider
from cosim.master.master import Master
from cosim.master.session import Session
from cosim.scenario import scenario as scenarios
from cosim.spec.units import conversion, parse
from cosim.system.inputs import Driver, spread
from cosim.system.system import System
from cosim.system.toml import read_system
from cosim.system.variants import apply
from sources.variant import build_model

ROOT = Path(__file__).resolve().parents[1]
FINE = 5e-5
"""Step of the system's own reference [s]."""
Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Column:
    """Signals whose largest error makes one column.

    Attributes:
        title: with the unit that is shown.
        signals: full names.
        scale: from the signals' unit to the one that is shown.
        allowed: error that coupling may add, one tenth of the sensor's noise, as shown.
    """

    title: str
    signals: tuple[str, ...]
    scale: float
    allowed: float


@dataclass(frozen=True)
class Case:
    """What is run of a system.

    Attributes:
        system: without sampled parts that nothing depends on.
        duration: [s].
        columns: what is compared.
        inputs: of open inputs.
        usual: algorithm, options and step of the scenario.
        steps: communication steps [s].
        long: the reference is the system's own solution.
        checked: time over which that is compared with the monolithic one [s].
        packed: case that stands for this one where it is solved as one or with a fine step, None:
            itself; its columns are this one's.

    Errors are taken at the communication points of the longest step.
    """

    system: System
    duration: float
    columns: tuple[Column, ...]
    inputs: Mapping[str, Driver] = field(default_factory=dict)
    usual: tuple[str, Mapping[str, Any], float] | None = None
    steps: tuple[float, ...] = (2e-3, 1e-3, 5e-4, 2.5e-4)
    long: bool = False
    checked: float = 2.0
    packed: Case | None = None

    @property
    def raster(self) -> float:
        """Instants at which errors are taken [s]."""
        return max(self.steps)


ALGORITHMS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("jacobi", {}),
    ("gauss_seidel", {}),
    ("jacobi", {"extrapolation": 1}),
    ("gauss_seidel", {"extrapolation": 1}),
    ("gauss_seidel", {"extrapolation": 2}),
    ("iterated", {}),
)
PARTS_ALGORITHMS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("gauss_seidel", {}),
    ("gauss_seidel", {"extrapolation": 1}),
    ("gauss_seidel", {"extrapolation": 2}),
    ("iterated", {"interpolation": 1, "tolerance": 1e-4}),
)
RUNS = tuple(
    ["ur5_bench/UR5e"]
    + [f"mir250/{run}" for run in ("IN1", "IN2", "CN1", "CN2")]
    + [f"mobile_manipulator/{run}" for run in ("IN1", "IN2", "CN1", "CN2", "IY", "CY")]
    + [f"mir250_parts/CN1+{law}" for law in ("stick_slip", "brush", "creep")]
    + [f"omni_base/{run}" for run in ("open", "closed", "closed_scrub", "eight")]
    + [f"crawler/SET{n}_1" for n in range(1, 6)]
)


def motor_bench() -> Case:
    """The motor bench with the motor that is not sampled, at its own values."""
    document = read_system(ROOT / "scenarios" / "systems" / "motor_bench.toml")
    motor = {"motor": "dc_motor.lab_bench/electrical"}
    document = replace(document, instances={**document.instances, **motor})
    columns = (
        Column("load [rad/s]", ("load.w",), 1.0, 0.015),
        Column("current [mA]", ("motor.i",), 1e3, 6.0),
    )
    system = unsampled(document.build(default_provider()))
    return Case(system, 0.5, columns, {"motor.w_ref": 40.0})


def of_scenario(name: str, variants: Mapping[str, str] | None = None) -> Case:
    """A run of a scenario as it is, but for these variants."""
    file, run = scenarios.find(name, None)
    item = file.scenario(run)
    provider = default_provider()
    changes = {**item.variants, **(variants or {})}
    instances = apply(item.system.instances, changes, provider, item.folder)
    system = replace(item.system, instances=instances, parameters={}).build(provider)
    for key, value in {**item.system.parameters, **item.parameters}.items():
        system.set(key, value)
    system = unsampled(system)
    usual = (item.algorithm, item.options, item.step)
    steps = tuple(item.step * factor for factor in (2.0, 1.0, 0.5, 0.25))
    # windings make the equations stiff: solved as one, a whole run takes up to hours
    long = bool({"motor_left", "arm"} & set(system.members))
    return Case(
        system, item.duration, columns_of(system), spread(system, item.inputs), usual, steps, long
    )


def in_parts(name: str) -> Case:
    """A run of `mir250_parts` with a friction law, e.g. `mir250_parts/CN1+brush`."""
    run, _, law = name.partition("+")
    caster = "creep" if law == "creep" else "swivel"
    case = of_scenario(run, {"wheel_contact": law, "caster": caster})
    steps = (2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4)
    if law == "creep":  # 1e6 N per m/s: a step control inside is noise on which nothing settles
        steps = (2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5)
        for name, member in case.system.members.items():
            if member.description.name.startswith(("wheel_contact/", "caster/")):
                case.system.set(f"{name}.solver.method", 2)  # rodas3 with a fixed step
                case.system.set(f"{name}.solver.step", 5e-5)
    document = read_system(ROOT / "scenarios" / "systems" / "mir250.toml")
    base = f"mobile_base/planar[wheel_contact={law},caster={caster}]"
    path = case.system.members["path"]
    instances = {**document.instances, "base": base, "path": path.reference}
    system = unsampled(replace(document, instances=instances).build(default_provider()))
    for key, value in path.parameters.items():
        system.set(f"path.{key}", value)
    inputs = {f"base.{key.partition('.')[2]}": value for key, value in case.inputs.items()}
    packed = replace(case, system=system, columns=columns_of(system), inputs=inputs)
    # rest, start and 2 s of the arc
    return replace(case, duration=4.0, packed=packed, steps=steps)


def columns_of(system: System) -> tuple[Column, ...]:
    """What is compared, by the components that the system has."""
    columns: list[Column] = []
    names = ("base", "body", "constant", "law", "skid", "contact")  # the last four are crawlers
    poses = [pose(system, name) for name in names if name in system.members]
    if poses:
        positions = tuple(signal for x, y, _ in poses for signal in (x, y))
        columns = [
            Column("x, y [mm]", positions, 1e3, 0.03),
            Column("heading [mrad]", tuple(angle for _, _, angle in poses), 1e3, 0.05),
        ]
    if "motor_left" in system.members:
        columns.append(Column("motors [mA]", ("motor_left.i", "motor_right.i"), 1e3, 6.0))
    if "arm" in system.members:
        tool = tuple(f"arm.tool_position[{i}]" for i in range(1, 4))
        columns.append(Column("tool [mm]", tool, 1e3, 0.03))
        arm = tuple(f"drive.i[{i}]" for i in range(1, 7))
        columns.append(Column("arm [mA]", arm, 1e3, 6.0))
    return tuple(columns)


def pose(system: System, name: str) -> tuple[str, str, str]:
    """Names of the outputs that are a base's position and heading."""
    have = system.members[name].description.variables
    names = (("x", "x_S"), ("y", "y_S"), ("phi", "theta", "beta"))
    x, y, angle = (next(f"{name}.{n}" for n in choice if n in have) for choice in names)
    return x, y, angle


def unsampled(system: System) -> System:
    """The system without sampled parts that nothing depends on (sensors with a rate)."""
    drivers = {wire.source.partition(".")[0] for wire in system.connections}
    kept = [
        member
        for name, member in system.members.items()
        if name in drivers or not build_model(member.description.name).of_role("discrete")
    ]
    found = System(system.name, system.provider)
    for member in kept:
        found.add(member.name, member.reference, member.parameters)
    for wire in system.connections:
        if wire.target.partition(".")[0] in found.members:
            # factors of unit conversions are in the gain already
            found.connect(
                wire.source, wire.target, factor=wire.gain, offset=wire.offset, convert=False
            )
    return found


def limit_solvers(system: System, step: float) -> None:
    """Let the solvers inside the FMUs make steps up to this long [s], where they have steps."""
    for name, member in system.members.items():
        if "solver.step" in member.description.variables:
            system.set(f"{name}.solver.step", step)


def constants(system: System, inputs: Mapping[str, Driver]) -> dict[str, float]:
    """Inputs as numbers in the units of the FMUs, for the monolithic solution."""
    found = {}
    for name, driver in inputs.items():
        signal = Constant(float(driver)) if isinstance(driver, int | float) else driver
        if not isinstance(signal, Constant):
            raise ValueError(f"{name} is not constant")
        gain, offset = 1.0, 0.0
        if signal.unit:
            gain, offset = conversion(parse(signal.unit), parse(system.unit(name)))
        found[name] = signal.value * gain + offset
    return found


def signals_of(case: Case) -> list[str]:
    """What is compared."""
    return [signal for column in case.columns for signal in column.signals]


def reference(case: Case) -> tuple[Vector, str]:
    """Signals on the raster, and how they were found."""
    if case.packed is not None:
        values, text = reference(replace(case.packed, duration=case.duration, steps=case.steps))
        return values, text.replace("its own", "the packed base's")
    begin, signals = time.process_time(), signals_of(case)
    raster = case.raster
    times = raster * np.arange(round(case.duration / raster) + 1, dtype=np.float64)
    if not case.long:
        exact = Monolith(case.system, constants(case.system, case.inputs)).solve(times, signals)
        return exact, f"the monolithic solution ({time.process_time() - begin:.0f} s)"
    fine = run(case, "gauss_seidel", {"extrapolation": 2}, FINE, signals)[0].values
    checked = min(case.checked, case.duration)
    count = round(checked / raster) + 1
    text = "its own solution at 50 us"
    try:
        monolith = Monolith(case.system, constants(case.system, case.inputs))
        exact = monolith.solve(times[:count], signals)
    except ValueError as error:
        return fine, f"{text}; no monolithic one: {error}"
    apart = errors(case, signals, fine[:count], exact)
    told = ", ".join(f"{e:.1e} {c.title}" for e, c in zip(apart, case.columns, strict=True))
    return fine, f"{text}, which is {told} from the monolithic one over {checked:g} s"


def errors(case: Case, signals: list[str], values: Vector, exact: Vector) -> Vector:
    """Largest error per column."""
    apart = np.max(np.abs(values - exact), axis=0)
    return np.array(
        [c.scale * max(apart[signals.index(name)] for name in c.signals) for c in case.columns]
    )


def run(
    case: Case, algorithm: str, options: Mapping[str, Any], step: float, signals: list[str]
) -> tuple[Recording, float]:
    """Recording on the raster, and processor time without set-up [s]."""
    master = Master(case.system, algorithm, step, options=options)
    every = round(case.raster / step)
    recording = master.run(case.duration, inputs=case.inputs, record=signals, every=every)
    with Session(master, case.duration, inputs=case.inputs, record=signals, every=every) as session:
        session.run()
        begin = time.process_time()
        session.run()
        return recording, time.process_time() - begin


def table(name: str, case: Case, quick: bool = False) -> None:
    """Print the table of a case."""
    exact, how = reference(case)
    print(f"\n{name}, {case.duration:g} s, against {how}")
    algorithms = ALGORITHMS if case.packed is None else PARTS_ALGORITHMS
    width = max(28, *(len(_called(*item)) for item in algorithms))
    head = "".join(f"{column.title:>16s}" for column in case.columns)
    print(f"  {'algorithm':<{width}s}{'step':>8s}{head}{'order':>7s}{'energy':>10s}{'x real':>8s}")
    if case.packed is not None:
        print("  the packed base:")
        packed = replace(case.packed, duration=case.duration, steps=case.steps)
        _line(packed, exact, "gauss_seidel", {"extrapolation": 2}, 1e-3, width, None)
        print("  in parts:")
    for algorithm, options in algorithms:
        if algorithm == "iterated" and (quick or (case.long and case.packed is None)):
            continue  # decides in Python: minutes
        last: tuple[float, Vector] | None = None
        # what is repeated costs most where it is needed least
        steps = case.steps[:3] if case.packed and algorithm == "iterated" else case.steps
        for step in steps:
            last = _line(case, exact, algorithm, options, step, width, last)
    print("* below one tenth of the sensor's noise")


def _called(algorithm: str, options: Mapping[str, Any]) -> str:
    return algorithm + "".join(f" {k} {v:g}" for k, v in options.items())


def _line(
    case: Case,
    exact: Vector,
    algorithm: str,
    options: Mapping[str, Any],
    step: float,
    width: int,
    last: tuple[float, Vector] | None,
) -> tuple[float, Vector] | None:
    """Print the line of an algorithm and step; the step and its errors, None if it did not run.

    Args:
        case, exact: what is run, and what it is compared with.
        algorithm, options, step: of the run.
        width: of the algorithm's column.
        last: step and errors of the line before, for the order.
    """
    signals = signals_of(case)
    losses = [f"{n}.P_loss" for n, m in case.system.members.items()
              if "P_loss" in m.description.variables]  # fmt: skip
    own = case.usual == (algorithm, options, step)
    label = f"{'>' if own else ' '} {_called(algorithm, options):<{width}s}{step * 1e3:>6g}ms"
    try:
        found, cost = run(case, algorithm, options, step, [*signals, *losses])
    except CosimError as error:
        print(f"{label}  {str(error).splitlines()[0][:90]}")
        return None
    apart = errors(case, signals, found.values[:, : len(signals)], exact)
    lost = float(np.sum(np.trapezoid(found.values[:, len(signals) :], found.time, axis=0)))
    energy = sum(found.bond_energy.values()) / lost if lost else np.nan
    order = "-"
    if last is not None:
        slope = np.log(last[1] / apart) / np.log(last[0] / step)
        order = f"{float(np.mean(slope)):.1f}"
    columns = "".join(
        f"{e:>15.2e}{'*' if e < column.allowed else ' '}"
        for e, column in zip(apart, case.columns, strict=True)
    )
    speed = case.duration / cost
    print(f"{label}{columns}{order:>7s}{energy:>10.1e}{speed:>8.0f}", flush=True)
    return step, apart


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", help=f"of motor_bench, {', '.join(RUNS)}")
    parser.add_argument("--quick", action="store_true", help="without iterated coupling")
    parser.add_argument("--whole", action="store_true", help="check references to their ends")
    parser.add_argument("--steps", type=float, nargs="+", help="communication steps [s]")
    parser.add_argument("--solver-step", type=float, help="longest step of solvers inside [s]")
    arguments = parser.parse_args()
    for name in arguments.cases or ("motor_bench", *RUNS):
        case = motor_bench() if name == "motor_bench" else None
        case = case or (in_parts if name.startswith("mir250_parts") else of_scenario)(name)
        if arguments.steps:
            case = replace(case, steps=tuple(arguments.steps))
        if arguments.solver_step:
            limit_solvers(case.system, arguments.solver_step)
        if arguments.whole:
            case = replace(case, checked=case.duration)
        table(name, case, arguments.quick)


if __name__ == "__main__":
    main()
