"""The work of `benchmarks.masters`: a chain of drives, and the clients that run it.

Run as a script this file is one client in a process of its own: it reads step counts from stdin,
runs the chain that long from the start, and answers with one line of JSON (CPU and wall time of the
steps alone, and the final speeds).
"""

from __future__ import annotations

import argparse
import ctypes as ct
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

DRIVES = 4
STEP = 1e-4
EVERY = 100
SPEEDS = [f"load{k + 1}.w" for k in range(DRIVES)]
FINAL = [*SPEEDS, *(f"load{k + 1}.phi" for k in range(DRIVES))]
RECORD = [*FINAL, "motor1.i", "motor2.i"]
PARAMETER_SET = "parameters"

FLOOR = r"""
/* What one writes by hand for one system: the same calls of the same FMUs, nothing configurable.
   Of the two ways to nest the loops (all calls of one FMU, or one call of all FMUs) the faster. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define N 12
#if FMI == 2
typedef int (*Set)(void *, const uint32_t *, size_t, const double *);
typedef int (*Get)(void *, const uint32_t *, size_t, double *);
typedef int (*Step)(void *, double, double, int);
#else
typedef int (*Set)(void *, const uint32_t *, size_t, const double *, size_t);
typedef int (*Get)(void *, const uint32_t *, size_t, double *, size_t);
typedef int (*Step)(void *, double, double, bool, bool *, bool *, bool *, double *);
#endif

typedef struct {
  void *c;
  Set set;
  Get get;
  Step step;
  const uint32_t *u_ref, *y_ref;
  int64_t first_u, n_u, first_y, n_y;
} Slave;

__attribute__((visibility("default")))
int run(const Slave *s, double *u, double *y, const int64_t *source, const int64_t *target,
        int64_t n_wires, const int64_t *recorded, int64_t n_recorded, double *rows, double h,
        int64_t n, int64_t every) {
  for (int64_t k = 0; k < n; k++) {
    if (k % every == 0)
      for (int64_t i = 0; i < n_recorded; i++) *rows++ = y[recorded[i]];
    for (int64_t i = 0; i < n_wires; i++) u[target[i]] = y[source[i]];
#if FMI == 2
    for (int i = 0; i < N; i++)
      if (s[i].set(s[i].c, s[i].u_ref, s[i].n_u, u + s[i].first_u) > 1) return -1;
    for (int i = 0; i < N; i++)
      if (s[i].step(s[i].c, k * h, h, 1) > 1) return -2;
    for (int i = 0; i < N; i++)
      if (s[i].get(s[i].c, s[i].y_ref, s[i].n_y, y + s[i].first_y) > 1) return -3;
#else
    bool event, stop, early;
    double last;
    for (int i = 0; i < N; i++)
      if (s[i].set(s[i].c, s[i].u_ref, s[i].n_u, u + s[i].first_u, s[i].n_u) > 1) return -1;
    for (int i = 0; i < N; i++)
      if (s[i].step(s[i].c, k * h, h, true, &event, &stop, &early, &last) > 1 || stop) return -2;
    for (int i = 0; i < N; i++)
      if (s[i].get(s[i].c, s[i].y_ref, s[i].n_y, y + s[i].first_y, s[i].n_y) > 1) return -3;
#endif
  }
  return 0;
}
"""


def add_drives(system: Any, count: int, motor: str) -> None:
    """Add drives to a system: motor, gearbox, disc; each motor follows the disc before it."""
    for k in range(1, count + 1):
        system.add(f"motor{k}", f"dc_motor/{motor}", {"w_ref": 20.0})
        system.add(f"gearbox{k}", "gearbox/ratio")
        system.add(f"load{k}", "inertia/disc")
        system.connect(f"motor{k}.tau", f"gearbox{k}.tau_a")
        system.connect(f"gearbox{k}.w_a", f"motor{k}.w")
        system.connect(f"gearbox{k}.tau_b", f"load{k}.tau")
        system.connect(f"gearbox{k}.J_b", f"load{k}.J_added")
        system.connect(f"load{k}.w", f"gearbox{k}.w_b")
        if k > 1:
            system.connect(f"load{k - 1}.w", f"motor{k}.w_ref")


