"""What our own FMUs promise beyond FMI: units, descriptions, capabilities, dependencies, ports."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from typing import Any

from ..metadata import ENTRY
from .finding import Findings
from .model import FLOATS, Model
from .variables import size_of

_WAY_OUT = "build it again with 'cosim fmus build'"


def check_ours(
    model: Model, metadata: Mapping[str, Any], entries: Mapping[str, zipfile.ZipInfo],
    findings: Findings,
) -> None:  # fmt: skip
    """Check an FMU that carries component.json."""
    for variable in model.variables:
        where = (variable.line, variable.name)
        if variable.type in FLOATS and not (variable.get("unit") or variable.kind is not None):
            findings.error("has no unit", _WAY_OUT, *where)
        if not variable.outer.get("description"):
            findings.error("has no description", _WAY_OUT, *where)
    python = any(name.startswith("resources/slavemodule") for name in entries)
    state = "FMUstate" if model.fmi == 2 else "FMUState"
    wanted = [f"canGetAndSet{state}", f"canSerialize{state}"]
    if not python:
        wanted.append("providesDirectionalDerivative" + "s" * (model.fmi == 3))
    for title in ("CoSimulation",) if python else ("CoSimulation", "ModelExchange"):
        interface = model.root.find(title)
        if interface is None:
            findings.error(f"{title} is missing", _WAY_OUT, model.line(model.root))
            continue
        for flag in wanted:
            if interface.get(flag) != "true":
                findings.error(f"{title}: {flag} is not declared", _WAY_OUT, model.line(interface))
    place = "Outputs/Unknown" if model.fmi == 2 else "Output"
    for unknown in model.root.iterfind(f"ModelStructure/{place}"):
        if unknown.get("dependencies") is None:
            variable_ = model.refers(unknown.get(model.reference_name, ""))
            findings.error(
                "is an output without dependencies", _WAY_OUT, model.line(unknown),
                variable_.name if variable_ else "",
            )  # fmt: skip
    if not any(name.startswith("binaries/") for name in entries):
        findings.error("there is no binary", _WAY_OUT)
    if not python and "sources/model.c" not in entries:
        findings.error("the C sources are missing", _WAY_OUT)
    declared: set[str] = set()
    for variable in model.variables:
        size = size_of(model, variable) or 1
        declared.add(variable.name)
        if 1 < size < 1000:  # no port of ours is longer
            declared |= {f"{variable.name}[{i + 1}]" for i in range(size)}
    for port in metadata.get("ports", []):
        for name in (*port["effort"], *port["flow"]):
            if name not in declared:
                findings.error(
                    f"{ENTRY}: port {port['name']!r} names the unknown variable {name!r}", _WAY_OUT
                )
