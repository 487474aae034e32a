"""Check FMUs: fmpy's validation of any, and our contract for our own."""

from __future__ import annotations

import json
import zipfile
import zlib
from pathlib import Path
from xml.etree import ElementTree as ET

from fmpy.model_description import ModelDescription, ValidationError, read_model_description

_ENTRY = "extra/cosim/component.json"
# what zipfile raises for a member that it cannot give: checksum, stream, truncation, method
_DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, OSError)


def check(path: Path) -> list[str]:
    """Problems of an FMU, an empty list if there is none.

    For any FMU: the archive is readable, the model description valid and consistent. For ours also:
    every variable has a unit and a description, the capabilities that we promise are declared,
    output dependencies are given, ports name existing variables, and a binary or a slave is there.
    """
    contents: dict[str, bytes] = {}
    try:
        with zipfile.ZipFile(path) as archive:
            for name in archive.namelist():
                try:
                    contents[name] = archive.read(name)
                except _DAMAGE as error:
                    return [f"{path.name}: the file {name} in the archive is damaged ({error})"]
    except (OSError, zipfile.BadZipFile) as error:
        return [f"{path.name}: not a readable .fmu archive ({error})"]
    if "modelDescription.xml" not in contents:
        return [f"{path.name}: the archive has no modelDescription.xml"]
    try:
        ours = json.loads(contents[_ENTRY]) if _ENTRY in contents else None
    except ValueError as error:
        return [f"{path.name}: {_ENTRY} cannot be read ({error})"]
    try:
        model = read_model_description(str(path), validate=True)
    except ValidationError as error:
        return [f"{path.name}: {problem}" for problem in error.problems]
    except Exception as error:  # fmpy raises plain Exception for XML that it cannot read
        return [f"{path.name}: {error}"]
    root = ET.fromstring(contents["modelDescription.xml"])
    problems = _problems_of_ours(model, root, ours, set(contents)) if ours else []
    return [f"{path.name}: {problem}" for problem in problems]


def _problems_of_ours(
    model: ModelDescription, root: ET.Element, ours: dict[str, object], names: set[str]
) -> list[str]:
    problems = []
    for variable in model.modelVariables:
        if variable.type in ("Real", "Float64") and not (variable.unit or variable.declaredType):
            problems.append(f"variable {variable.name!r} has no unit")
        if not variable.description:
            problems.append(f"variable {variable.name!r} has no description")
    python = any(name.startswith("resources/slavemodule") for name in names)
    three = root.get("fmiVersion", "").startswith("3")
    wanted = [f"canGetAndSetFMU{'S' if three else 's'}tate"]
    wanted.append(f"canSerializeFMU{'S' if three else 's'}tate")
    if not python:
        wanted.append("providesDirectionalDerivative" + "s" * three)
    for title in ("CoSimulation",) if python else ("CoSimulation", "ModelExchange"):
        interface = root.find(title)
        if interface is None:
            problems.append(f"{title} is missing")
            continue
        problems += [
            f"{title}: {flag} is not declared" for flag in wanted if interface.get(flag) != "true"
        ]
    problems += [
        f"output {unknown.variable.name!r} declares no dependencies"
        for unknown in model.outputs
        if unknown.dependencies is None
    ]
    declared = {variable.name for variable in model.modelVariables}
    for port in ours["ports"]:  # type: ignore[attr-defined]
        for variable in (*port["effort"], *port["flow"]):
            if variable not in declared:
                problems.append(f"port {port['name']!r} names the unknown variable {variable!r}")
    if not any(name.startswith("binaries/") for name in names):
        problems.append("there is no binary")
    if not python and "sources/model.c" not in names:
        problems.append("the C sources are missing")
    return problems
