"""Cost of one FMU step, called from C: `python -m benchmarks.fmu_step`.

A small C program (compiled here) loads each FMU's library, sets all inputs, steps and reads all
outputs, many times; the least time of several short rounds counts. The pythonfmu twin is stepped
through the same C loop where the host allows it, else through fmpy (marked).
"""

from __future__ import annotations

import argparse
import ctypes
import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from rich.console import Console
from rich.table import Table

from sources.packaging.build import build
from sources.packaging.platforms import PLATFORMS, host_platform
from tests.fmus import Slave, _unpacked

CASES = {
    "dc_motor/electrical": (0.3, 1e-3),
    "dc_motor/sampled": (None, 5e-5),
    "gearbox/ratio": (None, 1e-3),
    "gearbox/elastic": (None, 1e-3),
    "wheel_contact/stick_slip": (None, 1e-3),
    "caster/swivel": (None, 1e-3),
    "mobile_base/planar": (None, 1e-3),
    "mobile_base/six_dof": (5.0, 1e-3),
    "ur5_drive/servo": (None, 1e-3),
    "ur5_arm/rigid": (4.0, 1e-3),
    "ur5_arm/rigid_moving": (None, 1e-3),
    "crawler/track_contact": (None, 1e-3),
    "omni_base/dynamic": (None, 1e-3),
}
"""Variant: (limit of one internal step in µs, internal step in s)."""

DRIVER = r"""
#include <stddef.h>
#include <stdint.h>
#include <time.h>
typedef int (*Step)(void *, double, double, int);
typedef int (*Get)(void *, const uint32_t *, size_t, double *);
typedef int (*Set)(void *, const uint32_t *, size_t, const double *);
__attribute__((visibility("default")))
double run(void *c, Step step, Get get, Set set, const uint32_t *u, size_t nu, const double *values,
           const uint32_t *y, size_t ny, double *results, double h, long first, long n) {
  struct timespec a, b;
  clock_gettime(CLOCK_MONOTONIC, &a);
  for (long k = first; k < first + n; k++) {
    if (set(c, u, nu, values)) return -1;
    if (step(c, k * h, h, 1)) return -2;
    if (get(c, y, ny, results)) return -3;
  }
  clock_gettime(CLOCK_MONOTONIC, &b);
  return ((b.tv_sec - a.tv_sec) * 1e9 + (b.tv_nsec - a.tv_nsec)) / n;
}
"""


def load_driver(folder: Path) -> ctypes.CDLL:
    """Compile and load the loop in C."""
    source, library = folder / "driver.c", folder / "driver.so"
    source.write_text(DRIVER, encoding="utf-8")
    target = PLATFORMS[host_platform()].target
    command = [sys.executable, "-m", "ziglang", "cc", "-target", target, "-O2", "-shared", "-fPIC"]
    subprocess.run([*command, "-o", str(library), str(source)], check=True)
    loaded = ctypes.CDLL(str(library))
    loaded.run.restype = ctypes.c_double
    return loaded


def _address(function: object) -> ctypes.c_void_p:
    return ctypes.cast(function, ctypes.c_void_p)  # type: ignore[arg-type]


def measure(
    driver: ctypes.CDLL,
    path: Path,
    h: float,
    *,
    rounds: int,
    count: int,
    parameters: Mapping[str, float] | None = None,
) -> float:
    """Least time of one set-step-get round [µs]."""
    with Slave(path, initialize=False) as slave:
        step = {"solver.step": h} if "solver.step" in slave.vr else {}
        slave.initialize({**step, **(parameters or {})})
        raw = ctypes.CDLL(slave.fmu.dll._name)
        inputs, outputs = slave.names("input"), slave.names("output")
        start = {
            v.name: float(v.start)
            for v in slave.description.modelVariables
            if v.start and v.causality == "input"
        }
        u = (ctypes.c_uint32 * len(inputs))(*(slave.vr[name] for name in inputs))
        y = (ctypes.c_uint32 * len(outputs))(*(slave.vr[name] for name in outputs))
        values = (ctypes.c_double * len(inputs))(*(start.get(name, 0.0) for name in inputs))
        results = (ctypes.c_double * len(outputs))()
        best = float("inf")
        for k in range(rounds):
            spent = driver.run(
                ctypes.c_void_p(slave.fmu.component),
                _address(raw.fmi2DoStep),
                _address(raw.fmi2GetReal),
                _address(raw.fmi2SetReal),
                u,
                ctypes.c_size_t(len(inputs)),
                values,
                y,
                ctypes.c_size_t(len(outputs)),
                results,
                ctypes.c_double(h),
                ctypes.c_long(k * count),
                ctypes.c_long(count),
            )
            if spent < 0:
                raise RuntimeError(f"{path.name}: call {int(-spent)} failed: {slave.messages}")
            best = min(best, spent)
    return best / 1e3


def main() -> None:
    """Build, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    parser.add_argument("--variant", action="append", help="measure only these")
    options = parser.parse_args()
    out = Path("fmus")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        driver = load_driver(Path(folder))
        for name, (limit, h) in CASES.items():
            if options.variant and name not in options.variant:
                continue
            native = build(name, out=out)
            steps = native_states(native)
            microseconds = measure(driver, native, h, rounds=60, count=500)
            python = measure(driver, build(name, out=out, kind="python"), h, rounds=3, count=20)
            rows.append(
                {
                    "variant": name,
                    "states": steps,
                    "step_s": h,
                    "native_us": microseconds,
                    "limit_us": limit,
                    "python_us": python,
                }
            )
    if options.json:
        print(json.dumps({"rows": rows}))
        return
    titles = ("variant", "states", "step [s]", "native [µs]", "limit [µs]", "twin [µs]", "ratio")
    table = Table(*titles)
    for row in rows:
        table.add_row(
            row["variant"],
            str(row["states"]),
            f"{row['step_s']:g}",
            f"{row['native_us']:.3f}",
            "" if row["limit_us"] is None else f"{row['limit_us']:g}",
            f"{row['python_us']:.0f}",
            f"{row['python_us'] / row['native_us']:.0f}",
        )
    Console().print(table)


def native_states(path: Path) -> int:
    """Number of continuous states."""
    description, _ = _unpacked(path)
    return int(description.numberOfContinuousStates)


if __name__ == "__main__":
    main()
