"""Parts of SSP packages as other tools write them."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path

NAMES = " ".join(
    f'xmlns:{prefix}="http://ssp-standard.org/SSP1/SystemStructure{name}"'
    for prefix, name in {
        "ssd": "Description", "ssc": "Common", "ssv": "ParameterValues", "ssm": "ParameterMapping",
        "ssb": "SignalDictionary",
    }.items()
)  # fmt: skip
UNITS = """
<ssc:Unit name="rad/s"><ssc:BaseUnit rad="1" s="-1"/></ssc:Unit>
<ssc:Unit name="rpm"><ssc:BaseUnit rad="1" s="-1" factor="0.10471975511965977"/></ssc:Unit>
<ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit>
<ssc:Unit name="kg.m2"><ssc:BaseUnit kg="1" m="2"/></ssc:Unit>
<ssc:Unit name="g.m2"><ssc:BaseUnit kg="1" m="2" factor="0.001"/></ssc:Unit>
<ssc:Unit name="1"><ssc:BaseUnit/></ssc:Unit>
"""


def ssd(system: str, experiment: str = "", version: str = "1.0") -> str:
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription {NAMES} version="{version}" name="foreign">
<ssd:System name="root">{system}</ssd:System>
<ssd:Units>{UNITS}</ssd:Units>{experiment}</ssd:SystemStructureDescription>"""


def ssv(*parameters: str) -> str:
    return (
        f'<ssv:ParameterSet {NAMES} version="1.0" name="values"><ssv:Parameters>'
        f"{''.join(parameters)}</ssv:Parameters><ssv:Units>{UNITS}</ssv:Units></ssv:ParameterSet>"
    )


def real(name: str, value: object, unit: str = "") -> str:
    declared = f' unit="{unit}"' if unit else ""
    return f'<ssv:Parameter name="{name}"><ssv:Real value="{value}"{declared}/></ssv:Parameter>'


def ssm(*entries: str) -> str:
    return f'<ssm:ParameterMapping {NAMES} version="1.0">{"".join(entries)}</ssm:ParameterMapping>'


def binding(values: str, mapping: str = "", attributes: str = "") -> str:
    inner = f"<ssd:ParameterMapping>{mapping}</ssd:ParameterMapping>" if mapping else ""
    return (
        f"<ssd:ParameterBindings><ssd:ParameterBinding {attributes}><ssd:ParameterValues>{values}"
        f"</ssd:ParameterValues>{inner}</ssd:ParameterBinding></ssd:ParameterBindings>"
    )


def connectors(**kinds: str) -> str:
    """`y="output"` or `y="output Real rpm"`."""
    found = ""
    for name, text in kinds.items():
        kind, type_, unit = text.split(" ") if " " in text else (text, "Real", "")
        declared = f' unit="{unit}"' if unit else ""
        found += (
            f'<ssd:Connector name="{name}" kind="{kind}"><ssc:{type_}{declared}/></ssd:Connector>'
        )
    return f"<ssd:Connectors>{found}</ssd:Connectors>"


def component(name: str, source: str, inner: str = "", attributes: str = "") -> str:
    return f'<ssd:Component name="{name}" source="{source}" {attributes}>{inner}</ssd:Component>'


def connection(start: str, end: str, inner: str = "", attributes: str = "") -> str:
    """Ends as `element.connector`, or `.connector` of the system itself."""
    ends = ""
    for side, text in (("start", start), ("end", end)):
        element, _, connector = text.rpartition(".")
        ends += f' {side}Element="{element}"' if element else ""
        ends += f' {side}Connector="{connector}"'
    return f"<ssd:Connection{ends} {attributes}>{inner}</ssd:Connection>"


def system(
    elements: str, *connections: str, inner: str = "", name: str = "", after: str = ""
) -> str:
    content = f"{inner}<ssd:Elements>{elements}</ssd:Elements>"
    if connections:
        content += f"<ssd:Connections>{''.join(connections)}</ssd:Connections>"
    content += after
    return f'<ssd:System name="{name}">{content}</ssd:System>' if name else content


def package(path: Path, structure: str, files: Mapping[str, str | Path]) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", structure)
        for name, content in files.items():
            archive.writestr(name, content.read_bytes() if isinstance(content, Path) else content)
    return path


A = "resources/affine.fmu"
GEAR = "resources/gearbox.fmu"
