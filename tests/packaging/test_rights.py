"""What the archives say of who made them and under which licence."""

from __future__ import annotations

import tomllib
import zipfile
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from sources.packaging import rights
from tests.fmus import fmu

ROOT = Path(__file__).parents[2]


def test_licence_and_version_are_those_of_the_package() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    found = rights.attributes()
    assert (found["license"], found["version"]) == (project["license"], project["version"])
    assert found["author"] == "the cosim developers"
    assert found["copyright"] == "Copyright (c) 2026, the cosim developers"
    assert found["generationTool"] == f"cosim {project['version']}"


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "fmi"), [("native", 2), ("native", 3), ("python", 2)])
def test_every_kind_carries_them(kind: str, fmi: int) -> None:
    with zipfile.ZipFile(fmu("inertia/disc", kind, fmi)) as archive:
        root = ET.fromstring(archive.read("modelDescription.xml"))
        licences = {n for n in archive.namelist() if n.startswith("documentation/licenses/")}
        text = archive.read("documentation/licenses/license.txt")
    assert root.attrib.items() >= rights.attributes().items()
    assert "generationDateAndTime" not in root.attrib  # the same sources, the same bytes
    assert text == (ROOT / "LICENSE").read_bytes()
    foreign = {"documentation/licenses/pythonfmu.txt"} if kind == "python" else set()
    assert licences == {"documentation/licenses/license.txt"} | foreign