def build_chain(fmi: int, motor: str, out: Path) -> Any:
    """Four drives: motor, gearbox, disc; each motor follows the speed of the disc before it."""
    from cosim import System
    from sources.packaging.build import build

    class Built:
        def path(self, variant: str) -> Path:
            return build(variant, out=out, fmi=fmi)  # type: ignore[arg-type]

    system = System("chain", Built(), "four drives, each following the one before")
    add_drives(system, DRIVES, motor)
    return system


class Answer(dict[str, Any]):
    """Times and final values of one run."""


def _answer(cpu: float, wall: float, count: int, final: list[float]) -> Answer:
    return Answer(cpu=cpu, wall=wall, steps=count, final=final)


class Clock:
    """CPU and wall time since its creation."""

    def __init__(self) -> None:
        self.cpu, self.wall = time.process_time(), time.perf_counter()

    def spent(self) -> tuple[float, float]:
        """CPU time of all threads, and wall time [s]."""
        return time.process_time() - self.cpu, time.perf_counter() - self.wall


# -- clients ---------------------------------------------------------------------------------------


def ours(path: Path, executor: str) -> Callable[[int], Answer]:
    """Our master. Steps are timed from the first report of progress on, so without set-up."""
    from cosim import Master, ssp

    system = ssp.read(path)
    master = Master(system, "jacobi", STEP, executor=executor)

    def run(count: int) -> Answer:
        marks: list[tuple[float, float, float]] = []

        def note(fraction: float) -> None:
            marks.append((fraction, time.process_time(), time.perf_counter()))

        # our last step ends at the end of the run, the others' by rounding beside it
        more = count + 1
        recording = master.run(more * STEP, record=RECORD, every=EVERY, progress=note)
        (f0, c0, w0), (f1, c1, w1) = marks[0], marks[-2]
        timed = round((f1 - f0) * more)
        return _answer(
            (c1 - c0) * count / timed, (w1 - w0) * count / timed, count,
            recording.values[count // EVERY, : len(FINAL)].tolist(),
        )  # fmt: skip

    return run


class _Slave(ct.Structure):
    _fields_ = (
        ("c", ct.c_void_p), ("set", ct.c_void_p), ("get", ct.c_void_p), ("step", ct.c_void_p),
        ("u_ref", ct.c_void_p), ("y_ref", ct.c_void_p), ("first_u", ct.c_int64),
        ("n_u", ct.c_int64), ("first_y", ct.c_int64), ("n_y", ct.c_int64),
    )  # fmt: skip


def _compile(folder: Path, fmi: int) -> Any:
    from sources.packaging.platforms import PLATFORMS, host_platform

    source, library = folder / "floor.c", folder / "floor.so"
    source.write_text(FLOOR, encoding="utf-8")
    subprocess.run(
        [sys.executable, "-m", "ziglang", "cc", "-target", PLATFORMS[host_platform()].target, "-O2",
         f"-DFMI={fmi}", "-shared", "-fPIC", "-ffp-contract=off", "-o", str(library), str(source)],
        check=True,
    )  # fmt: skip
    return ct.CDLL(str(library))


def floor(path: Path, _: str) -> Callable[[int], Answer]:
    """The loop in C, compiled now; only set-up and initialization go through cosim."""
    from cosim import Instance, ssp

    system = ssp.read(path)
    members = list(system.members.values())
    fmi = members[0].description.fmi
    holder = tempfile.TemporaryDirectory()
    library = _compile(Path(holder.name), fmi)
    inputs = {m.name: [c.target for c in system.connections if c.target.startswith(m.name + ".")]
              for m in members}  # fmt: skip
    wanted = {c.source for c in system.connections} | set(RECORD)
    outputs = {m.name: sorted(n for n in wanted if n.startswith(m.name + ".")) for m in members}
    u_names = [name for m in members for name in inputs[m.name]]
    y_names = [name for m in members for name in outputs[m.name]]
    integers = {
        "source": [y_names.index(c.source) for c in system.connections],
        "target": [u_names.index(c.target) for c in system.connections],
        "recorded": [y_names.index(name) for name in RECORD],
    }
    arrays = {key: np.array(value, dtype=np.int64) for key, value in integers.items()}

    def run(count: int) -> Answer:
        u, y = np.zeros(len(u_names)), np.zeros(len(y_names))
        slaves = (_Slave * len(members))()
        instances, blocks = [], []
        for k, member in enumerate(members):
            instance = Instance(member.fmu, member.name)
            instance.set(member.parameters)
            instance.enter_initialization(0.0, count * STEP)
            first_u, first_y = (len([n for m in members[:k] for n in table[m.name]])
                                for table in (inputs, outputs))  # fmt: skip
            given = instance.block([n.partition(".")[2] for n in inputs[member.name]],
                                   u[first_u : first_u + len(inputs[member.name])])  # fmt: skip
            got = instance.block([n.partition(".")[2] for n in outputs[member.name]],
                                 y[first_y : first_y + len(outputs[member.name])])  # fmt: skip
            call, real = f"fmi{fmi}", "Real" if fmi == 2 else "Float64"
            slaves[k] = _Slave(
                instance.address, instance.functions[f"{call}Set{real}"],
                instance.functions[f"{call}Get{real}"], instance.functions[f"{call}DoStep"],
                given.parts[0].references.ctypes.data, got.parts[0].references.ctypes.data,
                first_u, len(given.names), first_y, len(got.names),
            )  # fmt: skip
            instances.append(instance)
            blocks.append((given, got))
        for given, _got in blocks:
            given.get()
        for _ in range(20):  # more than the longest way through the chain
            for _given, got in blocks:
                got.get()
            u[arrays["target"]] = y[arrays["source"]]
            for given, _got in blocks:
                given.set()
        for instance, (_given, got) in zip(instances, blocks, strict=True):
            instance.exit_initialization()
            got.get()
        rows = np.zeros(((count - 1) // EVERY + 1, len(RECORD)))
        pointers = [a.ctypes.data for a in (u, y, arrays["source"], arrays["target"])]
        clock = Clock()
        status = library.run(
            slaves, *map(ct.c_void_p, pointers), ct.c_int64(len(u_names)),
            ct.c_void_p(arrays["recorded"].ctypes.data), ct.c_int64(len(RECORD)),
            ct.c_void_p(rows.ctypes.data), ct.c_double(STEP), ct.c_int64(count), ct.c_int64(EVERY),
        )  # fmt: skip
        spent = clock.spent()
        if status:
            raise RuntimeError(f"the C loop ended with {status}")
        final = [float(y[y_names.index(name)]) for name in FINAL]
        for instance in instances:
            instance.free()
        return _answer(*spent, count, final)

    return run


def fmpy_loop(path: Path, _: str) -> Callable[[int], Answer]:
    """A loop in Python over FMPy's wrappers, everything prepared that can be."""
    import fmpy
    from fmpy.fmi2 import FMU2Slave
    from fmpy.fmi3 import FMU3Slave

    from cosim import ssp

    system = ssp.read(path)
    members = list(system.members.values())
    wanted = {c.source for c in system.connections} | set(RECORD)

    def run(count: int) -> Answer:
        slaves, places = [], {}
        for member in members:
            folder = str(member.fmu.folder)
            description = fmpy.read_model_description(folder, validate=False)
            vr = {v.name: v.valueReference for v in description.modelVariables}
            version = 3 if description.fmiVersion.startswith("3") else 2
            fmu = (FMU3Slave if version == 3 else FMU2Slave)(
                guid=description.guid, unzipDirectory=folder, instanceName=member.name,
                modelIdentifier=description.coSimulation.modelIdentifier,
            )  # fmt: skip
            fmu.instantiate()
            real = fmu.setFloat64 if version == 3 else fmu.setReal
            if version == 2:
                fmu.setupExperiment(startTime=0.0)
            for key, value in member.parameters.items():
                real([vr[key]], [float(value)])
            fmu.enterInitializationMode()
            into = [c for c in system.connections if c.target.startswith(member.name + ".")]
            out = sorted(n for n in wanted if n.startswith(member.name + "."))
            for index, name in enumerate(out):
                places[name] = (len(slaves), index)
            slaves.append(
                [fmu, real, fmu.getFloat64 if version == 3 else fmu.getReal,
                 [vr[c.target.partition(".")[2]] for c in into], [c.source for c in into],
                 [vr[n.partition(".")[2]] for n in out]]
            )  # fmt: skip
        for slave in slaves:
            slave[4] = [places[name] for name in slave[4]]
        y = [list(get(y_ref)) for _, _, get, _, _, y_ref in slaves]
        for _ in range(20):
            for _, set_, _, u_ref, sources, _ in slaves:
                set_(u_ref, [y[i][j] for i, j in sources])
            y = [list(get(y_ref)) for _, _, get, _, _, y_ref in slaves]
        for fmu, *_ in slaves:
            fmu.exitInitializationMode()
        y = [list(get(y_ref)) for _, _, get, _, _, y_ref in slaves]
        recorded = [places[name] for name in RECORD]
        rows = []
        clock = Clock()
        for k in range(count):
            if k % EVERY == 0:
                rows.append([y[i][j] for i, j in recorded])
            for _, set_, _, u_ref, sources, _ in slaves:
                set_(u_ref, [y[i][j] for i, j in sources])
            for fmu, *_ in slaves:
                fmu.doStep(k * STEP, STEP)
            y = [list(get(y_ref)) for _, _, get, _, _, y_ref in slaves]
        spent = clock.spent()
        final = [y[i][j] for i, j in (places[name] for name in FINAL)]
        for fmu, *_ in slaves:
            fmu.terminate()
            fmu.freeInstance()
        return _answer(*spent, count, final)

    return run


def libcosim(path: Path, _: str) -> Callable[[int], Answer]:
    """libcosim with a last-value observer, read as often as the others record."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.ERROR)

    def run(count: int) -> Answer:
        execution = CosimExecution.from_ssp_file(str(path), step_size=round(STEP * 1e9))
        observer = CosimObserver.create_last_value()
        execution.add_observer(observer)
        places = []
        for name in RECORD:
            instance, _, variable = name.partition(".")
            slave = execution.slave_index_from_instance_name(instance)
            found = [v.reference for v in execution.slave_variables(slave)
                     if v.name.decode() == variable]  # fmt: skip
            places.append((slave, found))
        rows = []
        clock = Clock()
        for _ in range(count // EVERY):
            if not execution.step(EVERY):
                raise RuntimeError("a step failed")
            rows.append([observer.last_real_values(slave, refs)[0] for slave, refs in places])
        return _answer(*clock.spent(), count, rows[-1][: len(FINAL)])

    return run


def ecos(path: Path, _: str) -> Callable[[int], Answer]:
    """Ecos through its Python binding, values read as often as the others record."""
    library = Path(sys.prefix) / "lib" / "libtbb.so.12"  # of the package tbb
    if library.is_file():
        ct.CDLL(str(library), ct.RTLD_GLOBAL)
    from ecospy import EcosLib, EcosSimulation

    EcosLib.set_log_level("warn")
    names = [name.replace(".", "::") for name in RECORD]

    def run(count: int) -> Answer:
        with EcosSimulation(STEP, ssp_path=str(path)) as simulation:
            simulation.init(parameter_set=PARAMETER_SET)
            rows = []
            clock = Clock()
            for _ in range(count // EVERY):
                simulation.step(EVERY)
                rows.append([simulation.get_real(name) for name in names])
            spent = clock.spent()
            simulation.terminate()
        return _answer(*spent, count, rows[-1][: len(FINAL)])

    return run


CLIENTS: dict[str, Callable[[Path, str], Callable[[int], Answer]]] = {
    "floor": floor, "kernel": ours, "python": ours, "fmpy": fmpy_loop, "libcosim": libcosim,
    "ecos": ecos,
}  # fmt: skip


def main() -> None:
    """Be one client."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("client", choices=CLIENTS)
    parser.add_argument("path", type=Path)
    options = parser.parse_args()
    run = CLIENTS[options.client](options.path, "c" if options.client == "kernel" else "python")
    print(json.dumps({"ready": True}), flush=True)
    for line in sys.stdin:
        print(json.dumps(run(int(line))), flush=True)


if __name__ == "__main__":
    main()
