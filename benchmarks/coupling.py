"""Error of the coupling against the same equations solved as one, and energy that it invents.

    python -m benchmarks.coupling [SYSTEM ...] [--quick] [--steps SECONDS ...]

For each system: largest error of signals over algorithms and communication steps, the order
measured from step to step, and the energy invented relative to the energy dissipated. The
monolithic solution composes the variants' equations, outputs evaluated in the order of direct
feedthrough, and solves them with SciPy at a relative tolerance of 1e-9.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from cosim.errors import CosimError
from cosim.master import Master
from cosim.provider import FolderProvider
from cosim.system import System
from cosim.system_file import read_system
from sources.function import Functions, build_functions
from sources.model import Model
from sources.variant import build_model

ROOT = Path(__file__).resolve().parents[1]
RASTER = 0.01
Vector = NDArray[np.float64]


class Monolith:
    """The equations of a system as one, for systems without sampled parts."""

    def __init__(self, system: System, inputs: dict[str, float]) -> None:
        self.system = system
        self.models: dict[str, Model] = {}
        self.functions: dict[str, Functions] = {}
        self.start: list[float] = []
        self.scale: list[float] = []
        states: dict[str, Any] = {}
        for member in system.members.values():
            model = build_model(member.description.name)
            if model.of_role("discrete"):
                raise ValueError(f"{member.name} ({member.description.name}) samples")
            self.models[member.name], self.functions[member.name] = model, build_functions(model)
            given = member.parameters
            names = [v.name for v in model.of_role("state")]
            states[member.name] = ca.SX.sym(member.name, len(names))
            self.start += [float(given.get(v.name, v.start)) for v in model.of_role("state")]
            self.scale += [float(v.quantity.nominal or 1.0) for v in model.of_role("state")]
        self.t = ca.SX.sym("t")
        self.known: dict[str, Any] = {}
        self.states = states
        wires = {c.target: c for c in system.connections}
        waiting = {
            f"{name}.{v.name}" for name, m in self.models.items() for v in m.of_role("output")
        }
        while waiting:
            before = len(waiting)
            for name, model in self.models.items():
                u, missing = self._inputs(name, wires, inputs)
                depends = self.functions[name].output_dependencies
                ready = [
                    (i, v.name)
                    for i, v in enumerate(model.of_role("output"))
                    if f"{name}.{v.name}" in waiting and not missing & set(depends[v.name])
                ]
                if ready:
                    _, y = self._call(name, u)
                    for i, output in ready:
                        self.known[f"{name}.{output}"] = y[i]
                        waiting.discard(f"{name}.{output}")
            if len(waiting) == before:
                raise ValueError(f"algebraic loop through {sorted(waiting)[:4]}")
        rates = [self._call(name, self._inputs(name, wires, inputs)[0])[0] for name in self.models]
        x = ca.vertcat(*states.values())
        rate = ca.vertcat(*rates)
        self.rate = ca.Function("rate", [self.t, x], [rate])
        self.jacobian = ca.Function("jacobian", [self.t, x], [ca.jacobian(rate, x)])
        self.x = x

    def _inputs(
        self, name: str, wires: dict[str, Any], inputs: dict[str, float]
    ) -> tuple[list[Any], set[str]]:
        values: list[Any] = []
        missing = set()
        given = self.system.members[name].parameters
        for v in self.models[name].of_role("input"):
            wire = wires.get(f"{name}.{v.name}")
            if wire is None:
                values.append(inputs.get(f"{name}.{v.name}", given.get(v.name, v.start)))
            elif wire.source in self.known:
                values.append(self.known[wire.source] * wire.gain + wire.offset)
            else:
                values.append(0.0)
                missing.add(v.name)
        return values, missing

    def _call(self, name: str, u: list[Any]) -> tuple[Any, Any]:
        given = self.system.members[name].parameters
        p = [float(given.get(v.name, v.start)) for v in self.models[name].of_role("parameter")]
        column = ca.vertcat(*u) if u else ca.SX(0, 1)
        parameters = ca.DM(p) if p else ca.DM(0, 1)
        rate, y = self.functions[name].outputs(
            self.t, self.states[name], ca.DM(0, 1), column, parameters
        )
        return rate, y

    def solve(self, times: Vector, signals: Sequence[str], rtol: float = 1e-9) -> Vector:
        """Signals at these times."""
        found = solve_ivp(
            lambda t, x: np.asarray(self.rate(t, x)).ravel(),
            (float(times[0]), float(times[-1])),
            self.start,
            method="Radau",
            t_eval=times,
            rtol=rtol,
            atol=1e-3 * rtol * np.array(self.scale),
            jac=lambda t, x: np.asarray(self.jacobian(t, x)),
            max_step=RASTER,
        )
        if not found.success:
            raise ValueError(found.message)
        wanted = ca.vertcat(*[self.known[signal] for signal in signals])
        outputs = ca.Function("y", [self.t, self.x], [wanted])
        states = zip(times, found.y.T, strict=True)
        return np.array([np.asarray(outputs(t, x)).ravel() for t, x in states])


@dataclass(frozen=True)
class Case:
    """What is run of a system; `swap` replaces sampled variants by those in continuous time."""

    duration: float
    signals: dict[str, float]
    inputs: dict[str, float] = field(default_factory=dict)
    swap: dict[str, str] = field(default_factory=dict)
    drop: tuple[str, ...] = ()
    steps: tuple[float, ...] = (2e-3, 1e-3, 5e-4)


CASES = {
    "motor_bench": Case(
        0.5,
        {"load.w": 0.15, "motor.i": 0.06},
        {"motor.w_ref": 40.0},
        {"motor": "dc_motor.lab_bench/electrical"},
        ("encoder",),
        (2e-3, 1e-3, 5e-4, 1e-4),
    ),
    "ur5_bench": Case(2.0, {"arm.q[1]": 5e-4, "arm.q[2]": 5e-4, "drive.i[2]": 0.06}),
    "mir250": Case(2.0, {"base.x": 3e-4, "base.phi": 5e-4, "motor_left.i": 0.06}),
    "mobile_manipulator": Case(1.0, {"base.x": 3e-4, "base.phi": 5e-4, "arm.q[2]": 5e-4}),
}
"""Signals with the noise of their sensors, one tenth of which is what coupling may add."""
ALGORITHMS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("jacobi", {}),
    ("gauss_seidel", {}),
    ("jacobi", {"extrapolation": 1}),
    ("gauss_seidel", {"extrapolation": 1}),
    ("iterated", {}),
)


def build(name: str, case: Case) -> System:
    """The system of a case, without sampled parts that nothing depends on."""
    document = read_system(ROOT / "scenarios" / "systems" / f"{name}.toml")
    system = System(name, FolderProvider(ROOT / "fmus"))
    drivers = {wire.source.partition(".")[0] for wire in document.connections}
    for instance, reference in document.instances.items():
        ends = instance not in drivers and build_model(reference).of_role("discrete")
        if instance not in case.drop and not ends:
            system.add(instance, case.swap.get(instance, reference))
    for key, value in document.parameters.items():
        if key.partition(".")[0] in system.members:
            system.set(key, value)
    for wire in document.connections:
        if all(end.partition(".")[0] in system.members for end in (wire.source, wire.target)):
            system.connect(
                wire.source, wire.target, factor=wire.factor, offset=wire.offset,
                convert=wire.convert,
            )  # fmt: skip
    return system


def table(name: str, case: Case, quick: bool = False) -> None:
    """Print the table of a system."""
    system = build(name, case)
    signals = list(case.signals)
    times = RASTER * np.arange(round(case.duration / RASTER) + 1, dtype=np.float64)
    begin = time.perf_counter()
    try:
        exact = Monolith(system, case.inputs).solve(times, signals)
        how = "monolithic solution"
    except ValueError as error:
        fine = Master(system, "jacobi", 2e-5, options={"extrapolation": 1})
        exact = fine.run(
            case.duration, inputs=case.inputs, record=signals, every=round(RASTER / 2e-5)
        ).values
        how = f"own solution at 20 µs, since there is no monolithic one: {error}"
    print(f"\n{name}, {case.duration:g} s, against the {how} ({time.perf_counter() - begin:.1f} s)")
    head = "".join(f"{signal:>16s}" for signal in signals)
    print(f"{'algorithm':<26s}{'step':>8s}{head}{'order':>7s}{'energy':>10s}{'run s':>8s}")
    losses = [f"{n}.P_loss" for n, m in system.members.items()
              if "P_loss" in m.description.variables]  # fmt: skip
    for algorithm, options in ALGORITHMS[: 3 if quick else None]:
        label = algorithm + "".join(f" {k} {v}" for k, v in options.items())
        last: tuple[float, Vector] | None = None
        for h in case.steps:
            begin = time.perf_counter()
            try:
                run = Master(system, algorithm, h, options=options).run(
                    case.duration, inputs=case.inputs, record=[*signals, *losses],
                    every=round(RASTER / h),
                )  # fmt: skip
            except CosimError as error:
                print(f"{label:<26s}{h * 1e3:>6g}ms  {str(error).splitlines()[0][:90]}")
                continue
            cost = time.perf_counter() - begin
            errors = np.max(np.abs(run.values[:, : len(signals)] - exact), axis=0)
            lost = float(np.sum(np.trapezoid(run.values[:, len(signals) :], run.time, axis=0)))
            energy = sum(run.bond_energy.values()) / lost if lost else np.nan
            order = "-"
            if last is not None:
                slope = np.log(last[1] / errors) / np.log(last[0] / h)
                order = f"{float(np.mean(slope)):.2f}"
            columns = "".join(
                f"{e:>15.2e}{'*' if e < 0.1 * case.signals[s] else ' '}"
                for e, s in zip(errors, signals, strict=True)
            )
            print(f"{label:<26s}{h * 1e3:>6g}ms{columns}{order:>7s}{energy:>10.1e}{cost:>8.2f}")
            last = (h, errors)
    print("* below one tenth of the sensor's noise")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("systems", nargs="*", choices=[*CASES, []])
    parser.add_argument("--quick", action="store_true", help="fewer algorithms")
    parser.add_argument("--steps", type=float, nargs="+", help="communication steps [s]")
    arguments = parser.parse_args()
    for name in arguments.systems or CASES:
        case = CASES[name]
        if arguments.steps:
            case = replace(case, steps=tuple(arguments.steps))
        table(name, case, arguments.quick)


if __name__ == "__main__":
    main()
