"""FMUs of a few lines without a binary, for tests of what is read and checked."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path

REAL = '<ScalarVariable name="{name}" valueReference="{vr}" {more}><Real {real}/></ScalarVariable>'
U = REAL.format(name="u", vr=0, more='causality="input"', real='start="1.0"')
Y = REAL.format(name="y", vr=1, more='causality="output"', real="")
STRUCTURE2 = (
    '<Outputs><Unknown index="2" dependencies="1"/></Outputs>'
    '<InitialUnknowns><Unknown index="2" dependencies="1"/></InitialUnknowns>'
)
U3 = '<Float64 name="u" valueReference="1" causality="input" start="1.0"/>'
Y3 = '<Float64 name="y" valueReference="2" causality="output"/>'
T3 = '<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>'
STRUCTURE3 = '<Output valueReference="2"/><InitialUnknown valueReference="2"/>'


def fmi2(
    variables: str = U + Y,
    structure: str = STRUCTURE2,
    definitions: str = "",
    root: str = "",
    interface: str = '<CoSimulation modelIdentifier="m"/>',
) -> str:
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<fmiModelDescription fmiVersion="2.0" modelName="m" guid="g" {root}>\n{interface}\n'
        f"{definitions}<ModelVariables>\n{variables}\n</ModelVariables>\n"
        f"<ModelStructure>{structure}</ModelStructure>\n</fmiModelDescription>"
    )


def fmi3(
    variables: str = T3 + U3 + Y3,
    structure: str = STRUCTURE3,
    definitions: str = "",
    root: str = "",
    interface: str = '<CoSimulation modelIdentifier="m"/>',
) -> str:
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t" '
        f"{root}>\n{interface}\n{definitions}<ModelVariables>\n{variables}\n</ModelVariables>\n"
        f"<ModelStructure>{structure}</ModelStructure>\n</fmiModelDescription>"
    )


def pack(path: Path, xml: str | bytes, files: Mapping[str, bytes] | None = None) -> Path:
    """An archive with a description, a stand-in for a binary and further files."""
    folder = "x86_64-linux" if "fmi3" in str(xml) or 'fmiVersion="3' in str(xml) else "linux64"
    contents: dict[str, str | bytes] = {
        "modelDescription.xml": xml, f"binaries/{folder}/m.so": b"never loaded", **(files or {}),
    }  # fmt: skip
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents.items():
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    return path
