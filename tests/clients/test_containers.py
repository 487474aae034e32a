"""Containers that other tools make of our FMUs run beside ours and do what we do."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim import Master, System
from tests.fmus import fmu
from tests.outside import require

STEP, COUNT, TORQUE = 1e-3, 500, 0.1
LINKS = [("gearbox", "tau_b", "load", "tau"), ("gearbox", "J_b", "load", "J_added"),
         ("load", "w", "gearbox", "w_b")]  # fmt: skip
PARTS = {"gearbox": "gearbox/ratio", "load": "inertia/disc"}


def speeds(drive: Path | None) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Speed that an encoder reads on the container's shaft, or on that of our own system."""
    system = System()
    system.add("meter", str(fmu("encoder/counts")))
    if drive is not None:
        system.add("drive", str(drive))
        system.connect("drive.speed", "meter.w")
        torque = "drive.torque"
    else:
        for name, variant in PARTS.items():
            system.add(name, str(fmu(variant)))
        for source, output, target, entry in LINKS:
            system.connect(f"{source}.{output}", f"{target}.{entry}")
        system.connect("load.w", "meter.w")
        torque = "gearbox.tau_a"
    run = Master(system, "jacobi", STEP).run(
        STEP * COUNT, inputs={torque: TORQUE}, record=["meter.w_meas"]
    )
    return np.asarray(run.values[:, 0])


def by_fmucontainer(folder: Path) -> Path:
    """Made by the FMU manipulation toolbox."""
    require("fmu_manipulation_toolbox")
    for name, variant in PARTS.items():
        shutil.copy(fmu(variant), folder / f"{name}.fmu")
    rows = ["rule;from_fmu;from_port;to_fmu;to_port"]
    rows += [f"LINK;{a}.fmu;{b};{c}.fmu;{d}" for a, b, c, d in LINKS]
    rows += ["INPUT;;torque;gearbox.fmu;tau_a", "OUTPUT;load.fmu;w;;speed"]
    (folder / "drive.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    subprocess.run(
        [Path(sys.executable).with_name("fmucontainer"), "-container", f"drive.csv:{STEP}",
         "-fmu-directory", ".", "-no-auto-input", "-no-auto-output"],
        cwd=folder, check=True, capture_output=True,
    )  # fmt: skip
    return folder / "drive.fmu"


def by_fmpy(folder: Path, fmi: int) -> Path:
    """Made by FMPy, whose builder calls an FMI 2 connection's type by a name it cannot read."""
    from fmpy import read_model_description
    from fmpy.container_fmu.cli import create_container_fmu
    from fmpy.container_fmu.config import Component, Configuration, Connection
    from fmpy.model_description import CoSimulation, ModelDescription, ModelVariable, Unknown

    kind = "Real" if fmi == 2 else "Float64"
    parts, ports = {}, {}
    for name, variant in PARTS.items():
        path = shutil.copy(fmu(variant, fmi=fmi), folder / f"{name}.fmu")
        description = read_model_description(str(path))
        parts[name] = Component(name, Path(path), description)
        ports |= {(name, v.name): v for v in description.modelVariables}

    def variable(name: str, causality: str, **more: Any) -> ModelVariable:
        return ModelVariable(
            name=name, valueReference=0, type=kind, causality=causality, variability="continuous",
            **more,
        )  # fmt: skip

    torque, speed = variable("torque", "input", start="0"), variable("speed", "output")
    whole = ModelDescription(fmiVersion=f"{fmi}.0", modelName="drive", instantiationToken="{1}")
    whole.coSimulation = CoSimulation(modelIdentifier="container_fmu", fixedInternalStepSize=STEP)
    whole.modelVariables = [variable("time", "independent"), torque, speed]
    whole.outputs = [Unknown(variable=speed)]
    links = [
        Connection(parts[a], [ports[a, b]], parts[c], [ports[c, d]]) for a, b, c, d in LINKS
    ]  # fmt: skip
    mapping = {torque: [(parts["gearbox"], ports["gearbox", "tau_a"])],
               speed: [(parts["load"], ports["load", "w"])]}  # fmt: skip
    (folder / "unzipped").mkdir()
    made, target = folder / "made.fmu", folder / "drive.fmu"
    create_container_fmu(
        Configuration(False, whole, list(parts.values()), links, mapping), folder / "unzipped", made
    )
    with zipfile.ZipFile(made) as source, zipfile.ZipFile(target, "w") as archive:
        for name in source.namelist():
            content = source.read(name)
            if name.endswith("container.json"):
                content = content.replace(b'"Real"', b'"Float64"')
            archive.writestr(name, content)
    return target


@pytest.mark.parametrize("tool", ["fmucontainer", "fmpy 2", "fmpy 3"])
def test_a_container_runs_beside_ours(tmp_path: Path, tool: str) -> None:
    make = {"fmucontainer": by_fmucontainer, "fmpy 2": lambda f: by_fmpy(f, 2),
            "fmpy 3": lambda f: by_fmpy(f, 3)}[tool]  # fmt: skip
    theirs, ours = speeds(make(tmp_path)), speeds(None)
    assert np.ptp(ours) > 1.0
    # the container hands its speed on one step later than its parts have it, or not: exchange is
    # the same otherwise, so the values must be the same in one of the two alignments
    late = np.max(np.abs(theirs[1:] - ours[:-1]))
    same = np.max(np.abs(theirs - ours))
    assert min(late, same) <= 1e-12 * np.max(np.abs(ours))
